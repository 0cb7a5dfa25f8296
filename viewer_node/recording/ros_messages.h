// ros_messages.h — poses and forces as messages of ROS 2, for recordings that ROS tools read: CDR
// (little-endian XCDR1, as rosbag2 stores it) and the message definitions that go with it. Needs
// nothing of ROS.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/core/vector.h"

namespace palpate::viewer::ros {

/// Encodings of a channel and its schema in MCAP.
inline constexpr std::string_view kMessageEncoding = "cdr";
inline constexpr std::string_view kSchemaEncoding = "ros2msg";

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
