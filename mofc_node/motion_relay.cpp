// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/motion_relay.h"

#include "mofc_node/motion_deadband.h"

namespace palpate::mofc {
namespace {

constexpr double kMostAngularVelocity_rad_per_s = 1e3;  // that hop 2 carries

}  // namespace

MotionRelay::MotionRelay(const MofcConfig& mofc, const ClampedDevice& device, const Clock& clock,
                         Sender<ToolMotion>& out, std::uint64_t session_id)
    : clock_(clock),
      out_(out),
      deadband_(mofc.motion_deadband),
      velocity_(make_velocity_estimator(
          mofc.velocity_estimator,
          device.profile.position_resolution_m * device.workspace.scale_ratio,
          device.workspace.scale_ratio, device.profile.coulomb_newton)) {
  motion_.header.session_id = session_id;
  if (device.wrist) {
    wrist_velocity_.emplace(AdaptiveWindowVelocity{}, device.wrist->angle_resolution_rad);
  }
}

void MotionRelay::update(const DeviceState& state, const Vector3& mean_force_newton) noexcept {
  motion_.header.sampled_at = clock_.now();
  motion_.device_session_id = state.header.session_id;
  motion_.device_sequence = state.header.sequence;
  motion_.device_sampled_at = state.header.sampled_at;
  motion_.tool_position_world_m = state.tool_position_world_m;
  motion_.tool_orientation_world = state.tool_orientation_world;
  motion_.tool_velocity_world_m_per_s =
      velocity_->update(state.tool_position_world_m, state.header.sampled_at, mean_force_newton);
  motion_.buttons = state.buttons;
  motion_.wants_torque = state.wrist.has_value();
  if (state.wrist && wrist_velocity_) {
    const Vector3 rad_per_s = wrist_velocity_->update(state.wrist->pose.angle_rad,
                                                      state.header.sampled_at, Vector3::Zero());
    motion_.tool_angular_velocity_world_rad_per_s =
        limited_to_norm(state.wrist->pose.axes * rad_per_s, kMostAngularVelocity_rad_per_s);
  }
  is_pending_ = true;
}

void MotionRelay::send() noexcept {
  if (!is_pending_) return;
  is_pending_ = false;
  motion_.grip = hints_[index_of(in_use_)].grip;
  if (deadband_ && sent_ && sent_->physics_term == motion_.physics_term &&
      !is_worth_sending(*sent_, motion_, *deadband_)) {
    ++suppressed_;
    return;
  }
  motion_.header.sequence = next_sequence_++;
  const SendResult first = send_to(PhysicsRole::kFirst);
  const SendResult standby =
      standby_out_ != nullptr ? send_to(PhysicsRole::kStandby) : SendResult::kNoPeer;
  const SendResult result = in_use_ == PhysicsRole::kFirst ? first : standby;
  if (result == SendResult::kDropped) ++dropped_;
  if (result == SendResult::kSent) sent_ = motion_;
}

SendResult MotionRelay::send_to(PhysicsRole receiver) noexcept {
  const PhysicsHints& hints = hints_[index_of(receiver)];
  motion_.receipts = hints.receipts;
  motion_.elastic_receipts = hints.elastic_receipts;
  motion_.scene_time = hints.scene_time;
  motion_.grip = hints.grip;
  return (receiver == PhysicsRole::kFirst ? out_ : *standby_out_).send(motion_);
}

}  // namespace palpate::mofc
