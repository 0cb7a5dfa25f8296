// SPDX-License-Identifier: Apache-2.0
// import_reach.h — how the workspace of a device is laid over an organ, and what it reaches of it.
#pragma once

#include <string>

#include "common/session/driver_config.h"
#include "physics_node/surfaces/triangle_surface.h"

namespace palpate {

/// A device whose workspace is laid over the organ.
struct ReachDevice {
  std::string name = "the simulated device";
  Vector3 half_extent_m = kSimulatedHalfExtent_m;  ///< D
};
/// Of the first side of a session, by its file. @throws SetupError  also where the driver is a
/// plug-in, which tells its workspace only when the device is open
[[nodiscard]] ReachDevice reach_device_of(const std::string& session_file);
/// @param size_mm  edges of the workspace, x y z of D
[[nodiscard]] ReachDevice reach_device_of_size(const Vector3& size_mm);

/// What is touched, in W: the tip at the origin from `above_m` over it to `below_m` under it.
struct ReachTarget {
  double tip_radius_m = 0.0;
  double above_m = 0.02;
  double below_m = 0.0;
};

struct Reach {
  double scale_ratio = 1.0;            ///< device.workspace
  Vector3 offset_m = Vector3::Zero();  ///< device.workspace: the middle of what is reached
  double surface_ratio = 0.0;          ///< of the surface's area, by the centre of the tip on it
  double upper_ratio = 0.0;            ///< of the area of its faces that look up
  bool has_target = false;             ///< the target and a way to it are reached

  /// Of the hand in D, for the tool in W.
  [[nodiscard]] Vector3 hand_m(const Vector3& tool_m) const {
    return (tool_m - offset_m) / scale_ratio;
  }
};

/// True to scale if the upper side fits into the workspace; else enlarged up to kMostScale, and if
/// that is not enough as far over the middle of the organ as leaves the target within reach.
[[nodiscard]] Reach propose_reach(const physics::TriangleMesh& surface, const ReachDevice& device,
                                  const ReachTarget& target);
inline constexpr double kMostScale = 2.0;

/// Lines of a report.
[[nodiscard]] std::string reach_report(const Reach& reach, const ReachDevice& device);

}  // namespace palpate
