// organ.h — an organ that nobody had to scan: a smooth lobed body with a dent where its vessels
// would enter and a stiff lump below its upper side, as a cloud of points and as a mesh of
// tetrahedra.
#pragma once

#include <cstdint>

#include "physics_node/surfaces/cloud_surface.h"
#include "physics_node/files/tetrahedral_mesh.h"

namespace palpate {

/// About 120 × 80 × 50 mm round the origin, in metres; stiffness_ratios grow from 1 to 2.9
/// over the lump.
/// @param points  ≥ CloudSurface::kMinPoints; 3000 are 2.7 mm apart
[[nodiscard]] physics::PointCloud organ_cloud(std::uint32_t points);

/// The same body, its surface an icosahedron cut `subdivisions` times, below it two layers and a
/// core: 2: 2240 tetrahedra, each more four times as many.
/// @param subdivisions  0 … 6
[[nodiscard]] physics::TetrahedralMesh organ_mesh(std::uint32_t subdivisions);

}  // namespace palpate
