// motion_relay.h — hop 2: the tool's motion, from the device to the physics.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "common/core/clock.h"
#include "common/core/messages.h"
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
  void reset() noexcept { velocity_->reset(); }
  /// Makes the motion of this state; send() sends it.
  /// @param mean_force_newton  time average of the force on the hand since the previous state
  void update(const DeviceState& state, const Vector3& mean_force_newton) noexcept;
  /// What the next motions acknowledge of hop 3.
  void acknowledge(const SurfaceReceipts& receipts) noexcept { motion_.receipts = receipts; }
  /// Sends the motion of the last update() unless that was done or the deadband suppresses it.
  void send() noexcept;

  /// Where the tool is, as far as the encoder tells: estimated at the last update(), W.
  [[nodiscard]] Vector3 tool_position_world_m() const noexcept {
    return velocity_->position_m(motion_.tool_position_world_m);
  }
  /// Estimated at the last update(), W.
  [[nodiscard]] const Vector3& tool_velocity_world_m_per_s() const noexcept {
    return motion_.tool_velocity_world_m_per_s;
  }
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }
  [[nodiscard]] std::uint64_t suppressed() const noexcept { return suppressed_; }

 private:
  const Clock& clock_;
  Sender<ToolMotion>& out_;
  std::optional<MotionDeadband> deadband_;
  std::unique_ptr<VelocityEstimator> velocity_;
  ToolMotion motion_;
  bool is_pending_ = false;         // motion_ waits for send()
  std::optional<ToolMotion> sent_;  // the last one that the link took
  std::uint64_t next_sequence_ = 0;
  std::uint64_t dropped_ = 0;
  std::uint64_t suppressed_ = 0;
};

}  // namespace palpate::mofc
