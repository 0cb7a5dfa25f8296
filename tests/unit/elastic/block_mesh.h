// SPDX-License-Identifier: Apache-2.0
// block_mesh.h — a block of linear tetrahedra as a file has it.
#pragma once

#include "physics_node/elastic/mesh.h"
#include "physics_node/files/tetrahedral_files.h"

namespace palpate::physics {

/// 100 × 100 × 50 mm, its top at z = 0. The parameters are those of elastic::block_mesh.
inline TetrahedralMesh block_of(int cells, int cells_deep, double first_m) {
  const elastic::Mesh block = elastic::block_mesh(cells, cells_deep, first_m);
  TetrahedralMesh mesh;
  for (const Vector3& node_m : block.nodes_m) {
    mesh.nodes_m.emplace_back(node_m - Vector3(0.05, 0.05, 0.05));
  }
  for (std::size_t e = 0; e < block.element_count(); ++e) {
    const auto corners = block.element(e);
    mesh.tetrahedra.push_back({corners[0], corners[1], corners[2], corners[3]});
  }
  return mesh;
}

}  // namespace palpate::physics
