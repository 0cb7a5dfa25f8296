// SPDX-License-Identifier: Apache-2.0
// motion_relay.h — hop 2: the tool's motion, from the device to the physics.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "common/core/clock.h"
#include "common/core/messages.h"
#include "common/core/physics_term.h"
#include "common/core/ports.h"
#include "common/session/clamped_device.h"
#include "common/session/mofc_config.h"
#include "mofc_node/velocity_estimator.h"

namespace palpate::mofc {

/// Makes a ToolMotion of every DeviceState and sends it; with a deadband, only when the tool has
/// moved on. A motion that the link did not take does not count as sent. No allocation, no throw.
class MotionRelay {
 public:
  /// @param session_id  mofc's
  MotionRelay(const MofcConfig& mofc, const ClampedDevice& device, const Clock& clock,
              Sender<ToolMotion>& out, std::uint64_t session_id);

  /// A new device session: the velocity estimate starts again from zero.
  void reset() noexcept {
    velocity_->reset();
    if (wrist_velocity_) wrist_velocity_->reset();
  }
  /// Makes the motion of this state; send() sends it.
  /// @param mean_force_newton  time average of the force on the hand since the previous state
  void update(const DeviceState& state, const Vector3& mean_force_newton) noexcept;
  /// Every motion goes to this physics too; it must outlive the relay.
  void relay_to_standby(Sender<ToolMotion>& out) noexcept { standby_out_ = &out; }
  /// What the next motions to one physics carry beside the motion.
  struct PhysicsHints {
    SurfaceReceipts receipts{};
    std::optional<ElasticReceipts> elastic_receipts{};
    std::optional<TimePoint> scene_time{};
    std::optional<GripReport> grip{};
  };
  void set_hints(PhysicsRole receiver, const PhysicsHints& hints) noexcept {
    hints_[index_of(receiver)] = hints;
  }
  /// Which physics the next motions name as active; the deadband never suppresses a new term.
  void use(PhysicsRole role, std::uint64_t term) noexcept {
    in_use_ = role;
    motion_.physics_term = term;
  }
  /// Wave variables: what the next motions carry, W.
  void carry(const Wave& wave) noexcept { motion_.wave = wave; }
  /// Sends the motion of the last update() unless that was done or the deadband suppresses it.
  void send() noexcept;

  /// Where the tool is, as far as the encoder tells: estimated at the last update(), W.
  [[nodiscard]] Vector3 tool_position_world_m() const noexcept {
    return velocity_->position_m(motion_.tool_position_world_m);
  }
  /// Estimated at the last update().
  [[nodiscard]] ToolVelocity tool_velocity_world() const noexcept {
    return motion_.tool_velocity_world();
  }
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }
  [[nodiscard]] std::uint64_t suppressed() const noexcept { return suppressed_; }

 private:
  [[nodiscard]] SendResult send_to(PhysicsRole receiver) noexcept;

  const Clock& clock_;
  Sender<ToolMotion>& out_;
  Sender<ToolMotion>* standby_out_ = nullptr;
  std::array<PhysicsHints, kPhysicsRoles> hints_{};
  PhysicsRole in_use_ = PhysicsRole::kFirst;
  std::optional<MotionDeadband> deadband_;
  std::unique_ptr<VelocityEstimator> velocity_;
  std::optional<AdaptiveWindowEstimator> wrist_velocity_;  // rad for m
  ToolMotion motion_;
  bool is_pending_ = false;         // motion_ waits for send()
  std::optional<ToolMotion> sent_;  // the last one that the link to the physics in use took
  std::uint64_t next_sequence_ = 0;
  std::uint64_t dropped_ = 0;
  std::uint64_t suppressed_ = 0;
};

}  // namespace palpate::mofc
