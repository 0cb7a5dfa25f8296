// SPDX-License-Identifier: Apache-2.0
#include "deploy/ros/physics/ros_engine.h"

#include <algorithm>
#include <memory>

namespace palpate::ros {

namespace {

/// Poses for a source that is behind.
constexpr Duration kBehindInterval = std::chrono::milliseconds(20);

}  // namespace

sdk::Answer RosEngine::ToldForce::step(const sdk::Motion& motion) {
  static_cast<void>(motion);
  return {.force_on_tool_newton = force_newton_};
}

RosEngine::RosEngine(Node& node, const Clock& clock, const std::string& pose_topic,
                     const std::string& force_topic, Offer offer, const WrenchSettings& settings,
                     bool has_estimate)
    : clock_(clock),
      force_topic_(force_topic),
      world_frame_(settings.world_frame),
      poses_(node.writer<PoseStamped>(pose_topic, offer)),
      wrenches_(node.reader<WrenchStamped>(force_topic)),
      gate_(settings),
      estimate_(std::make_unique<ToldForce>(force_newton_), has_estimate) {}

bool RosEngine::step(const ToolMotion& motion, bool is_new, TimePoint now,
                     Interaction& answer) noexcept {
  static_cast<void>(is_new);  // a hand at rest is told too, so that the source goes on answering
  if (error_) return false;
  try {
    const std::int64_t now_ns =
        std::max(static_cast<std::int64_t>(wall_clock_ns()), last_stamp_ns_ + 1);
    last_stamp_ns_ = now_ns;
    const bool has_force = take(now, now_ns);
    send(motion, now_ns);
    if (!has_force) return false;
  } catch (...) {
    error_ = std::current_exception();
    return false;
  }
  // the answer is to the motion of which the force is
  const SentPose& pose = taken_.answers;
  force_newton_ = taken_.force_on_tool_newton;
  answered_.tool_position_world_m = pose.position_m;
  answered_.tool_orientation_world = pose.orientation;
  answered_.tool_velocity_world_m_per_s = pose.velocity_m_per_s;
  if (!estimate_.step(answered_, true, now, answer)) return false;
  answer.device_session_id = pose.device_session_id;
  answer.device_sequence = pose.device_sequence;
  answer.device_sampled_at = pose.device_sampled_at;
  answer.tool_position_world_m = pose.position_m;
  answer.tool_orientation_world = pose.orientation;
  return true;
}

void RosEngine::rethrow() {
  if (error_) std::rethrow_exception(error_);
  estimate_.rethrow();
}

void RosEngine::send(const ToolMotion& motion, std::int64_t now_ns) {
  if (gate_.is_behind(now_ns) && now_ns - last_pose_ns_ < kBehindInterval.count()) {
    const std::scoped_lock lock(mutex_);
    ++counts_.poses_left_out;
    return;
  }
  last_pose_ns_ = now_ns;
  gate_.sent(motion, now_ns);
  const bool is_sent =
      poses_.write({.header = header_of(now_ns, world_frame_),
                    .pose = pose_of(motion.tool_position_world_m, motion.tool_orientation_world)});
  const bool is_heard = poses_.has_reader();
  const std::scoped_lock lock(mutex_);
  if (is_heard) ++counts_.poses;
  if (!is_sent) ++counts_.poses_left_out;
}

/// The newest force of those that have come and count.
bool RosEngine::take(TimePoint now, std::int64_t now_ns) {
  bool has_force = false;
  const std::scoped_lock lock(mutex_);
  wrenches_.take([&](const WrenchStamped& message, const Arrival& arrival) {
    const auto& force = message.wrench.force;
    const Wrench wrench{.source = arrival.source,
                        .stamp_ns = wall_ns_of(message.header),
                        .frame = message.header.frame_id,
                        .force_newton = {force.x, force.y, force.z},
                        .is_known_type = wrenches_.is_known_type(arrival.source)};
    const std::uint64_t source = gate_.source();
    const WrenchRefusal refusal = gate_.judge(wrench, now, now_ns, taken_);
    if (refusal != WrenchRefusal::kNone) {
      ++counts_.refused[static_cast<std::size_t>(refusal)];
      return;
    }
    has_force = true;
    ++counts_.taken;
    if (arrival.source != source) ++counts_.sources;
    if (taken_.age) counts_.round_trip.add(*taken_.age);
    counts_.transit.add(Duration(std::max<std::int64_t>(now_ns - arrival.sent_ns, 0)));
  });
  return has_force;
}

WrenchCounts RosEngine::counts() const {
  const std::scoped_lock lock(mutex_);
  return counts_;
}

void RosEngine::report(TimePoint now, spdlog::logger& log) {
  WrenchCounts counts;
  std::optional<TimePoint> taken_at;
  {
    const std::scoped_lock lock(mutex_);
    counts = counts_;
    taken_at = gate_.taken_at();
  }
  for (std::size_t i = 0; i < kWrenchRefusals; ++i) {
    const std::uint64_t due = throttles_[i].note(now, counts.refused[i] - reported_.refused[i]);
    if (due == 0) continue;
    log.warn("event=wrench_refused topic={} count={} reason=\"{}\"", force_topic_, due,
             explain(static_cast<WrenchRefusal>(i)));
  }
  const bool is_another = counts.sources != reported_.sources;
  reported_ = counts;
  const bool is_heard = taken_at && clock_.now() - *taken_at < kSourceSilence;
  if (is_heard == was_heard_ && !is_another) return;
  was_heard_ = is_heard;
  if (is_heard) {
    log.info("event=force_source topic={}", force_topic_);
  } else {
    log.warn("event=force_source_silent topic={}", force_topic_);
  }
}

}  // namespace palpate::ros
