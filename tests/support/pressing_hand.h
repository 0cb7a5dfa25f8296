// pressing_hand.h — a hand that presses again and again, and what holds while it does.
#pragma once

#include <algorithm>
#include <chrono>
#include <vector>

#include "tests/support/watcher.h"

namespace palpate::test {

/// It comes from above, presses for 1.2 s and comes again: its spring, 400 N/m, pulls it 7.5 mm
/// into tissue of 200 N/m, so that 5 mm and 1 N are left. It comes again because a machine that is
/// busy may take the force away for a moment: the hand sinks in without giving energy, and the
/// clamp rightly gives no more back. A recorded path; to be looped.
inline constexpr const char* kPressingPath =
    "t,x,y,z\n0,0,0,0.004\n0.3,0,0,0.004\n0.6,0,0,-0.0075\n1.8,0,0,-0.0075\n2.1,0,0,0.004\n";
inline constexpr const char* kPressingHand =
    "hand { stiffness_newton_per_m: 400 recorded { file: \"hand.csv\" loop: true } }\n"
    "scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 200 } } }\n";
inline constexpr double kPressedTissueNewtonPerM = 200.0;
inline constexpr double kPressNewton = 1.0;
inline constexpr double kPressedTargetM = -0.0075;
/// What a busy machine must have left of the press when a node goes, for a test to mean something:
/// more than three times what the device's own friction would absorb.
inline constexpr double kLeftNewton = 0.35;
/// Energy of rounding in the inner steps of the simulated device.
inline constexpr double kRoundingJoule = 1e-6;

/// |F| on the hand of that row.
inline double newton(const TickRow& row) { return row.device.force_on_hand_newton.norm(); }

/// Physics was heard when this tick was answered.
inline bool hears_physics(const TickRow& row) {
  return row.mofc &&
         (row.mofc->state == MofcState::kContact || row.mofc->state == MofcState::kFree);
}
/// The device's tick was answered out of a physics that is heard.
inline bool is_fresh(const TickRow& row) {
  return row.device.is_answered && hears_physics(row);
}

/// 80 % of the last force reached, and about 1 s left: the hand came in, down from 1 mm above the
/// tissue, within 0.6 s.
inline bool presses(const std::vector<TickRow>& rows) {
  if (rows.empty() || !is_fresh(rows.back()) || rows.back().mofc->state != MofcState::kContact ||
      newton(rows.back()) < 0.8 * kPressNewton) {
    return false;
  }
  const auto above = std::find_if(rows.rbegin(), rows.rend(), [](const TickRow& row) {
    return row.device.true_tool_position_world_m.z() > 1e-3;
  });
  return above != rows.rend() &&
         rows.back().device.sampled_at - above->device.sampled_at < std::chrono::milliseconds(600);
}

}  // namespace palpate::test
