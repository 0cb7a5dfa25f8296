// SPDX-License-Identifier: Apache-2.0
// resting_press.h — a hand at rest in tissue as stiff as its own spring.
#pragma once

#include <cmath>

#include "tests/support/watcher.h"

namespace palpate::test {

/// The spring pulls the hand 5 mm into the tissue; no controller limits the force. The long period
/// and lease outlast the pauses of a busy machine without real-time scheduling, so that the hand
/// comes to rest there too. The test adds the rest of the session.
inline constexpr const char* kRestingPress = R"(
device {
  monitor: off
  rate_hz: 200
  lease_us: 12500
  simulated { position_resolution_m: 0 }
  profile { position_resolution_m: 0 }
}
hand {
  stiffness_newton_per_m: 400
  damping_newton_s_per_m: 10
  hold { position_m { z: -0.005 } }
}
mofc { controller: none stale_after_ms: 200 }
scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 400 } } }
)";
/// Hand and tissue are deflected by half each: 2.5 mm · 400 N/m. Stiction of 0.1 N may hold the
/// hand before or beyond that; the tissue takes half of it.
inline constexpr double kRestingNewton = 1.0;
inline constexpr double kStictionNewton = 0.05;

/// Whether the hand rested in the tissue in this tick.
inline bool rests_in_tissue(const TickRow& row) {
  return row.mofc && row.mofc->state == MofcState::kContact &&
         std::abs(row.device.force_on_hand_newton.z() - kRestingNewton) < kStictionNewton;
}
/// The same of the newest tick.
inline bool rests_in_tissue(const Watcher& watcher) {
  return !watcher.rows().empty() && rests_in_tissue(watcher.rows().back());
}

}  // namespace palpate::test
