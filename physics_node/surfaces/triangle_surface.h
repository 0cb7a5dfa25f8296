// SPDX-License-Identifier: Apache-2.0
// triangle_surface.h — the exact signed distance to a mesh of triangles.
//
// The sign is that of the angle-weighted normal of the nearest face, edge or corner, which is exact
// for closed meshes (Source: [Baerentzen05]). Inside a convex mesh the nearest face changes with
// the position, and the normal jumps there by the angle between the faces, as in a box. An open
// mesh is a sheet: a point in front of the nearest face is outside, also beyond the border. The
// proxy nevertheless lets a tool be behind a sheet (common/contact/proxy.h).
//
// The facets approximate a smooth surface, so the trust radius extends beyond the nearest facet: as
// far as its neighbours, at their angle to it, stay within 0.1 mm of the description, and not
// beyond these neighbours. On a fine mesh of a smooth organ that is about one facet, at a sharp
// edge 0.1 mm past it. The trust radius does not account for the other side of a thin sheet.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/contact/facet.h"
#include "common/core/vector.h"
#include "physics_node/surfaces/box_tree.h"
#include "physics_node/surfaces/file_surface.h"

namespace palpate::physics {

struct TriangleMesh {
  std::vector<Vector3> vertices_m;
  /// Corners counter-clockwise, seen from outside the tissue.
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// Enclosed volume; below 0 if the triangles face inwards. Meaningless for an open mesh.
[[nodiscard]] double enclosed_volume_m3(const TriangleMesh& mesh);

/// Why the mesh has no well-defined inside and outside, naming the triangle (from 1), or "": no
/// triangles; a triangle without area; an edge that three triangles share, or that two traverse in
/// the same direction; a closed mesh that faces inwards.
[[nodiscard]] std::string complaint_about(const TriangleMesh& mesh);

class TriangleSurface final : public FileSurface {
 public:
  /// @param mesh  complaint_about(mesh) is empty
  explicit TriangleSurface(TriangleMesh mesh);

  [[nodiscard]] SurfaceView view(const Vector3& point_m, SurfaceHint& hint) const noexcept override;
  using Surface::view;
  [[nodiscard]] Bounds bounds() const noexcept override { return tree_.bounds(); }
  [[nodiscard]] std::size_t bytes() const noexcept override;

  [[nodiscard]] const TriangleMesh& mesh() const noexcept { return mesh_; }
  [[nodiscard]] bool is_sheet() const noexcept override { return !is_closed_; }
  [[nodiscard]] bool is_closed() const noexcept { return is_closed_; }

 private:
  struct Foot : FacetFoot {
    std::uint32_t triangle = 0;
  };
  [[nodiscard]] double trust_radius_m(const Foot& foot, const Vector3& point_m) const noexcept;

  TriangleMesh mesh_;  // triangles in the order of the tree
  std::vector<Vector3> face_normals_;
  std::vector<std::array<Vector3, 3>> edge_normals_;  // of a triangle's three edges
  std::vector<Vector3> vertex_normals_;
  BoxTree tree_;
  bool is_closed_ = false;
};

}  // namespace palpate::physics
