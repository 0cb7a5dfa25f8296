// SPDX-License-Identifier: Apache-2.0
// A gripper in the whole loop, on virtual time.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "common/session/session_file.h"
#include "deploy/lockstep/lockstep.h"
#include "tests/support/machine/places.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;

Session shipped(const std::string& name, const std::vector<std::string>& overrides = {}) {
  return load_session(test::source_dir() + "/deploy/sessions/" + name + ".txtpb", overrides);
}

struct Recording {
  std::vector<TickRow> rows;
  MofcCounters mofc;

  [[nodiscard]] const TickRow& last() const { return rows.back(); }
};

Recording run(const Session& session, Duration length, bool has_ideal) {
  Recording result;
  Lockstep lockstep(
      session, {.has_ideal = has_ideal},
      [&](const TickRow& row, const IdealState& /*ideal*/) { result.rows.push_back(row); });
  lockstep.run_until(length);
  result.mofc = lockstep.mofc_counters();
  return result;
}

// The hand holds the block while physics says what it likes of that.
TEST(Grasping, ALyingGripGivesTheHandNothing) {
  const Recording clamped =
      run(shipped("hostile_grasp", {"adversary.physics=lying_grip"}), 600ms, false);
  const Recording unlimited =
      run(shipped("hostile_grasp",
                  {"adversary.physics=lying_grip", "mofc.controller=none", "device.monitor=off"}),
          600ms, false);

  EXPECT_GE(clamped.last().device.minimum_true_energy_joule, -1e-6);
  EXPECT_LT(unlimited.last().device.minimum_true_energy_joule, -1e-3);
  EXPECT_EQ(clamped.mofc.interaction.rejected, 0U);
  EXPECT_GT(clamped.mofc.grips, 0U);
}

/// `retract` with the linear elements of its mesh, twice as fast.
Recording retracted(const std::vector<std::string>& overrides) {
  std::vector<std::string> all{"scene.tissue[0].elastic.linear_elements=true",
                               "hand.sinusoid.frequency_hz.z=0.5", "hand.press[0].from_s=0.9",
                               "hand.press[0].until_s=3"};
  all.insert(all.end(), overrides.begin(), overrides.end());
  return run(shipped("retract", all), 3200ms, true);
}

void expect_a_held_pull(const Recording& pull, double most_error_ratio) {
  double error2 = 0.0;
  double peak = 0.0;
  std::size_t held = 0;
  for (const TickRow& row : pull.rows) {
    if (!row.mofc || row.mofc->grip != GripState::kHolds) continue;
    ++held;
    const double ideal = row.ideal_force_on_hand_newton.z();
    error2 += std::pow(row.device.force_on_hand_newton.z() - ideal, 2);
    peak = std::max(peak, std::abs(ideal));
  }
  EXPECT_GT(held, 1800U);
  EXPECT_GT(peak, 0.5);
  EXPECT_LT(std::sqrt(error2 / static_cast<double>(held)) / peak, most_error_ratio);
  EXPECT_EQ(pull.mofc.grips, 1U);
  EXPECT_EQ(pull.mofc.grips_torn + pull.mofc.grips_slipped, 0U);
  // nothing is left on the hand
  EXPECT_EQ(pull.last().mofc->grip, GripState::kNone);
  EXPECT_GE(pull.last().device.minimum_true_energy_joule, -1e-6);
}

TEST(Grasping, RetractsTissueAsTheFullSolutionDoes) { expect_a_held_pull(retracted({}), 0.02); }

TEST(Grasping, DelayAndLossDoNotChangeHowHeldTissueFeels) {
  std::vector<std::string> network;
  for (const char* link : {"tool_motion", "interaction"}) {
    network.push_back(std::string("faults.") + link + ".delay_ms=50");
    network.push_back(std::string("faults.") + link + ".loss_ratio=0.2");
  }
  expect_a_held_pull(retracted(network), 0.04);
}

// --- a needle ------------------------------------------------------------------------------------

/// Along the needle, of the whole run; relative to the largest ideal force.
double error_ratio_of(const Recording& way) {
  double error2 = 0.0;
  double peak = 0.0;
  for (const TickRow& row : way.rows) {
    const double ideal = row.ideal_force_on_hand_newton.z();
    error2 += std::pow(row.device.force_on_hand_newton.z() - ideal, 2);
    peak = std::max(peak, std::abs(ideal));
  }
  EXPECT_GT(peak, 0.4);
  return std::sqrt(error2 / static_cast<double>(way.rows.size())) / peak;
}

// Through the membrane and to the lesion, beside full solutions every millisecond.
TEST(Needle, GoesInAsInFullSolutions) {
  const Recording way = run(shipped("tools/biopsy"), 4200ms, true);
  EXPECT_LT(error_ratio_of(way), 0.03);
  EXPECT_EQ(way.mofc.punctures, 1U);
  EXPECT_EQ(way.last().mofc->grip, GripState::kPierced);
}

TEST(Needle, DelayAndLossHardlyChangeHowItFeels) {
  std::vector<std::string> network;
  for (const char* link : {"tool_motion", "interaction"}) {
    network.push_back(std::string("faults.") + link + ".delay_ms=50");
    network.push_back(std::string("faults.") + link + ".loss_ratio=0.2");
  }
  const Recording way = run(shipped("tools/biopsy", network), 5s, true);
  EXPECT_LT(error_ratio_of(way), 0.05);  // most of it while the puncture is on its way
  EXPECT_EQ(way.mofc.punctures, 1U);
  EXPECT_GE(way.last().device.minimum_true_energy_joule, -1e-6);
}

