// SPDX-License-Identifier: Apache-2.0
#include "physics_node/surfaces/tetrahedral_mesh.h"

#include <algorithm>
#include <utility>

namespace palpate::physics {

double six_volumes_m3(const std::vector<Vector3>& nodes_m,
                      const std::array<std::uint32_t, 4>& corners) noexcept {
  const Vector3& origin = nodes_m[corners[0]];
  return (nodes_m[corners[1]] - origin)
      .cross(nodes_m[corners[2]] - origin)
      .dot(nodes_m[corners[3]] - origin);
}

void drop_unused_nodes(TetrahedralMesh& mesh) {
  constexpr std::uint32_t kUnused = 0xffffffff;
  std::vector<std::uint32_t> place(mesh.nodes_m.size(), kUnused);
  for (const auto& corners : mesh.tetrahedra) {
    for (const std::uint32_t corner : corners) place[corner] = 0;
  }
  std::vector<Vector3> used;
  for (std::size_t i = 0; i < place.size(); ++i) {
    if (place[i] == kUnused) continue;
    place[i] = static_cast<std::uint32_t>(used.size());
    used.push_back(mesh.nodes_m[i]);
  }
  for (auto& corners : mesh.tetrahedra) {
    for (std::uint32_t& corner : corners) corner = place[corner];
  }
  mesh.nodes_m = std::move(used);
}

TriangleMesh surface_of(const TetrahedralMesh& mesh) {
  struct Face {
    std::array<std::uint32_t, 3> sorted;
    std::array<std::uint32_t, 3> corners;  // counter-clockwise from outside the element
  };
  std::vector<Face> faces;
  faces.reserve(4 * mesh.tetrahedra.size());
  for (const auto& [a, b, c, d] : mesh.tetrahedra) {
    for (const std::array<std::uint32_t, 3>& corners :
         {std::array{a, c, b}, std::array{a, b, d}, std::array{b, c, d}, std::array{a, d, c}}) {
      Face face{corners, corners};
      std::sort(face.sorted.begin(), face.sorted.end());
      faces.push_back(face);
    }
  }
  std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) {
    return a.sorted != b.sorted ? a.sorted < b.sorted : a.corners < b.corners;
  });

  TriangleMesh surface;
  constexpr std::uint32_t kUnused = 0xffffffff;
  std::vector<std::uint32_t> place(mesh.nodes_m.size(), kUnused);
  for (std::size_t begin = 0, end = 0; begin < faces.size(); begin = end) {
    while (end < faces.size() && faces[end].sorted == faces[begin].sorted) ++end;
    if (end - begin != 1) continue;
    std::array<std::uint32_t, 3> triangle = faces[begin].corners;
    for (std::uint32_t& corner : triangle) {
      if (place[corner] == kUnused) {
        place[corner] = static_cast<std::uint32_t>(surface.vertices_m.size());
        surface.vertices_m.push_back(mesh.nodes_m[corner]);
      }
      corner = place[corner];
    }
    surface.triangles.push_back(triangle);
  }
  return surface;
}

}  // namespace palpate::physics
