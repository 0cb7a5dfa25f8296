// SPDX-License-Identifier: Apache-2.0
// import_site.h — where an imported organ is touched, and its surfaces as STL.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "deploy/scan/label_map.h"
#include "physics_node/surfaces/triangle_surface.h"

namespace palpate {

/// STL, binary, in metres of W.
[[nodiscard]] std::string stl_text(const physics::TriangleMesh& surface);

/// Heights at which the line along z at (x, y) meets the surface: the highest, and the next below;
/// −∞ if it does not.
struct Column {
  double top_m = -std::numeric_limits<double>::infinity();
  double below_m = -std::numeric_limits<double>::infinity();
};
[[nodiscard]] Column column_at(const physics::TriangleMesh& surface, double x, double y);

/// Centre of the largest part of the target (of the body if there is none), and the highest voxel
/// of the body above it, or nearest to that line.
struct Site {
  Vector3 centre_m = Vector3::Zero();
  Vector3 top_m = Vector3::Zero();
};
/// @param map     of one body   @param target  a segment of it, by index
[[nodiscard]] Site site_of(const scan::LabelMap& map, const std::optional<std::uint32_t>& target);

}  // namespace palpate
