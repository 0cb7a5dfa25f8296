// SPDX-License-Identifier: Apache-2.0
// messages.h — the messages of ROS 2 as idlc generates them from ros_messages.idl, under shorter
// names, and what each type is called by DDS and by ROS 2.
#pragma once

#include <ros_messages.h>

#include <cstdint>
#include <string>

#include "common/core/vector.h"
#include "deploy/ros/dds/type_hashes.h"

namespace palpate::ros {

using Header = std_msgs_msg_dds__Header_;
using Float64 = std_msgs_msg_dds__Float64_;
using Point = geometry_msgs_msg_dds__Point_;
using PoseStamped = geometry_msgs_msg_dds__PoseStamped_;
using TwistStamped = geometry_msgs_msg_dds__TwistStamped_;
using WrenchStamped = geometry_msgs_msg_dds__WrenchStamped_;
using TransformStamped = geometry_msgs_msg_dds__TransformStamped_;
using TFMessage = tf2_msgs_msg_dds__TFMessage_;
using JointState = sensor_msgs_msg_dds__JointState_;
using Joy = sensor_msgs_msg_dds__Joy_;
using Marker = visualization_msgs_msg_dds__Marker_;
using OperatingState = crtk_msgs_msg_dds__OperatingState_;

/// What DDS and ROS 2 know of a type.
struct TopicType {
  const dds_topic_descriptor_t* descriptor = nullptr;
  const char* hash = "";  ///< RIHS01_…
};
/// geometry_msgs/msg/PoseStamped
[[nodiscard]] std::string ros_name_of(const TopicType& type);

template <class T>
struct TypeOf;
template <>
struct TypeOf<Float64> {
  static constexpr TopicType kType{&std_msgs_msg_dds__Float64__desc, kFloat64Hash};
};
template <>
struct TypeOf<PoseStamped> {
  static constexpr TopicType kType{&geometry_msgs_msg_dds__PoseStamped__desc, kPoseStampedHash};
};
template <>
struct TypeOf<TwistStamped> {
  static constexpr TopicType kType{&geometry_msgs_msg_dds__TwistStamped__desc, kTwistStampedHash};
};
template <>
struct TypeOf<WrenchStamped> {
  static constexpr TopicType kType{&geometry_msgs_msg_dds__WrenchStamped__desc, kWrenchStampedHash};
};
template <>
struct TypeOf<TFMessage> {
  static constexpr TopicType kType{&tf2_msgs_msg_dds__TFMessage__desc, kTFMessageHash};
};
template <>
struct TypeOf<JointState> {
  static constexpr TopicType kType{&sensor_msgs_msg_dds__JointState__desc, kJointStateHash};
};
template <>
struct TypeOf<Joy> {
  static constexpr TopicType kType{&sensor_msgs_msg_dds__Joy__desc, kJoyHash};
};
template <>
struct TypeOf<Marker> {
  static constexpr TopicType kType{&visualization_msgs_msg_dds__Marker__desc, kMarkerHash};
};
template <>
struct TypeOf<OperatingState> {
  static constexpr TopicType kType{&crtk_msgs_msg_dds__OperatingState__desc, kOperatingStateHash};
};

/// For a field that is only read. @param text  must outlive the message
[[nodiscard]] inline char* borrowed(const char* text) { return const_cast<char*>(text); }
[[nodiscard]] inline char* borrowed(const std::string& text) { return borrowed(text.c_str()); }

/// @param wall_ns  since 1970, UTC   @param frame_id  must outlive the message
[[nodiscard]] inline Header header_of(std::int64_t wall_ns, const char* frame_id) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  return {.stamp = {.sec = static_cast<std::int32_t>(wall_ns / kSecond),
                    .nanosec = static_cast<std::uint32_t>(wall_ns % kSecond)},
          .frame_id = borrowed(frame_id)};
}
[[nodiscard]] inline Header header_of(std::int64_t wall_ns, const std::string& frame_id) {
  return header_of(wall_ns, frame_id.c_str());
}
[[nodiscard]] inline std::int64_t wall_ns_of(const Header& header) {
  return header.stamp.sec * std::int64_t{1'000'000'000} + header.stamp.nanosec;
}

/// A point or a vector of geometry_msgs.
template <class T>
[[nodiscard]] T xyz(const Vector3& v) {
  return {.x = v.x(), .y = v.y(), .z = v.z()};
}
[[nodiscard]] inline geometry_msgs_msg_dds__Quaternion_ quaternion_of(const Quaternion& q) {
  return {.x = q.x(), .y = q.y(), .z = q.z(), .w = q.w()};
}
[[nodiscard]] inline geometry_msgs_msg_dds__Pose_ pose_of(const Vector3& position_m,
                                                          const Quaternion& orientation) {
  return {.position = xyz<geometry_msgs_msg_dds__Point_>(position_m),
          .orientation = quaternion_of(orientation)};
}

/// As a sequence that is only read. @param elements  must outlive it
template <class Sequence, class Element>
[[nodiscard]] Sequence sequence_of(Element* elements, std::size_t count) {
  const auto length = static_cast<std::uint32_t>(count);
  return {._maximum = length, ._length = length, ._buffer = elements, ._release = false};
}

}  // namespace palpate::ros
