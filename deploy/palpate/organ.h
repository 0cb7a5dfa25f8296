// SPDX-License-Identifier: Apache-2.0
// organ.h — a synthetic organ: a smooth lobed body with a dent at the place of the vessels and a
// stiff lump below its upper side, as a point cloud and as a tetrahedral mesh.
#pragma once

#include <cstdint>
#include <functional>

#include "physics_node/surfaces/cloud_surface.h"
#include "physics_node/surfaces/tetrahedral_mesh.h"

namespace palpate {

/// About 120 × 80 × 50 mm around the origin, in metres; stiffness_ratios rise from 1 to 2.9 over
/// the lump.
/// @param points  ≥ CloudSurface::kMinPoints; 3000 are 2.7 mm apart
/// @param on_progress  called with the share that is done, 0 … 1; may be empty
[[nodiscard]] physics::PointCloud organ_cloud(std::uint32_t points,
                                              const std::function<void(double)>& on_progress = {});

/// The same body. Its surface is an icosahedron subdivided `subdivisions` times; inside are two
/// layers and a core. 2 subdivisions give 2240 tetrahedra, each further one four times as many.
/// @param subdivisions  0 … 6
[[nodiscard]] physics::TetrahedralMesh organ_mesh(std::uint32_t subdivisions);

/// Whether the place is within that body.
[[nodiscard]] bool is_in_organ(const Vector3& place_m);

/// A block of 100 × 100 × 50 mm below z = 0, finest around the middle of its top, of
/// 20 `cells`³ tetrahedra.
/// @param cells  2 … 16
[[nodiscard]] physics::TetrahedralMesh block_mesh(std::uint32_t cells);

}  // namespace palpate
