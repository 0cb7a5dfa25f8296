// SPDX-License-Identifier: Apache-2.0
// subdivision.h — finer triangles on the unit sphere.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/core/vector.h"

namespace palpate::physics {

/// A triangle mesh whose vertices are unit vectors.
struct DirectionMesh {
  std::vector<Vector3> directions;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// Twenty triangles, counter-clockwise seen from outside.
[[nodiscard]] DirectionMesh icosahedron();

/// Divides each triangle into four at the midpoints of its edges, moved onto the sphere.
void subdivide(DirectionMesh& mesh);

}  // namespace palpate::physics
