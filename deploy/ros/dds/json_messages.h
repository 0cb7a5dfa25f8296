// SPDX-License-Identifier: Apache-2.0
// json_messages.h — the messages of ROS 2 as rosbridge writes them: an object of JSON by the names
// of the fields, null for a number that is none.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "deploy/ros/dds/messages.h"

namespace palpate::ros {

[[nodiscard]] std::string json_of(const Float64& message);
[[nodiscard]] std::string json_of(const PoseStamped& message);
[[nodiscard]] std::string json_of(const TwistStamped& message);
[[nodiscard]] std::string json_of(const WrenchStamped& message);
[[nodiscard]] std::string json_of(const TFMessage& message);
[[nodiscard]] std::string json_of(const JointState& message);
[[nodiscard]] std::string json_of(const Marker& message);
[[nodiscard]] std::string json_of(const OperatingState& message);

/// A wrench and the text of its frame.
struct ReadWrench {
  std::string frame_id;
  WrenchStamped message{};  ///< its frame_id is the one above
};
/// What is missing is NaN, 0 or "".
/// @param fields  an object
void read_json(const nlohmann::json& fields, ReadWrench& wrench);

}  // namespace palpate::ros
