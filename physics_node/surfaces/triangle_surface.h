// triangle_surface.h — the exact signed distance to a mesh of triangles.
//
// The sign is that of the angle-weighted normal of the nearest face, edge or corner, which is exact
// for closed meshes (Source: [Baerentzen05]). Inside a convex mesh the nearest face changes from
// one to the next, and the normal jumps there by the angle between them, as it does in a box. An
// open mesh is a sheet: what lies in front of the nearest face is outside, also beyond the border;
// the scene lets a tool be behind it all the same (physics_node/contact/proxy.h).
//
// The facets stand for a smooth surface, so a view is trusted beyond the nearest one: as far as its
// neighbours, at the angle they have with it, stay within 0.1 mm of what is described, and no
// farther than they are known. Over a fine mesh of a smooth organ that is about a facet, over a
// sharp edge 0.1 mm past it. The other side of a thin sheet is not foreseen.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/core/vector.h"
#include "physics_node/contact/surface.h"

namespace palpate::physics {

struct TriangleMesh {
  std::vector<Vector3> vertices_m;
  /// Corners counter-clockwise, seen from outside the tissue.
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// Volume enclosed; below 0 if the triangles face inwards. Means nothing for an open mesh.
[[nodiscard]] double enclosed_volume_m3(const TriangleMesh& mesh);

/// What keeps the mesh from having an inside and an outside, naming the triangle (from 1), or "":
/// no triangles; one without area; an edge that three share, or that two run through in the same
/// direction; a closed mesh that faces inwards.
[[nodiscard]] std::string complaint_about(const TriangleMesh& mesh);

class TriangleSurface final : public Surface {
 public:
  /// @param mesh  complaint_about(mesh) is empty
  explicit TriangleSurface(TriangleMesh mesh);

  [[nodiscard]] SurfaceView view(const Vector3& point_m, SurfaceHint& hint) const noexcept override;
  using Surface::view;
  [[nodiscard]] Bounds bounds() const noexcept override;
  /// The mesh itself; of more than 50 000 vertices those that share a cell of a grid become one.
  [[nodiscard]] SurfaceMesh display_mesh() const override;
  [[nodiscard]] std::size_t bytes() const noexcept override;

  [[nodiscard]] const TriangleMesh& mesh() const noexcept { return mesh_; }
  [[nodiscard]] bool is_sheet() const noexcept override { return !is_closed_; }
  [[nodiscard]] bool is_closed() const noexcept { return is_closed_; }

 private:
  struct Node {
    Vector3 lowest_m;
    Vector3 highest_m;
    std::uint32_t first = 0;  // triangle of a leaf, else the second child; the first one follows
    std::uint32_t count = 0;  // triangles of a leaf, else 0
  };
  // nearest point of a triangle
  struct Foot {
    Vector3 point_m = Vector3::Zero();
    double squared_distance = 0.0;
    std::uint32_t triangle = 0;
    std::int8_t edge = -1;    // from corner `edge` to the next, if the foot is on it
    std::int8_t corner = -1;  // if the foot is there
  };
  void build(std::vector<std::uint32_t>& order, std::size_t first, std::size_t last);
  [[nodiscard]] double trust_radius_m(const Foot& foot, const Vector3& point_m) const noexcept;
  [[nodiscard]] Foot foot_on(std::uint32_t triangle, const Vector3& point_m) const noexcept;

  TriangleMesh mesh_;
  std::vector<Vector3> face_normals_;
  std::vector<std::array<Vector3, 3>> edge_normals_;  // of a triangle's three edges
  std::vector<Vector3> vertex_normals_;
  std::vector<Node> nodes_;
  bool is_closed_ = false;
};

}  // namespace palpate::physics
