// SPDX-License-Identifier: Apache-2.0
// ros_export.h — a recording for tools of ROS 2 (rosbag2's MCAP plug-in, PlotJuggler, Foxglove):
// poses and wrenches in CDR (little-endian XCDR1, as rosbag2 stores it) with their message
// definitions, on topics named as in CRTK. Needs nothing of ROS.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "common/core/vector.h"
#include "viewer_node/recording/recording_file.h"

namespace palpate::viewer::ros {

/// A message type, its definition followed by those of the types it uses.
struct Schema {
  std::string_view name;
  std::string_view definition;
};
inline constexpr Schema kPoseStamped{"geometry_msgs/msg/PoseStamped", R"(std_msgs/Header header
geometry_msgs/Pose pose
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
)"};
inline constexpr Schema kWrenchStamped{"geometry_msgs/msg/WrenchStamped", R"(std_msgs/Header header
geometry_msgs/Wrench wrench
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: geometry_msgs/Wrench
geometry_msgs/Vector3 force
geometry_msgs/Vector3 torque
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
)"};

/// When and in which frame. @param wall_ns  since 1970, UTC
struct Header {
  std::uint64_t wall_ns = 0;
  std::string_view frame_id;
};

/// m and a unit quaternion.
[[nodiscard]] std::string pose_stamped(const Header& header, const Vector3& position_m,
                                       const Quaternion& orientation);
/// N and N·m.
[[nodiscard]] std::string wrench_stamped(const Header& header, const Vector3& force_newton,
                                         const Vector3& torque_newton_m);

}  // namespace palpate::viewer::ros

namespace palpate {

/// Writes, of every tick of every side, behind "/SIDE" where there are several: /measured_cp (pose
/// of the tool's tip, frame "world"), /servo_cf (force that the clamp commanded) and /measured_cf
/// (force that the motors applied), both on the hand, frame "SIDE_device_base". Stamps are wall
/// time; in a recording of loopback, time since its begin. The file appears when it is complete.
/// Throws SetupError, std::runtime_error if writing fails.
/// @param on_progress  called with the share that is read, 0 … 1; may be empty
void export_ros(RecordingFile& recording, const std::string& file, bool may_overwrite,
                const std::function<void(double)>& on_progress = {});

}  // namespace palpate
