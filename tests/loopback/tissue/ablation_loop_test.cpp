// SPDX-License-Identifier: Apache-2.0
// Tissue that is ablated or torn off, in the whole loop, on virtual time.
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

Recording recorded(const std::string& session, const std::vector<std::string>& overrides,
                   Duration length, bool has_ideal = false) {
  Recording result;
  Lockstep lockstep(
      load_session(test::source_dir() + "/deploy/sessions/" + session + ".txtpb", overrides),
      {.has_ideal = has_ideal},
      [&](const TickRow& row, const IdealState& /*ideal*/) { result.rows.push_back(row); });
  lockstep.run_until(length);
  result.physics = lockstep.physics_counters();
  return result;
}

/// In which the tool touches from 0.6 s on and ablates from 2 s on.
Recording resected(const std::vector<std::string>& overrides, Duration length,
                   bool has_ideal = false) {
  return recorded("resection", overrides, length, has_ideal);
}

/// In which the jaws close at 2.5 s, when the tool has begun to rise.
Recording peeled(const std::vector<std::string>& overrides, bool has_ideal = false) {
  return recorded("tools/gallbladder", overrides, test::kIsSanitized ? 4s : 8s, has_ideal);
}

/// Of the force on the hand, relative to that of the ideal.
double error_of(const Recording& run) {
  double error2 = 0.0;
  double ideal2 = 0.0;
  for (const TickRow& row : run.rows) {
    error2 += (row.device.force_on_hand_newton - row.ideal_force_on_hand_newton).squaredNorm();
    ideal2 += row.ideal_force_on_hand_newton.squaredNorm();
  }
  return std::sqrt(error2 / ideal2);
}

std::vector<std::string> bad_network() {
  std::vector<std::string> network;
  for (const char* link : {"tool_motion", "interaction"}) {
    network.push_back(std::string("faults.") + link + ".delay_ms=50");
    network.push_back(std::string("faults.") + link + ".loss_ratio=0.2");
  }
  return network;
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
  ASSERT_GT(run.physics.elastic_elements_removed, 0U);
  EXPECT_LT(error_of(run), 0.25);
}

// Delay, loss, silence while it ablates: the hand gets nothing.
TEST(AblationLoop, ABadNetworkDoesNotGiveTheHandEnergy) {
  const Recording run = resected(bad_network(), 5s);
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

TEST(TearingLoop, PeelsAnOrganOffAsTheFullSolutionsSay) {
  if (test::kIsSanitized) GTEST_SKIP() << "figures: the other tests run the same code";
  const Recording run = peeled({}, true);
  EXPECT_GT(run.physics.elastic_attachments_torn, 20U);
  EXPECT_GT(run.physics.elastic_torn_joule, 1e-3);
  EXPECT_GT(run.physics.elastic_bodies_remade, 3U);
  EXPECT_EQ(run.physics.elastic_bodies_refused, 0U);
  EXPECT_GT(run.largest_newton(3.0, 8.0), 0.2);
  EXPECT_LT(error_of(run), 0.1);
  EXPECT_GE(run.last().device.minimum_true_energy_joule, -1e-6);
  // with much toughness it holds, and pulls more
  const Recording held =
      peeled({"scene.tissue[0].elastic.attached[0].toughness_joule_per_m2=1000"});
  EXPECT_EQ(held.physics.elastic_attachments_torn, 0U);
  EXPECT_GT(held.largest_newton(3.0, 8.0), 1.2 * run.largest_newton(3.0, 8.0));
}

/// A hand that takes hold at once, of what tears easily.
std::vector<std::string> hostile_hand(std::uint64_t seed, const std::string& toughness) {
  return {"seed=" + std::to_string(seed),
          "hand.press[0].from_s=0.1",
          "hand.hostile.radius_m=0.03",
          "hand.hostile.v_max_m_per_s=0.3",
          "hand.stiffness_newton_per_m=2000",
          "hand.damping_newton_s_per_m=40",
          toughness + "=0.5"};
}

TEST(TearingLoop, ABadNetworkOrAHostileHandGetsNothing) {
  std::vector<std::string> overrides = bad_network();
  EXPECT_GE(peeled(overrides).last().device.minimum_true_energy_joule, -1e-6);
  for (const std::uint64_t seed : test::seeds(3)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const Recording run =
        peeled(hostile_hand(seed, "scene.tissue[0].elastic.attached[0].toughness_joule_per_m2"));
    EXPECT_GE(run.last().device.minimum_true_energy_joule, -1e-6);
  }
}

/// The same of an organ that grows on another one, which gives way too.
Recording peeled_off_an_organ(const std::vector<std::string>& overrides, bool has_ideal = false) {
  return recorded("tools/gallbladder_on_liver", overrides, test::kIsSanitized ? 4s : 8s, has_ideal);
}

TEST(TearingLoop, PeelsAnOrganOffAnotherAsTheFullSolutionsSay) {
  if (test::kIsSanitized) GTEST_SKIP() << "figures: the other tests run the same code";
  const Recording run = peeled_off_an_organ({}, true);
  EXPECT_GT(run.physics.elastic_attachments_torn, 20U);
  EXPECT_GT(run.physics.elastic_torn_joule, 1e-3);
  EXPECT_EQ(run.physics.elastic_bodies_refused, 0U);
  EXPECT_GT(run.largest_newton(3.0, 8.0), 0.2);
  EXPECT_LT(error_of(run), 0.12);
  EXPECT_GE(run.last().device.minimum_true_energy_joule, -1e-6);
  // a liver that hardly gives way holds it like a bed: it begins to tear when it is lifted less
  const Recording stiff = peeled_off_an_organ({"scene.tissue[0].elastic.young_pa=1e6",
                                               "scene.tissue[0].elastic.attached[0]."
                                               "stiffness_pa_per_m=1e8"});
  EXPECT_GT(stiff.physics.elastic_attachments_torn, run.physics.elastic_attachments_torn);
}

TEST(TearingLoop, ABadNetworkOrAHostileHandGetsNothingFromTwoOrgans) {
  EXPECT_GE(peeled_off_an_organ(bad_network()).last().device.minimum_true_energy_joule, -1e-6);
  for (const std::uint64_t seed : test::seeds(2)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const Recording run = peeled_off_an_organ(
        hostile_hand(seed, "scene.tissue[1].elastic.attached[0].toughness_joule_per_m2"));
    EXPECT_GE(run.last().device.minimum_true_energy_joule, -1e-6);
  }
}

}  // namespace
}  // namespace palpate
