// SPDX-License-Identifier: Apache-2.0
#include "deploy/ros/physics/wrench_gate.h"

#include <algorithm>
#include <limits>

namespace palpate::ros {

const char* explain(WrenchRefusal refusal) {
  switch (refusal) {
    case WrenchRefusal::kNone:
      return "taken";
    case WrenchRefusal::kUnknownType:
      return "its type is defined otherwise than here: it comes from another version of "
             "geometry_msgs";
    case WrenchRefusal::kOtherSource:
      return "another publisher is heard; end one of the two";
    case WrenchRefusal::kNotFinite:
      return "a component is missing, NaN or infinite";
    case WrenchRefusal::kUnknownFrame:
      return "its frame_id is neither that of the world nor that of the tool; name them with "
             "--world-frame and --tool-frame";
    case WrenchRefusal::kTooLarge:
      return "it is above --max-force; is it in newton?";
    case WrenchRefusal::kNotNewer:
      return "its stamp is missing, or not later than that of the last one: it is repeated or out "
             "of order; a publisher whose clock was set back must be silent for a second";
    case WrenchRefusal::kTooLate:
      return "it answers a pose that is more than 200 ms old";
    case WrenchRefusal::kUnknownPose:
      return "it answers a pose that was not sent";
  }
  return "";
}

void WrenchGate::sent(const ToolMotion& motion, std::int64_t stamp_ns) noexcept {
  if (sent_ == 0) first_sent_ns_ = stamp_ns;
  poses_[sent_++ % kPoses] = {.stamp_ns = stamp_ns,
                              .device_session_id = motion.device_session_id,
                              .device_sequence = motion.device_sequence,
                              .device_sampled_at = motion.device_sampled_at,
                              .position_m = motion.tool_position_world_m,
                              .orientation = motion.tool_orientation_world,
                              .velocity_m_per_s = motion.tool_velocity_world_m_per_s};
}

const SentPose* WrenchGate::newest() const noexcept {
  return sent_ > 0 ? &poses_[(sent_ - 1) % kPoses] : nullptr;
}

const SentPose* WrenchGate::with_stamp(std::int64_t stamp_ns) const noexcept {
  // stamps increase: bisect between the oldest that is kept and the newest
  std::uint64_t low = sent_ - std::min<std::uint64_t>(sent_, kPoses);
  std::uint64_t high = sent_;
  while (low < high) {
    const std::uint64_t middle = low + (high - low) / 2;
    const SentPose& pose = poses_[middle % kPoses];
    if (pose.stamp_ns == stamp_ns) return &pose;
    if (pose.stamp_ns < stamp_ns) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return nullptr;
}

/// So long ago that the pose is forgotten.
bool WrenchGate::was_sent(std::int64_t stamp_ns) const noexcept {
  return sent_ > kPoses && stamp_ns >= first_sent_ns_ && stamp_ns < poses_[sent_ % kPoses].stamp_ns;
}

WrenchRefusal WrenchGate::judge(const Wrench& wrench, TimePoint now, std::int64_t now_ns,
                                TakenForce& taken) noexcept {
  if (!wrench.is_known_type) return WrenchRefusal::kUnknownType;
  if (source_.is_taken(wrench.source, now)) return WrenchRefusal::kOtherSource;
  const bool was_silent = now - heard_at_ >= kSourceSilence;
  heard_at_ = now;
  if (!wrench.force_newton.allFinite()) return WrenchRefusal::kNotFinite;
  const bool is_in_tool = wrench.frame == settings_.tool_frame;
  if (!is_in_tool && wrench.frame != settings_.world_frame) return WrenchRefusal::kUnknownFrame;
  if (wrench.force_newton.norm() > settings_.max_force_newton) return WrenchRefusal::kTooLarge;

  // which pose it answers
  const SentPose* pose = with_stamp(wrench.stamp_ns);
  const bool names_pose = pose != nullptr;
  const bool names_forgotten = !names_pose && was_sent(wrench.stamp_ns);
  if ((names_pose || names_forgotten) && wrench.stamp_ns > newest_named_ns_) {
    shortest_answer_ns_ = std::min(shortest_answer_ns_, now_ns - wrench.stamp_ns);
    newest_named_ns_ = wrench.stamp_ns;
  }
  if (!names_pose) {
    if (source_.is(wrench.source) && names_poses_) {
      return names_forgotten ? WrenchRefusal::kTooLate : WrenchRefusal::kUnknownPose;
    }
    if (source_.is_repeated(wrench.source, wrench.stamp_ns) &&
        !(was_silent && wrench.stamp_ns < source_.last_stamp_ns())) {
      return WrenchRefusal::kNotNewer;
    }
    pose = newest();
    if (pose == nullptr) return WrenchRefusal::kUnknownPose;
  } else if (wrench.stamp_ns <= last_named_ns_) {  // whatever other stamps have come from there
    return WrenchRefusal::kNotNewer;
  } else if (now_ns - wrench.stamp_ns > kOldestAnswer.count()) {
    return WrenchRefusal::kTooLate;
  }

  source_.take(wrench.source, wrench.stamp_ns, now);
  names_poses_ = names_pose;
  if (names_pose) last_named_ns_ = wrench.stamp_ns;
  taken.answers = *pose;
  taken.age.reset();
  if (names_pose) taken.age = Duration(now_ns - wrench.stamp_ns);
  const Vector3 force =
      settings_.is_on_tissue ? Vector3(-wrench.force_newton) : wrench.force_newton;
  taken.force_on_tool_newton = is_in_tool ? Vector3(pose->orientation * force) : force;
  return WrenchRefusal::kNone;
}

}  // namespace palpate::ros
