// SPDX-License-Identifier: Apache-2.0
// lattice.h — the background of isosurface stuffing: a body-centred cubic lattice, graded by an
// octree whose neighbouring leaves differ by a factor of two at most.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/core/vector.h"
#include "deploy/scan/stuffing.h"

namespace palpate::scan {

struct Lattice {
  std::vector<Vector3> nodes_m;
  std::vector<std::array<std::int32_t, 3>> places;  ///< of the nodes, in halves of the finest cell
  std::vector<std::array<std::uint32_t, 4>> tetrahedra;  ///< positive volume, conforming
  std::vector<bool> is_regular;  ///< of the nodes: all elements there are between equal cubes
};

/// Covers the bounds; all cubes that the surface may cross, and their neighbours, are the finest.
[[nodiscard]] Lattice lattice_of(const Stuffing& stuffing);

}  // namespace palpate::scan
