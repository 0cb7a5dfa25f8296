// SPDX-License-Identifier: Apache-2.0
#include "deploy/ros/device/pose_gate.h"

#include <sstream>
#include <vector>

#include "common/core/check.h"

namespace palpate::ros {

Matrix3 DeviceAxes::rotation_of(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  Matrix3 rows = Matrix3::Zero();
  for (std::size_t i = 0; i < words.size() && words.size() == 3; ++i) {
    const bool is_minus = words[i].starts_with('-');
    const std::string name = words[i].substr(is_minus ? 1 : 0);
    const std::size_t axis = std::string_view("xyz").find(name);
    if (name.size() != 1 || axis == std::string_view::npos) break;
    rows(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(axis)) = is_minus ? -1.0 : 1.0;
  }
  // a missing or repeated axis has the determinant 0, a left-handed frame −1
  if (rows.determinant() > 0.5) return rows;
  throw SetupError("--axes = \"" + text +
                   "\": must be three different axes of a right-handed frame: what x (right), y "
                   "(away from the person) and z (up) are in the frame of the poses, such as "
                   "\"-y x z\"");
}

const char* explain(PoseRefusal refusal) {
  switch (refusal) {
    case PoseRefusal::kNone:
      return "taken";
    case PoseRefusal::kUnknownType:
      return "its type is defined otherwise than here: it comes from another version of "
             "geometry_msgs";
    case PoseRefusal::kOtherSource:
      return "another publisher is heard; end one of the two";
    case PoseRefusal::kNoPose:
      return "a component is NaN or infinite, or the quaternion is no rotation";
    case PoseRefusal::kOtherFrame:
      return "its frame_id is another one than that of the first pose, or of --base-frame";
    case PoseRefusal::kNotNewer:
      return "its stamp is not later than that of the last one: it is repeated or out of order; a "
             "publisher whose clock was set back must be started again";
  }
  return "";
}

PoseRefusal PoseGate::judge(DevicePose& pose, TimePoint now) {
  if (!pose.is_known_type) return PoseRefusal::kUnknownType;
  if (arm_.is_taken(pose.source, now)) return PoseRefusal::kOtherSource;
  const double norm = pose.orientation.norm();
  // negated: a NaN is refused too
  if (!pose.position_m.allFinite() || !(norm > 0.5 && norm < 2.0)) return PoseRefusal::kNoPose;
  const bool is_same_arm = arm_.is(pose.source);
  if ((is_frame_given_ || is_same_arm) && pose.frame != frame_) return PoseRefusal::kOtherFrame;
  if (arm_.is_repeated(pose.source, pose.stamp_ns)) return PoseRefusal::kNotNewer;

  if (!is_same_arm) frame_ = pose.frame;
  arm_.take(pose.source, pose.stamp_ns, now);
  pose.position_m = axes_.device_from_base * (pose.position_m - axes_.center_m);
  pose.orientation = Quaternion(axes_.device_from_base) * pose.orientation.normalized();
  return PoseRefusal::kNone;
}

}  // namespace palpate::ros