TEST(Needle, ComesOutAndGoesInByTheSameHole) {
  const Recording way = run(shipped("tools/biopsy"), 16s, false);
  EXPECT_EQ(way.mofc.punctures, 2U);
  EXPECT_EQ(way.mofc.grips, 0U);
  EXPECT_GE(way.last().device.minimum_true_energy_joule, -1e-6);
  EXPECT_EQ(way.last().mofc->grip, GripState::kNone);
  // the second time there is no membrane
  double first = 0.0;
  double second = 0.0;
  for (std::size_t i = 0; i < way.rows.size(); ++i) {
    const TickRow& row = way.rows[i];
    if (!row.mofc || row.mofc->grip != GripState::kNone) continue;
    double& most = 2 * i < way.rows.size() ? first : second;
    most = std::max(most, row.device.force_on_hand_newton.z());
  }
  EXPECT_GT(first, 0.45);
  EXPECT_LT(second, 0.25);
}

// --- organs that touch ---------------------------------------------------------------------------

/// Of a press, over its first second, when it is deepest.
struct Press {
  double largest_newton = 0.0;
  double error_ratio = 0.0;  // rms, of the ideal force's
};

Press pressed(const std::string& session, const std::vector<std::string>& overrides) {
  const Recording way = run(shipped(session, overrides), 1100ms, true);
  Press press;
  double error2 = 0.0;
  double ideal2 = 0.0;
  for (const TickRow& row : way.rows) {
    press.largest_newton = std::max(press.largest_newton, row.device.force_on_hand_newton.norm());
    error2 += (row.device.force_on_hand_newton - row.ideal_force_on_hand_newton).squaredNorm();
    ideal2 += row.ideal_force_on_hand_newton.squaredNorm();
  }
  press.error_ratio = std::sqrt(error2 / ideal2);
  EXPECT_GE(way.last().device.minimum_true_energy_joule, -1e-6);
  EXPECT_EQ(way.mofc.interaction.rejected, 0U);
  return press;
}

TEST(Touching, BonesBehindAnOrganMakeItStiffer) {
  const Press against = pressed("tools/against_rib", {});
  const Press free = pressed("tools/against_rib", {"scene.tissue[1].box.center_m.z=-0.2",
                                                   "scene.tissue[2].capsule.from_m.z=-0.2",
                                                   "scene.tissue[2].capsule.to_m.z=-0.2"});
  EXPECT_GT(against.largest_newton, 1.2 * free.largest_newton);
  EXPECT_LT(against.error_ratio, 0.1);
}

TEST(Touching, BonesThatBreatheLiftTheOrgan) {
  const std::vector<std::string> motion{"motion.frequency_hz=0.5", "motion.amplitude_m.z=0.004",
                                        "motion.phase_rad=-1.57"};
  std::vector<std::string> overrides;
  for (const char* const tissue : {"scene.tissue[1].", "scene.tissue[2]."}) {
    for (const std::string& field : motion) overrides.push_back(tissue + field);
  }
  const Press breathing = pressed("tools/against_rib", overrides);
  const Press still = pressed("tools/against_rib", {});
  std::printf("bones that breathe: error %.3f, %.2f N; still %.3f, %.2f N\n", breathing.error_ratio,
              breathing.largest_newton, still.error_ratio, still.largest_newton);
  EXPECT_GT(breathing.largest_newton, 1.2 * still.largest_newton);
  EXPECT_LT(breathing.error_ratio, still.error_ratio + 0.03);
}

// Bones push faster than the hand, and what they push with comes late.
TEST(Touching, BonesThatBreatheGiveTheHandNoEnergy) {
  std::vector<std::string> overrides{"faults.tool_motion.delay_ms=50",
                                     "faults.interaction.delay_ms=50"};
  for (const char* const tissue : {"scene.tissue[1].", "scene.tissue[2]."}) {
    overrides.push_back(std::string(tissue) + "motion.frequency_hz=1.3");
    overrides.push_back(std::string(tissue) + "motion.amplitude_m.z=0.004");
  }
  const auto least_joule = [&](const std::vector<std::string>& more) {
    std::vector<std::string> all = overrides;
    all.insert(all.end(), more.begin(), more.end());
    const Recording way = run(shipped("tools/against_rib", all), 4s, false);
    EXPECT_EQ(way.mofc.interaction.rejected, 0U);
    return way.last().device.minimum_true_energy_joule;
  };
  const double unlimited = least_joule({"mofc.controller=none", "device.monitor=off"});
  const double clamped = least_joule({});
  std::printf("bones that breathe, 100 ms: least true energy %.3g J, %.3g J without the clamp\n",
              clamped, unlimited);
  EXPECT_GE(clamped, -1e-6);
  EXPECT_LT(unlimited, -1e-4);
}

TEST(Touching, AnOrganBelowCarriesTheOneAbove) {
  const Press above = pressed("tools/two_organs", {});
  const Press free = pressed("tools/two_organs",
                             {"scene.tissue[1].position_m.z=-0.2",
                              "scene.tissue[1].elastic.fixed[0].half_space.point_m.z=-0.2299"});
  EXPECT_GT(above.largest_newton, 1.05 * free.largest_newton);
  EXPECT_LT(above.error_ratio, 0.15);  // the liver swings
}

}  // namespace
}  // namespace palpate
