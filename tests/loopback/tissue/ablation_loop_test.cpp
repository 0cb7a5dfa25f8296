// SPDX-License-Identifier: Apache-2.0
// An electrode in the whole loop, on virtual time.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "common/session/session_file.h"
#include "deploy/lockstep/lockstep.h"
#include "tests/property/seeds.h"
#include "tests/support/machine/places.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;

struct Recording {
  std::vector<TickRow> rows;
  PhysicsCounters physics;

  [[nodiscard]] const TickRow& last() const { return rows.back(); }
  /// Largest force on the hand, from and to a second.
  [[nodiscard]] double largest_newton(double from_s, double to_s) const {
    double newton = 0.0;
    for (const TickRow& row : rows) {
      const double time_s = to_seconds(row.device.sampled_at.time_since_epoch());
      if (time_s < from_s || time_s > to_s) continue;
      newton = std::max(newton, row.device.force_on_hand_newton.norm());
    }
    return newton;
  }
};

/// `resection`, in which the tool touches from 0.6 s on and ablates from 2 s on.
Recording resected(const std::vector<std::string>& overrides, Duration length,
                   bool has_ideal = false) {
  Recording result;
  Lockstep lockstep(
      load_session(test::source_dir() + "/deploy/sessions/resection.txtpb", overrides),
      {.has_ideal = has_ideal},
      [&](const TickRow& row, const IdealState& /*ideal*/) { result.rows.push_back(row); });
  lockstep.run_until(length);
  result.physics = lockstep.physics_counters();
  return result;
}

// The same motion with the electrode off is the tissue without ablation.
TEST(AblationLoop, ResectsUnderTheHandWhichIsGivenNothing) {
  if (test::kIsSanitized) GTEST_SKIP() << "figures: the other tests run the same code";
  const Recording run = resected({"hand.press[0].until_s=5"}, 6s);
  const Recording whole = resected({"hand.press[0].from_s=5.9"}, 5900ms);

  EXPECT_GT(run.physics.elastic_bodies_remade, 5U);
  EXPECT_GT(run.physics.elastic_elements_removed, 20U);
  EXPECT_EQ(run.physics.elastic_bodies_refused, 0U);
  EXPECT_NEAR(static_cast<double>(run.physics.elastic_energised_steps), 3000.0, 2.0);
  EXPECT_GT(run.largest_newton(1.0, 2.0), 0.05) << "before";
  EXPECT_EQ(run.largest_newton(1.0, 2.0), whole.largest_newton(1.0, 2.0));
  EXPECT_LT(run.largest_newton(4.0, 5.0), 0.8 * whole.largest_newton(4.0, 5.0)) << "during";
  EXPECT_LT(run.largest_newton(5.5, 5.9), 0.8 * whole.largest_newton(5.5, 5.9)) << "after";
  EXPECT_GE(run.last().device.minimum_true_energy_joule, -1e-6);
  for (const TickRow& row : run.rows) ASSERT_TRUE(row.device.force_on_hand_newton.allFinite());
}

TEST(AblationLoop, IsTheSameToTheBit) {
  const Recording first = resected({}, 3500ms);
  const Recording second = resected({}, 3500ms);
  ASSERT_GT(first.physics.elastic_bodies_remade, 0U);
  ASSERT_EQ(first.rows.size(), second.rows.size());
  for (std::size_t i = 0; i < first.rows.size(); ++i) {
    ASSERT_EQ(first.rows[i].device.force_on_hand_newton,
              second.rows[i].device.force_on_hand_newton);
  }
}

// The ideal is ablated by the same law, with full solutions every millisecond.
TEST(AblationLoop, TheIdealIsAblatedToo) {
  if (test::kIsSanitized) GTEST_SKIP() << "figures: the other tests run the same code";
  const Recording run = resected({}, 3500ms, true);
  double error2 = 0.0;
  double ideal2 = 0.0;
  for (const TickRow& row : run.rows) {
    error2 += (row.device.force_on_hand_newton - row.ideal_force_on_hand_newton).squaredNorm();
    ideal2 += row.ideal_force_on_hand_newton.squaredNorm();
  }
  ASSERT_GT(run.physics.elastic_elements_removed, 0U);
  EXPECT_LT(std::sqrt(error2 / ideal2), 0.25);
}

// Delay, loss, silence while it ablates: the hand gets nothing.
TEST(AblationLoop, ABadNetworkDoesNotGiveTheHandEnergy) {
  std::vector<std::string> network;
  for (const char* link : {"tool_motion", "interaction"}) {
    network.push_back(std::string("faults.") + link + ".delay_ms=50");
    network.push_back(std::string("faults.") + link + ".loss_ratio=0.2");
  }
  const Recording run = resected(network, 5s);
  EXPECT_GT(run.physics.elastic_elements_removed, 0U);
  EXPECT_GE(run.last().device.minimum_true_energy_joule, -1e-6);
}

// A hostile hand on tissue that vanishes under it.
TEST(AblationLoop, AHostileHandGetsNothing) {
  for (const std::uint64_t seed : test::seeds(3)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const Recording run =
        resected({"seed=" + std::to_string(seed), "hand.press[0].from_s=0.1",
                  "hand.hostile.radius_m=0.02", "hand.hostile.v_max_m_per_s=0.3",
                  "hand.stiffness_newton_per_m=2000", "hand.damping_newton_s_per_m=40"},
                 1000ms);
    EXPECT_GE(run.last().device.minimum_true_energy_joule, -1e-6);
  }
}

}  // namespace
}  // namespace palpate
