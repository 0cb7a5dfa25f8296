// SPDX-License-Identifier: Apache-2.0
#include "deploy/ros/dds/json_messages.h"

#include <limits>
#include <nlohmann/json.hpp>

namespace palpate::ros {
namespace {

using Json = nlohmann::json;

Json object_of(const Header& header) {
  return {{"stamp", {{"sec", header.stamp.sec}, {"nanosec", header.stamp.nanosec}}},
          {"frame_id", header.frame_id}};
}
/// A point or a vector.
template <class T>
Json xyz_of(const T& v) {
  return {{"x", v.x}, {"y", v.y}, {"z", v.z}};
}
Json object_of(const geometry_msgs_msg_dds__Quaternion_& q) {
  return {{"x", q.x}, {"y", q.y}, {"z", q.z}, {"w", q.w}};
}
Json object_of(const geometry_msgs_msg_dds__Pose_& pose) {
  return {{"position", xyz_of(pose.position)}, {"orientation", object_of(pose.orientation)}};
}
Json object_of(const std_msgs_msg_dds__ColorRGBA_& color) {
  return {{"r", color.r}, {"g", color.g}, {"b", color.b}, {"a", color.a}};
}
template <class Sequence, class Of>
Json array_of(const Sequence& sequence, const Of& of) {
  Json array = Json::array();
  for (std::uint32_t i = 0; i < sequence._length; ++i) array.push_back(of(sequence._buffer[i]));
  return array;
}
template <class Sequence>
Json array_of(const Sequence& sequence) {
  return array_of(sequence, [](const auto& value) { return Json(value); });
}
std::string text_of(const Json& json) {
  // names of people's sides and tissues may be in any encoding
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

const Json& member(const Json& json, const char* key) {
  static const Json nothing;
  const auto found = json.find(key);
  return found == json.end() ? nothing : *found;
}
double number(const Json& json, const char* key) {
  const Json& value = member(json, key);
  return value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
}
/// Of a stamp: 0 for what is none.
template <class Integer>
Integer integer(const Json& json, const char* key) {
  const double value = number(json, key);
  const bool is_one = value >= static_cast<double>(std::numeric_limits<Integer>::min()) &&
                      value <= static_cast<double>(std::numeric_limits<Integer>::max());
  return is_one ? static_cast<Integer>(value) : Integer{0};
}

}  // namespace

std::string json_of(const Float64& message) { return text_of({{"data", message.data}}); }

std::string json_of(const PoseStamped& message) {
  return text_of({{"header", object_of(message.header)}, {"pose", object_of(message.pose)}});
}

std::string json_of(const TwistStamped& message) {
  return text_of(
      {{"header", object_of(message.header)},
       {"twist",
        {{"linear", xyz_of(message.twist.linear)}, {"angular", xyz_of(message.twist.angular)}}}});
}

std::string json_of(const WrenchStamped& message) {
  return text_of(
      {{"header", object_of(message.header)},
       {"wrench",
        {{"force", xyz_of(message.wrench.force)}, {"torque", xyz_of(message.wrench.torque)}}}});
}

std::string json_of(const TFMessage& message) {
  return text_of({{"transforms", array_of(message.transforms, [](const TransformStamped& one) {
                     return Json{{"header", object_of(one.header)},
                                 {"child_frame_id", one.child_frame_id},
                                 {"transform",
                                  {{"translation", xyz_of(one.transform.translation)},
                                   {"rotation", object_of(one.transform.rotation)}}}};
                   })}});
}

std::string json_of(const JointState& message) {
  return text_of({{"header", object_of(message.header)},
                  {"name", array_of(message.name)},
                  {"position", array_of(message.position)},
                  {"velocity", array_of(message.velocity)},
                  {"effort", array_of(message.effort)}});
}

/// The fields that are used here; a server fills in the others.
std::string json_of(const Marker& message) {
  return text_of({{"header", object_of(message.header)},
                  {"ns", message.ns},
                  {"id", message.id},
                  {"type", message.type},
                  {"action", message.action},
                  {"pose", object_of(message.pose)},
                  {"scale", xyz_of(message.scale)},
                  {"color", object_of(message.color)},
                  {"points", array_of(message.points, [](const Point& p) { return xyz_of(p); })}});
}

std::string json_of(const OperatingState& message) {
  return text_of({{"header", object_of(message.header)},
                  {"state", message.state},
                  {"is_homed", static_cast<bool>(message.is_homed)},
                  {"is_busy", static_cast<bool>(message.is_busy)}});
}

void read_json(const Json& fields, ReadWrench& wrench) {
  const Json& header = member(fields, "header");
  const Json& stamp = member(header, "stamp");
  const Json& frame = member(header, "frame_id");
  const Json& force = member(member(fields, "wrench"), "force");
  wrench.frame_id = frame.is_string() ? frame.get<std::string>() : "";
  wrench.message = {
      .header = {.stamp = {.sec = integer<std::int32_t>(stamp, "sec"),
                           .nanosec = integer<std::uint32_t>(stamp, "nanosec")},
                 .frame_id = borrowed(wrench.frame_id)},
      .wrench = {.force = {number(force, "x"), number(force, "y"), number(force, "z")},
                 .torque = {}}};
}

}  // namespace palpate::ros
