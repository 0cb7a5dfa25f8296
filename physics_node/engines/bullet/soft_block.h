// SPDX-License-Identifier: Apache-2.0
// soft_block.h — a box of tetrahedra as a deformable body of Bullet.
#pragma once

#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btSoftBody.h>

#include <memory>

namespace palpate::engines {

struct BlockSize {
  int cells_across = 6;       ///< along x and y
  int cells_deep = 3;         ///< along z
  double cell_m = 0.1 / 6.0;  ///< edge of a cell, a cube of five tetrahedra
};

/// The block, its upper face centred at the origin of W, its lower face fixed.
/// @param world  must outlive it
[[nodiscard]] std::unique_ptr<btSoftBody> soft_block(btSoftBodyWorldInfo& world,
                                                     const BlockSize& size,
                                                     double density_kg_per_m3);

}  // namespace palpate::engines
