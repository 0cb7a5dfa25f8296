// SPDX-License-Identifier: Apache-2.0
#include "deploy/ros/viewer/side_topics.h"

#include <array>
#include <chrono>
#include <cmath>

#include "common/core/clock.h"

namespace palpate::ros {
namespace {

constexpr Duration kVelocityWindow = std::chrono::milliseconds(10);
constexpr Duration kStateInterval = std::chrono::seconds(1);
constexpr Duration kShareInterval = std::chrono::milliseconds(100);

std::string with(const std::string& side, const char* frame) {
  return side.empty() ? frame : side + "_" + frame;
}

WrenchStamped wrench_of(std::int64_t at_ns, const std::string& frame, const Vector3& newton) {
  return {.header = header_of(at_ns, frame),
          .wrench = {.force = xyz<geometry_msgs_msg_dds__Vector3_>(newton), .torque = {}}};
}

/// As CRTK names what a device does; `is_homed`: its positions are true.
struct State {
  const char* name = "DISABLED";
  bool is_homed = false;
  bool is_busy = false;
};
State state_of(DevicePhase phase) {
  switch (phase) {
    case DevicePhase::kEnabled:
      return {.name = "ENABLED", .is_homed = true};
    case DevicePhase::kCalibrated:
      return {.is_homed = true};
    case DevicePhase::kChecking:
      return {.is_homed = true, .is_busy = true};
    case DevicePhase::kFaulted:
      return {.name = "FAULT"};
    case DevicePhase::kUnknown:
    case DevicePhase::kClosed:
    case DevicePhase::kConnected:
      break;
  }
  return {};
}

}  // namespace

SideTopics::SideTopics(Node& node, const RosTopicOptions& options, const std::string& side)
    : SideTopics(node, options, side,
                 options.name_space + (side.empty() ? "/" : "/" + side + "/")) {}

SideTopics::SideTopics(Node& node, const RosTopicOptions& options, const std::string& side,
                       const std::string& prefix)
    : has_every_tick_(options.has_every_tick),
      prefix_(prefix),
      frames_{.tool = with(side, "tool"), .device = with(side, "device_base")},
      joints_{with(side, "x"), with(side, "y"), with(side, "z")},
      pose_out_(node.writer<PoseStamped>(prefix + "measured_cp", options.offer)),
      velocity_out_(node.writer<TwistStamped>(prefix + "measured_cv", options.offer)),
      applied_out_(node.writer<WrenchStamped>(prefix + "measured_cf", options.offer)),
      commanded_out_(node.writer<WrenchStamped>(prefix + "servo_cf", options.offer)),
      joints_out_(node.writer<JointState>(prefix + "measured_js", options.offer)),
      state_out_(node.writer<OperatingState>(prefix + "operating_state", Offer::kLatched)),
      ledger_energy_out_(node.writer<Float64>(prefix + "ledger_energy_joule", options.offer)),
      true_energy_out_(node.writer<Float64>(prefix + "true_energy_joule", options.offer)),
      clamped_out_(node.writer<Float64>(prefix + "clamped_ratio", options.offer)) {}

std::int64_t SideTopics::wall_ns(std::uint64_t device_session_id, TimePoint sampled_at,
                                 TimePoint newest) {
  if (device_session_id != device_session_id_) {
    device_session_id_ = device_session_id;
    offset_ns_ = static_cast<std::int64_t>(wall_clock_ns()) - newest.time_since_epoch().count();
    places_.clear();
  }
  return sampled_at.time_since_epoch().count() + offset_ns_;
}

void SideTopics::take(const DeviceBatch& batch) {
  if (batch.records.empty()) return;
  const DeviceTick& newest = batch.records.back();
  for (const DeviceTick& tick : batch.records) {
    const std::int64_t at_ns = wall_ns(batch.header.session_id, tick.sampled_at, newest.sampled_at);
    places_.push_back({tick.sampled_at, tick.measured_tool_position_world_m});
    while (places_.size() > 2 && places_[1].at <= tick.sampled_at - kVelocityWindow) {
      places_.pop_front();
    }
    if (has_every_tick_ || &tick == &newest) write(tick, at_ns);
  }
  pose_ = Pose{.at_ns = wall_ns(batch.header.session_id, newest.sampled_at, newest.sampled_at),
               .position_m = newest.measured_tool_position_world_m,
               .orientation = newest.measured_tool_orientation_world};
  if (std::isfinite(newest.true_energy_joule)) {
    count(true_energy_out_.write({.data = newest.true_energy_joule}));
  }
}

Vector3 SideTopics::velocity_m_per_s(const DeviceTick& tick) {
  const Duration elapsed = tick.sampled_at - places_.front().at;
  if (elapsed <= Duration::zero()) return Vector3::Zero();
  return (tick.measured_tool_position_world_m - places_.front().position_m) / to_seconds(elapsed);
}

void SideTopics::write(const DeviceTick& tick, std::int64_t at_ns) {
  const Header in_world = header_of(at_ns, kWorldFrame);
  count(pose_out_.write({.header = in_world,
                         .pose = pose_of(tick.measured_tool_position_world_m,
                                         tick.measured_tool_orientation_world)}));
  count(velocity_out_.write(
      {.header = in_world,
       .twist = {.linear = xyz<geometry_msgs_msg_dds__Vector3_>(velocity_m_per_s(tick)),
                 .angular = {}}}));
  count(applied_out_.write(wrench_of(at_ns, frames_.device, tick.force_on_hand_newton)));
  std::array<char*, 3> names{borrowed(joints_[0]), borrowed(joints_[1]), borrowed(joints_[2])};
  Vector3 position_m = tick.measured_hand_position_m;
  Vector3 effort_newton = tick.force_on_hand_newton;
  count(joints_out_.write(
      {.header = header_of(at_ns, frames_.device),
       .name = sequence_of<dds_sequence_string>(names.data(), names.size()),
       .position = sequence_of<dds_sequence_double>(position_m.data(), 3),
       .velocity = sequence_of<dds_sequence_double>(static_cast<double*>(nullptr), 0),
       .effort = sequence_of<dds_sequence_double>(effort_newton.data(), 3)}));
}

void SideTopics::take(const MofcBatch& batch) {
  if (batch.records.empty()) return;
  const MofcTick& newest = batch.records.back();
  for (const MofcTick& tick : batch.records) {
    if (!has_every_tick_ && &tick != &newest) continue;
    if (tick.device_session_id != device_session_id_) continue;  // its clock is not known yet
    const std::int64_t at_ns = tick.device_sampled_at.time_since_epoch().count() + offset_ns_;
    count(commanded_out_.write(
        wrench_of(at_ns, frames_.device, tick.commanded_force_on_hand_newton)));
  }
  if (std::isfinite(newest.ledger_energy_joule)) {
    count(ledger_energy_out_.write({.data = newest.ledger_energy_joule}));
  }
}

void SideTopics::pump(const viewer::TelemetryMirror& mirror, TimePoint now) {
  if (now >= next_share_) {
    next_share_ = now + kShareInterval;
    const double clamped_ratio = mirror.figures().clamped_ratio;
    if (std::isfinite(clamped_ratio)) count(clamped_out_.write({.data = clamped_ratio}));
  }
  write_state(mirror, now);
}

void SideTopics::write_state(const viewer::TelemetryMirror& mirror, TimePoint now) {
  const State state =
      mirror.device_link().is_alive(now) ? state_of(mirror.device_counters().phase) : State{};
  const bool is_changed =
      state.name != state_ || state.is_homed != was_homed_ || state.is_busy != was_busy_;
  if (!is_changed && now < next_state_) return;
  next_state_ = now + kStateInterval;
  state_ = state.name;
  was_homed_ = state.is_homed;
  was_busy_ = state.is_busy;
  count(state_out_.write(
      {.header = header_of(static_cast<std::int64_t>(wall_clock_ns()), frames_.device),
       .state = borrowed(state_),
       .is_homed = state.is_homed,
       .is_busy = state.is_busy}));
}

}  // namespace palpate::ros
