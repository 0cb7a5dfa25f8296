// SPDX-License-Identifier: Apache-2.0
// tick_row.h — one device tick as recorded by the nodes and the ideal run.
#pragma once

#include <cstdint>
#include <optional>

#include "common/core/vector.h"
#include "common/telemetry/metrics.h"
#include "common/telemetry/telemetry.h"

namespace palpate {

/// Everything known about one device tick.
struct TickRow {
  std::uint64_t device_session_id = 0;
  DeviceTick device;
  std::optional<MofcTick> mofc{};  ///< the answer to it; none: never sent, or lost
  /// Force of the continuous tissue at the true position and velocity (lockstep only), D; else NaN.
  Vector3 ideal_force_on_hand_newton = Vector3::Constant(kNaN);
  /// Of what acted since the previous row with that force, at the inner steps of the device
  /// (lockstep only). Otherwise what acted is compared with the ideal force of both rows, linear
  /// between them.
  std::optional<ForceComparison> to_ideal{};
  /// The same of the torque per joint of the wrist, in newtons at kTorqueArm_m; NaN and none
  /// without.
  Vector3 ideal_wrist_torque_newton_m = Vector3::Constant(kNaN);
  std::optional<ForceComparison> wrist_to_ideal{};
  /// From the true geometry, where known; otherwise the contact flag of `mofc` applies.
  std::optional<bool> is_truly_in_contact{};
};

/// The ideal run at t_k of a row.
struct IdealState {
  Vector3 tool_position_world_m = Vector3::Constant(kNaN);
  Vector3 force_on_hand_newton = Vector3::Constant(kNaN);
};

}  // namespace palpate
