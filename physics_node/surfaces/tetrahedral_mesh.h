// SPDX-License-Identifier: Apache-2.0
// tetrahedral_mesh.h — volume meshes, and their surface.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "common/core/vector.h"
#include "physics_node/surfaces/triangle_surface.h"

namespace palpate::physics {

struct TetrahedralMesh {
  std::vector<Vector3> nodes_m;  ///< each used by some tetrahedron
  /// Positive volume: seen from corner 3 the corners 0, 1, 2 are counter-clockwise.
  std::vector<std::array<std::uint32_t, 4>> tetrahedra;
  /// Of each element an index into region_names; empty: the file has no regions.
  std::vector<std::uint16_t> regions{};
  std::vector<std::string> region_names{};
};

/// Six times the volume of a tetrahedron with these nodes, m³; below 0 if it is inverted.
[[nodiscard]] double six_volumes_m3(const std::vector<Vector3>& nodes_m,
                                    const std::array<std::uint32_t, 4>& corners) noexcept;

/// Removes the nodes that no tetrahedron uses; the others keep their order.
void drop_unused_nodes(TetrahedralMesh& mesh);

/// The faces that belong to one element only, facing outwards.
[[nodiscard]] TriangleMesh surface_of(const TetrahedralMesh& mesh);

}  // namespace palpate::physics
