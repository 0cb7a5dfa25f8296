// tick_row.h — one device tick as the nodes and the ideal run saw it.
#pragma once

#include <cstdint>
#include <optional>

#include "common/core/vector.h"
#include "common/telemetry/telemetry.h"

namespace palpate {

/// All that is known of one device tick.
struct TickRow {
  std::uint64_t device_session_id = 0;
  DeviceTick device;
  std::optional<MofcTick> mofc{};  ///< the answer to it; none: never made, or lost on the way here
  /// The continuous tissue at the true position and velocity (lockstep knows it), D; else NaN.
  Vector3 ideal_force_on_hand_newton = Vector3::Constant(kNaN);
  /// True geometry, where known; else the row says what physics last said.
  std::optional<bool> is_truly_in_contact{};
};

/// What the ideal run did at t_k of a row.
struct IdealState {
  Vector3 tool_position_world_m = Vector3::Constant(kNaN);
  Vector3 force_on_hand_newton = Vector3::Constant(kNaN);
};

}  // namespace palpate
