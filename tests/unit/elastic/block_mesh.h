// SPDX-License-Identifier: Apache-2.0
// block_mesh.h — a block of linear tetrahedra as a file has it.
#pragma once

#include "physics_node/elastic/mesh.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/support/elastic/tetrahedra_of.h"

namespace palpate::physics {

/// 100 × 100 × 50 mm, its top at z = 0. The parameters are those of elastic::block_mesh.
inline TetrahedralMesh block_of(int cells, int cells_deep, double first_m) {
  return test::tetrahedra_of(elastic::block_mesh(cells, cells_deep, first_m),
                             {-0.05, -0.05, -0.05});
}

}  // namespace palpate::physics
