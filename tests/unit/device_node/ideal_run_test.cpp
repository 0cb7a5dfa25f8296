// SPDX-License-Identifier: Apache-2.0
#include "device_node/simulation/ideal_run.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>

#include "common/core/clock.h"
#include "device_node/simulation/simulated_device.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

SimulatedDeviceConfig without_friction() {
  SimulatedDeviceConfig config;
  config.viscous_newton_s_per_m = 0.0;
  config.coulomb_newton = 0.0;
  return config;
}

IdealRun::ForceField spring(double k) {
  return [k](double, const Vector3& x, const Vector3&) { return Vector3(-k * x); };
}

// A hand of 100 N/m pulled to 10 mm against a spring of 300 N/m rests where 100·(10 mm − x) =
// 300·x.
TEST(IdealRun, ComesToRestWhereHandAndTissueBalance) {
  IdealRun run(
      without_friction(), 3.3,
      {.stiffness_newton_per_m = 100,
       .damping_newton_s_per_m = 10,
       .path = RecordedPath{.samples = {{0.0, Vector3::Zero()}, {0.1, Vector3(0.01, 0, 0)}}}},
      1, TimePoint{}, spring(300));

  run.advance_to(time_at(5.0));

  EXPECT_NEAR(run.state().hand_position_m.x(), 0.0025, 1e-9);
  EXPECT_NEAR(run.force_on_hand_newton().x(), -0.75, 1e-6);
}

// The paper's rigid damper, 150 N·s/m, alone against a hand that moves at 10 mm/s: with a hand
// damper B the velocity settles at v_d·B/(B + b) with time constant m/(B + b) = 1.9 ms.
// v(t) = v_d·B/(B+b)·(1 − e^(−t(B+b)/m)); 50 µs midpoint steps err by (h(B+b)/m)²/12 ≈ 6e-5 of it.
TEST(IdealRun, FollowsAStiffDamperFasterThanAnySampling) {
  const double b = 150, B = 6, m = 0.3;
  IdealRun run(
      without_friction(), 3.3,
      {.stiffness_newton_per_m = 0,
       .damping_newton_s_per_m = B,
       .path = RecordedPath{.samples = {{0.0, Vector3::Zero()}, {10.0, Vector3(0.1, 0, 0)}}}},
      1, TimePoint{}, [b](double, const Vector3&, const Vector3& v) { return Vector3(-b * v); });
  const double settled = 0.01 * B / (B + b);

  for (const double t : {0.001, 0.002, 0.005, 0.05}) {
    run.advance_to(time_at(t));
    EXPECT_NEAR(run.state().hand_velocity_m_per_s.x(), settled * (1 - std::exp(-t * (B + b) / m)),
                settled * 1e-4);
  }
}

TEST(IdealRun, ForceIsLimitedToTheSmallerPeak) {
  IdealRun run(without_friction(), 2.0, {}, 1, TimePoint{},
               [](double, const Vector3&, const Vector3&) { return Vector3(0, 30, 40); });

  run.advance_to(time_at(0.001));

  EXPECT_LT((run.force_on_hand_newton() - Vector3(0, 1.2, 1.6)).norm(), 1e-12);
}

// Without tissue the ideal hand and the hand on the sampled device move alike.
TEST(IdealRun, WithoutTissueItMovesAsTheDeviceDoes) {
  const HandConfig hand{.path = HostilePath{}};
  ManualClock clock;
  SimulatedDevice device({}, hand, clock, 5);
  IdealRun run(SimulatedDeviceConfig{}, 3.3, hand, 5, clock.now(),
               [](double, const Vector3&, const Vector3&) { return Vector3(Vector3::Zero()); });

  for (int i = 0; i < 1'000; ++i) {
    clock.advance(1ms);
    DeviceSample sample;
    ASSERT_TRUE(device.read(sample));
    run.advance_to(clock.now());
    ASSERT_EQ(run.state().hand_position_m, device.true_state().hand_position_m);
  }
}

// Time and place are those of the step: middle of the step for the force, end for the memory.
TEST(IdealRun, GivesTheTissueTheTimeAndThePositionOfTheStep) {
  double evaluated_s = -1.0;
  double step_end_s = -1.0;
  Vector3 step_end_m = Vector3::Constant(kNaN);
  IdealRun run(
      without_friction(), 3.3,
      {.path = SinusoidPath{.amplitude_m = {0.01, 0, 0}, .frequency_hz = {1, 0, 0}}}, 1,
      TimePoint{},
      [&](double time_s, const Vector3&, const Vector3&) {
        evaluated_s = time_s;
        return Vector3(Vector3::Zero());
      },
      [&](double time_s, const Vector3& hand_position_m) {
        step_end_s = time_s;
        step_end_m = hand_position_m;
      });

  run.advance_to(time_at(0.2));

  EXPECT_NEAR(evaluated_s, 0.2 - 25e-6, 1e-12);
  EXPECT_NEAR(step_end_s, 0.2, 1e-12);
  EXPECT_EQ(step_end_m, run.state().hand_position_m);
  EXPECT_NE(step_end_m.x(), 0.0);
}

// A continuous passive tissue never gives the hand energy.
TEST(IdealRun, TakesNoEnergyOutOfAPassiveTissue) {
  IdealRun run(SimulatedDeviceConfig{}, 3.3, {.path = HostilePath{}}, 2, TimePoint{}, spring(1000));

  run.advance_to(time_at(10.0));

  EXPECT_GT(run.state().minimum_energy_joule, -1e-6);
}

}  // namespace
}  // namespace palpate::device
