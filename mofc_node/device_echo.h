// SPDX-License-Identifier: Apache-2.0
// device_echo.h — the device's report of the forces that acted, as mofc_node follows it from one
// DeviceState to the next.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "common/core/messages.h"
#include "common/telemetry/metrics.h"
#include "mofc_node/controllers/force_controller.h"

namespace palpate::mofc {

/// Skips what earlier states have reported, checks that the rest continues it, converts it for the
/// controller, and compares what acted with what was requested: a request stands from the instant
/// at which the force changes after the reading that it answers. No allocation, no throw.
class DeviceEcho {
 public:
  /// What one DeviceState reports.
  struct Report {
    /// Valid until the next take(). Two readings with equal stamps have none between them.
    std::span<const controllers::AppliedStretch> applied;
    /// The same stretches in the state itself; valid as long as that is.
    std::span<const AppliedForce> reported;
    Vector3 mean_force_newton = Vector3::Zero();  ///< time average over `applied`; 0 without it
    bool has_gap = false;  ///< it is not known what acted since the state that came before
    /// Device time since the newest reading whose answer has arrived; 0 in the first state. More
    /// than a period: a tick was skipped, or had no answer.
    Duration since_answered{};
    Duration since_previous{};  ///< device time since the previous state; 0 in the first one
  };

  /// A new device session: its first echo continues nothing.
  void reset() noexcept;
  /// Once per DeviceState, in order; any may be missing.
  [[nodiscard]] Report take(const DeviceState& state) noexcept;
  /// The answer to the last state: what the tissue requested.
  void answered(const Vector3& requested_newton) noexcept {
    requested_before_newton_ = requested_newton_;
    requested_newton_ = requested_newton;
  }

  /// Rendered against requested force, of all device sessions.
  [[nodiscard]] const ForceComparison& rendered() const noexcept { return rendered_; }

 private:
  std::array<controllers::AppliedStretch, kMaxAppliedForces> segments_;
  std::optional<TimePoint> previous_;  // reading of the previous state of this session
  /// Reading up to which it is known what acted; TimePoint::min(): nothing may continue it.
  TimePoint known_until_ = TimePoint::min();
  std::optional<Vector3> requested_newton_;         // for the previous reading
  std::optional<Vector3> requested_before_newton_;  // for the one before that
  Vector3 acting_newton_ = Vector3::Zero();         // at the previous reading
  ForceComparison rendered_;
};

}  // namespace palpate::mofc
