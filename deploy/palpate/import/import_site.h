// SPDX-License-Identifier: Apache-2.0
// import_site.h — how an imported organ lies, where it is touched, and its surfaces as STL.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "common/contact/bounds.h"
#include "deploy/scan/label_map.h"
#include "physics_node/surfaces/triangle_surface.h"

namespace palpate {

/// Of the file of a label's surface, without its ending: plain letters, digits and '_'.
[[nodiscard]] std::string surface_name_of(const std::string& label);
/// How the files of stl_text() begin.
inline constexpr const char* kStlBegin = "palpate import: metres, frame W of the session";
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

/// @throws SetupError  smaller than 1 mm or larger than 5 m: a wrong unit in the file of the map
void check_extent(const Bounds& bounds, const std::string& file);

/// A warning if voxels of the body lie more than a cell outside the bounds of its mesh, else "".
/// @param moved_m  from the frame of the map to that of the mesh
[[nodiscard]] std::string missing_report(const scan::LabelMap& map, const Vector3& moved_m,
                                         const Bounds& mesh, double cell_m);

inline constexpr double kGravity_m_per_s2 = 9.81;

/// Turns the patient's right, anterior, superior into W, so that the named side is +z: x is the
/// patient's left and y the head if anterior is up. @throws SetupError  no such side
[[nodiscard]] Matrix3 world_of_ras(const std::string& up);

/// Gravity in a scan in this posture (supine, prone, left, right: the side that is down, standing
/// or none), in right, anterior, superior. @throws SetupError  no such posture
[[nodiscard]] Vector3 scan_gravity_m_per_s2(const std::string& posture);

}  // namespace palpate
