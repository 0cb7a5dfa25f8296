// SPDX-License-Identifier: Apache-2.0
// Torque: what the tissue asks of a wrist, what of it is felt, and that the hand draws no energy
// from force and torque together.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "common/session/session_file.h"
#include "deploy/lockstep/loopback.h"
#include "physics_node/scene/scene.h"
#include "tests/property/seeds.h"
#include "tests/support/adversity.h"
#include "tests/support/machine/places.h"

namespace palpate::test {
namespace {

using Overrides = std::vector<std::string>;

// Rounding of the inner steps.
constexpr double kRoundingJoule = 1e-6;

Session lever(const Overrides& overrides = {}) {
  return load_session(source_dir() + "/deploy/sessions/tools/lever.txtpb", overrides);
}

RunReport run(const Session& session, double seconds, bool has_ideal = true) {
  return run_loopback(session, {.seconds = seconds, .lockstep = {.has_ideal = has_ideal}});
}

Overrides operator+(Overrides all, const Overrides& more) {
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

const Overrides kLateAndLossy{"faults.tool_motion.delay_ms=50", "faults.interaction.delay_ms=50",
                              "faults.tool_motion.loss_ratio=0.2",
                              "faults.interaction.loss_ratio=0.2"};
const Overrides kUnprotected{"mofc.controller=none", "device.monitor=off"};

// A shaft of radius r that crosses a bar of radius R at a right angle is r + R − d deep, d the
// distance of their axes, and the bar pushes at the foot of d, which is s from the tip: F = k p,
// T = s F. Friction is none.
TEST(Torque, OfAShaftOnABarIsTheForceTimesItsArm) {
  constexpr double kStiffness_newton_per_m = 400.0;
  constexpr double kShaft_m = 0.002;
  constexpr double kBar_m = 0.005;
  const Vector3 bar_m(0.01, 0.0, 0.07);
  SceneConfig config;
  config.tip_radius_m = kShaft_m;
  config.shaft_length_m = 0.12;
  config.shaft_radius_m = kShaft_m;
  config.tissues = {
      {.name = "bar",
       .geometry = CapsuleGeometry{.from_m = bar_m - 0.1 * Vector3::UnitY(),
                                   .to_m = bar_m + 0.1 * Vector3::UnitY(),
                                   .radius_m = kBar_m},
       .material = KelvinVoigtMaterial{.stiffness_newton_per_m = kStiffness_newton_per_m,
                                       .damping_newton_s_per_m = 0.0}}};
  const physics::Scene scene(config);
  for (const double tilt_rad : {0.06, 0.08, 0.1}) {
    physics::TissueMemory memory = scene.new_memory();
    physics::SceneForce touch;
    // up to the tilt, so that the bar is met from its side
    for (int step = 0; step <= 100; ++step) {
      const double now_rad = 0.01 * step * tilt_rad;
      touch = scene.step(memory, Vector3::Zero(), Vector3::Zero(), 1e-3 * step,
                         {std::sin(now_rad), 0.0, std::cos(now_rad)});
    }
    const double distance_m = bar_m.x() * std::cos(tilt_rad) - bar_m.z() * std::sin(tilt_rad);
    const double along_m = bar_m.x() * std::sin(tilt_rad) + bar_m.z() * std::cos(tilt_rad);
    const double newton = kStiffness_newton_per_m * (kShaft_m + kBar_m - distance_m);
    ASSERT_GT(newton, 0.1);
    EXPECT_NEAR(touch.force_on_tool_newton.norm(), newton, 0.01 * newton) << tilt_rad;
    // towards −x at a point above the tip: about −y
    EXPECT_NEAR(touch.torque_on_tool_newton_m.y(), -newton * along_m, 0.01 * newton * along_m)
        << tilt_rad;
    EXPECT_NEAR(touch.torque_on_tool_newton_m.x(), 0.0, 1e-6);
    EXPECT_NEAR(touch.torque_on_tool_newton_m.z(), 0.0, 1e-6);
  }
}

// Friction pulls where the surface is without a tool: 3 mm below the centre of a tip of 5 mm that
// is 2 mm deep.
TEST(Torque, OfFrictionUnderTheTipIsItTimesTheHeightOfTheTip) {
  SceneConfig config;
  config.tip_radius_m = 0.005;
  config.tissues = {{.name = "floor",
                     .geometry = HalfSpaceGeometry{},
                     .material = KelvinVoigtMaterial{.stiffness_newton_per_m = 500.0,
                                                     .damping_newton_s_per_m = 0.0,
                                                     .friction_coefficient = 0.5,
                                                     .friction_stiffness_newton_per_m = 2000.0}}};
  const physics::Scene scene(config);
  physics::TissueMemory memory = scene.new_memory();
  physics::SceneForce touch;
  for (int step = 0; step <= 200; ++step) {  // down by 2 mm, then along x
    const double down_m = std::min(1.0, 0.01 * step) * 0.002;
    const double along_m = std::max(0.0, 0.01 * step - 1.0) * 0.01;
    touch = scene.step(memory, {along_m, 0.0, 0.005 - down_m}, Vector3::Zero(), 1e-3 * step);
  }
  const Vector3& F = touch.force_on_tool_newton;
  EXPECT_NEAR(F.z(), 1.0, 0.01);
  EXPECT_NEAR(F.x(), -0.5, 0.005);
  EXPECT_NEAR(touch.torque_on_tool_newton_m.y(), 0.5 * 0.003, 1.5e-5);
}

// A shaft that turns about a point between its tip and a viscous bar: the tip goes one way and the
// shaft in the bar the other.
struct Swing {
  double newton_per_rad_s = 0.0;  // of the damping, at the greatest speed
  double work_joule = 0.0;        // of the tissue on the tool, per swing
};
Swing swing_through_a_viscous_bar(bool is_turning_known) {
  constexpr double kDamping_newton_s_per_m = 5.0;
  constexpr double kFrequency_hz = 1.0;
  constexpr double kTilt_rad = 0.05;
  constexpr double kPivot_m = 0.05;  // from the tip
  constexpr double kStep_s = 1e-3;
  const Vector3 bar_m(0.0, 0.0, 0.1);
  SceneConfig config;
  config.tip_radius_m = 0.002;
  config.shaft_length_m = 0.12;
  config.shaft_radius_m = 0.002;
  config.tissues = {
      {.name = "bar",
       .geometry = CapsuleGeometry{.from_m = bar_m - 0.1 * Vector3::UnitY(),
                                   .to_m = bar_m + 0.1 * Vector3::UnitY(),
                                   .radius_m = 0.01},
       .material = KelvinVoigtMaterial{.stiffness_newton_per_m = 300.0,
                                       .damping_newton_s_per_m = kDamping_newton_s_per_m,
                                       .is_adhesive = true}}};
  const physics::Scene scene(config);
  physics::TissueMemory memory = scene.new_memory();
  const double turn_per_s = 2.0 * M_PI * kFrequency_hz;
  Swing swing;
  // from the side of the bar, 6 mm beside its middle
  for (int step = 0; step <= 3000; ++step) {
    const double t_s = kStep_s * step;
    const double tilt_rad = kTilt_rad * std::sin(turn_per_s * t_s);
    const double rad_per_s = kTilt_rad * turn_per_s * std::cos(turn_per_s * t_s);
    const Vector3 shaft(std::sin(tilt_rad), 0.0, std::cos(tilt_rad));
    const Vector3 angular(0.0, rad_per_s, 0.0);
    const Vector3 tip_m = Vector3(-0.006, 0.0, kPivot_m) - kPivot_m * shaft;
    const Vector3 tip_m_per_s = -kPivot_m * angular.cross(shaft);
    const auto force = [&](const ToolVelocity& velocity) {
      return scene.evaluate(tip_m, velocity, t_s, memory, shaft).force_on_tool_newton;
    };
    const physics::SceneForce touch = scene.step(
        memory, tip_m,
        is_turning_known ? ToolVelocity(tip_m_per_s, angular) : ToolVelocity(tip_m_per_s), t_s,
        shaft);
    if (step == 2000) {
      const double damped = (force({tip_m_per_s, angular}) - force(Vector3::Zero())).norm();
      swing.newton_per_rad_s = damped / rad_per_s / kDamping_newton_s_per_m;
    }
    if (step > 1000) {  // two swings
      swing.work_joule += 0.5 * kStep_s *
                          (touch.force_on_tool_newton.dot(tip_m_per_s) +
                           touch.torque_on_tool_newton_m.dot(angular));
    }
  }
  return swing;
}

// b times the speed of the shaft where it touches, about s − pivot from where it turns.
TEST(Torque, OfViscousTissueSeesHowFastTheShaftMovesInIt) {
  const Swing seen = swing_through_a_viscous_bar(true);
  EXPECT_NEAR(seen.newton_per_rad_s, 0.1 - 0.05, 0.03 * 0.05);
  // ∫ b v² over a swing, v along the shaft's motion: it is pressed for all of it
  const double v_m_per_s = 0.05 * 0.05 * 2.0 * M_PI;
  EXPECT_NEAR(seen.work_joule, -0.5 * 5.0 * v_m_per_s * v_m_per_s,
              0.1 * 0.5 * 5.0 * v_m_per_s * v_m_per_s);
  // with the tip's velocity alone the tissue would drive the tool
  EXPECT_GT(swing_through_a_viscous_bar(false).work_joule, 1e-4);
}

struct Felt {
  double force;
  double torque;
  double least_joule;
};
Felt felt(const Overrides& overrides, const char* what) {
  const RunStatistics statistics = run(lever(overrides), 6.0).statistics;
  const Felt felt{.force = statistics.ideal_transparency(),
                  .torque = statistics.torque_transparency(),
                  .least_joule = statistics.minimum_true_energy_joule()};
  std::printf("%s: force %.3f and torque %.3f of the ideal, least true energy %.3g µJ\n", what,
              felt.force, felt.torque, 1e6 * felt.least_joule);
  return felt;
}

TEST(Torque, IsFeltAsTheTissueMakesItWhateverTheNetworkDoes) {
  const Felt undisturbed = felt({}, "undisturbed");
  EXPECT_GE(undisturbed.force, 0.985);
  EXPECT_GE(undisturbed.torque, 0.985);
  EXPECT_GE(undisturbed.least_joule, -kRoundingJoule);
  const Felt late = felt(kLateAndLossy, "50 ms and 20 % lost each way");
  EXPECT_GE(late.force, 0.985);
  EXPECT_GE(late.torque, 0.985);
  EXPECT_GE(late.least_joule, -kRoundingJoule);
}

// What turning the tool stores in the tissue, moving it gets back: one pool for both.
TEST(Torque, LetsTheForceHaveWhatItPutsIn) {
  const RunReport report =
      run(lever({"hand.sinusoid.amplitude_m.z=0", "hand.sinusoid.center_m.z=0.01",
                 "hand.stiffness_newton_per_m=20"}),
          4.0);
  EXPECT_GT(report.statistics.maximum_force_newton(), 0.1);
  // with an account for each the force is 0.73 of what is requested
  EXPECT_GE(report.statistics.vector_transparency(), 0.98);
  EXPECT_GE(report.statistics.torque_transparency(), 0.97);
  EXPECT_GE(report.statistics.minimum_true_energy_joule(), -kRoundingJoule);
}

// Held answers that are late push a hand that swings back and forth.
TEST(Torque, OfLateAnswersGivesTheHandEnergyOnlyWithoutTheClamp) {
  const Overrides held = kLateAndLossy + Overrides{"mofc.interaction=held"};
  const RunReport clamped = run(lever(held), 4.0, false);
  const RunReport unprotected = run(lever(held + kUnprotected), 4.0, false);
  EXPECT_GE(clamped.statistics.minimum_true_energy_joule(), -kRoundingJoule);
  EXPECT_GT(clamped.statistics.maximum_torque_newton_m(), 1e-3);
  EXPECT_LT(unprotected.statistics.minimum_true_energy_joule(), -1e-3);
}

constexpr std::uint64_t kRuns = 300;

TEST(GuaranteeWithTorque, NoHandIsGivenEnergyByForceAndTorqueTogether) {
  double least_joule = 0.0;
  double most_newton_m = 0.0;
  std::uint64_t judged = 0;
  const std::uint64_t runs = seed_count(kRuns);
  for (std::uint64_t seed = 1; seed <= runs; ++seed) {
    const AdverseResult result = run_adverse(random_wrist_run(seed), seed);
    if (result.is_too_fast()) continue;
    ++judged;
    EXPECT_GE(result.statistics.minimum_true_energy_joule(), -kRoundingJoule) << "seed=" << seed;
    EXPECT_EQ(result.device.monitor_reductions, 0U) << "seed=" << seed;
    EXPECT_EQ(result.device.ledger_excesses, 0U) << "seed=" << seed;
    least_joule = std::min(least_joule, result.statistics.minimum_true_energy_joule());
    most_newton_m = std::max(most_newton_m, result.statistics.maximum_torque_newton_m());
  }
  std::printf("%llu of %llu runs judged, least true energy %.3g µJ, largest torque %.3f N·m\n",
              static_cast<unsigned long long>(judged), static_cast<unsigned long long>(runs),
              1e6 * least_joule, most_newton_m);
  EXPECT_GE(judged, runs - 1 - runs / 20);
  EXPECT_GT(most_newton_m, 0.05);
}

TEST(GuaranteeWithTorque, TheSameHandsDrawEnergyWithoutTheClamp) {
  double least_joule = 0.0;
  for (std::uint64_t seed = 1; seed <= seed_count(40); ++seed) {
    AdverseRun run = random_wrist_run(seed);
    run.overrides = run.overrides + kUnprotected;
    least_joule =
        std::min(least_joule, run_adverse(run, seed).statistics.minimum_true_energy_joule());
  }
  EXPECT_LT(least_joule, -0.01);
}

// The force is none: what is drawn is drawn by turning.
TEST(GuaranteeWithTorque, TorqueAloneGivesTheHandEnergyOnlyWithoutTheClamp) {
  const auto least_joule = [](const Overrides& more) {
    double least = 0.0;
    for (std::uint64_t seed = 1; seed <= seed_count(40); ++seed) {
      AdverseRun run = random_wrist_run(seed);
      run.overrides = run.overrides + more +
                      Overrides{"device.peak_force_newton=1e-6", "adversary.physics=everything"};
      least = std::min(least, run_adverse(run, seed).statistics.minimum_true_energy_joule());
    }
    return least;
  };
  EXPECT_GE(least_joule({}), -kRoundingJoule);
  EXPECT_LT(least_joule(kUnprotected), -1e-3);
}

TEST(GuaranteeWithTorque, AClampThatLiesIsReducedByTheMonitor) {
  std::uint64_t reductions = 0;
  for (std::uint64_t seed = 1; seed <= seed_count(60); ++seed) {
    AdverseRun run = random_wrist_run(seed);
    run.overrides.push_back(random_lying_run(seed).overrides.back());
    const AdverseResult result = run_adverse(run, seed);
    if (result.is_too_fast()) continue;
    EXPECT_GE(result.statistics.minimum_true_energy_joule(), -kRoundingJoule) << "seed=" << seed;
    reductions += result.device.monitor_reductions;
  }
  EXPECT_GT(reductions, 0U);
}

}  // namespace
}  // namespace palpate::test
