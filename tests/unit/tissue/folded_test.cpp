// SPDX-License-Identifier: Apache-2.0
// What many simulations do not keep between two full solutions is made again the same.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "common/session/session_file.h"
#include "physics_node/library/simulation.h"
#include "tests/support/machine/places.h"

namespace palpate::physics {
namespace {

constexpr double kTick_s = 1e-3;

std::shared_ptr<const SharedScene> block() {
  const Session session = parse_session(
      R"(name: "x" scene {
        tool { tip_radius_m: 0.006 }
        tissue { name: "block" tetrahedral_mesh { file: "small_block.msh" }
          elastic { young_pa: 10e3 viscosity_ms: 5 viscoelastic { branch { share: 0.3 tau_s: 0.1 } }
                    fixed { half_space { point_m { z: -0.0299 } } } solve_rate_hz: 50 } }
      })",
      "scene", {}, test::source_dir() + "/deploy/sessions");
  return std::make_shared<const SharedScene>(session.scene, reach_of(session));
}

/// Fast, deep, shallow and off the surface.
Simulation::Target target(double time_s) {
  Simulation::Target there;
  there.tool.position_m = {0.01 * std::sin(6.0 * time_s), 0.004 * std::sin(5.0 * time_s),
                           0.004 + 0.006 * std::cos(11.0 * time_s)};
  return there;
}

TEST(Folded, IsTheSameToTheBitAndCanBecomeTheOther) {
  const auto shared = block();
  Simulation kept(shared, 1, false);
  Simulation folded(shared, 1, true);
  Simulation other(shared, 1, false);  // becomes folded's, then
  Simulation fourth(shared, 1, true);  // that of kept
  double most_newton = 0.0;
  constexpr int kSwitch = 260;
  for (int k = 0; k < 520; ++k) {
    const Simulation::Target there = target(kTick_s * k);
    if (k == kSwitch) {
      other.continue_as(folded);
      fourth.continue_as(kept);
    }
    ToolForce forces[4];  // NOLINT: one for each
    kept.step({&there, 1}, from_seconds(kTick_s), 1, {&forces[0], 1});
    folded.step({&there, 1}, from_seconds(kTick_s), 1, {&forces[1], 1});
    ASSERT_EQ(forces[0].force_on_tool_newton, forces[1].force_on_tool_newton) << k;
    most_newton = std::max(most_newton, forces[0].force_on_tool_newton.norm());
    if (k < kSwitch) continue;
    other.step({&there, 1}, from_seconds(kTick_s), 1, {&forces[2], 1});
    fourth.step({&there, 1}, from_seconds(kTick_s), 1, {&forces[3], 1});
    ASSERT_EQ(forces[0].force_on_tool_newton, forces[2].force_on_tool_newton) << k;
    ASSERT_EQ(forces[0].force_on_tool_newton, forces[3].force_on_tool_newton) << k;
  }
  EXPECT_GT(most_newton, 0.05);
}

}  // namespace
}  // namespace palpate::physics
