// SPDX-License-Identifier: Apache-2.0
// ply.h — point clouds from PLY files: ASCII, binary of either byte order.
#pragma once

#include <string>
#include <string_view>

#include "physics_node/surfaces/cloud_surface.h"

namespace palpate::physics {

/// The element `vertex` with the properties x, y, z, and the normals nx, ny, nz if present; other
/// elements and properties are ignored. Lengths in the unit of the file.
/// @param stiffness_property  property of the vertices to read as stiffness_ratios; "": none
/// @throws SetupError  naming file and line or vertex: not a PLY file, incomplete, numbers that are
///     not finite, a normal without length, a negative stiffness, too few points
[[nodiscard]] PointCloud parse_ply(std::string_view bytes, const std::string& file_name,
                                   const std::string& stiffness_property = "");

/// The cloud as a binary little-endian PLY file of float: positions, and, if present, normals and
/// `stiffness_ratio`.
[[nodiscard]] std::string ply_text(const PointCloud& cloud);

}  // namespace palpate::physics
