// SPDX-License-Identifier: Apache-2.0
// pressing_hand.h — a hand that presses repeatedly, and predicates on its ticks.
#pragma once

#include <algorithm>
#include <chrono>
#include <vector>

#include "tests/support/watcher.h"

namespace palpate::test {

/// A recorded path, to be looped: the hand comes from above, presses for 1.2 s and retreats. Its
/// spring, 400 N/m, pulls it 7.5 mm into tissue of 200 N/m, which gives 5 mm and 1 N. It presses
/// repeatedly because a busy machine may interrupt the force: the hand then sinks in without
/// supplying energy, and the clamp rightly returns less force during that press.
inline constexpr const char* kPressingPath =
    "t,x,y,z\n0,0,0,0.004\n0.3,0,0,0.004\n0.6,0,0,-0.0075\n1.8,0,0,-0.0075\n2.1,0,0,0.004\n";
inline constexpr const char* kPressingHand =
    "hand { stiffness_newton_per_m: 400 recorded { file: \"hand.csv\" loop: true } }\n"
    "scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 200 } } }\n";
inline constexpr double kPressedTissueNewtonPerM = 200.0;
inline constexpr double kPressNewton = 1.0;
inline constexpr double kPressedTargetM = -0.0075;
/// Least force of the press when a node fails, for a test to be meaningful: more than three times
/// what the friction of the device absorbs.
inline constexpr double kLeftNewton = 0.35;
/// Energy from rounding in the inner steps of the simulated device.
inline constexpr double kRoundingJoule = 1e-6;

/// Within this time the clamp knows that the connection to a dead physics_node is lost.
inline constexpr Duration kLossNoticed = std::chrono::milliseconds(6);

/// |F| on the hand in a row.
inline double newton(const TickRow& row) { return row.device.force_on_hand_newton.norm(); }

/// The clamp had a current answer of physics when it answered this tick.
inline bool hears_physics(const TickRow& row) {
  return row.mofc &&
         (row.mofc->state == MofcState::kContact || row.mofc->state == MofcState::kFree);
}
/// This tick was answered with a current answer of physics.
inline bool is_fresh(const TickRow& row) { return row.device.is_answered && hears_physics(row); }

/// 80 % of the final force is reached, and about 1 s of the press is left: the hand was 1 mm above
/// the tissue within the last 0.6 s.
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
