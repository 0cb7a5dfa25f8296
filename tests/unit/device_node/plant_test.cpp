// SPDX-License-Identifier: Apache-2.0
// The shared mechanics against closed forms.
#include "device_node/simulation/plant.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace palpate::device {
namespace {

constexpr double kStep_s = 50e-6;

/// Runs `plant` for n steps with a passive hand and the given force.
void run(Plant& plant, int n, const Vector3& force_newton = Vector3::Zero(), double h = kStep_s) {
  for (int i = 0; i < n; ++i) plant.step(h, {}, force_newton);
}

// v(t) = v0·exp(−b·t/m), x(t) = v0·m/b·(1 − exp(−b·t/m)). Each midpoint step errs by (b h/m)³/12
// = 1.6e-13 relative, 20 000 steps by 3e-9.
TEST(Plant, FreeDecayFollowsTheExponential) {
  const double m = 0.2, b = 0.5, v0 = 0.1;
  Plant plant({.mass_kg = m, .viscous_newton_s_per_m = b}, Vector3::Zero(), Vector3(v0, 0, 0));

  run(plant, 20'000);

  const double decay = std::exp(-b * 1.0 / m);
  EXPECT_NEAR(plant.state().hand_velocity_m_per_s.x(), v0 * decay, v0 * 1e-8);
  EXPECT_NEAR(plant.state().hand_position_m.x(), v0 * m / b * (1 - decay), 1e-9);
}

// Constant deceleration f_co/m = 1/3 m/s²: rest after m·v0/f_co = 0.3 s and m·v0²/(2·f_co) = 15 mm.
// In the direction (3, 4, 0)/5 the friction must act along the motion, not per axis.
TEST(Plant, CoulombFrictionStopsTheMassAtTheComputedTimeAndPlace) {
  const Vector3 direction(0.6, 0.8, 0);
  Plant plant({.mass_kg = 0.3, .coulomb_newton = 0.1}, Vector3::Zero(), 0.1 * direction);

  run(plant, 5'999);
  EXPECT_GT(plant.state().hand_velocity_m_per_s.norm(), 0.0);
  run(plant, 2);
  EXPECT_EQ(plant.state().hand_velocity_m_per_s.norm(), 0.0);

  EXPECT_LT((plant.state().hand_position_m - 0.015 * direction).norm(), 1e-9);
}

TEST(Plant, StaysStuckExactlyOnceFrictionStoppedIt) {
  Plant plant({.mass_kg = 0.3, .coulomb_newton = 0.1}, Vector3::Zero(), Vector3(0.1, 0, 0));
  run(plant, 6'100);
  const Vector3 rest_m = plant.state().hand_position_m;

  run(plant, 10'000, Vector3(0.06, 0, -0.079));

  EXPECT_EQ(plant.state().hand_position_m, rest_m);
}

TEST(Plant, AForceBelowStictionDoesNotMoveItAtAll) {
  Plant plant({.mass_kg = 0.3, .coulomb_newton = 0.1});

  run(plant, 20'000, Vector3(0.0999999, 0, 0));

  EXPECT_EQ(plant.state().hand_position_m, Vector3::Zero().eval());
  EXPECT_EQ(plant.state().energy_joule, 0.0);
}

// (0.13 − 0.1) N on 0.3 kg: a = 0.1 m/s², after 1 s x = 50 mm, v = 0.1 m/s.
TEST(Plant, AForceAboveStictionAcceleratesByTheDifference) {
  Plant plant({.mass_kg = 0.3, .coulomb_newton = 0.1});

  run(plant, 20'000, Vector3(0, 0.13, 0));

  EXPECT_NEAR(plant.state().hand_position_m.y(), 0.05, 1e-10);
  EXPECT_NEAR(plant.state().hand_velocity_m_per_s.y(), 0.1, 1e-10);
}

// All of ½ m v0² = 1.5 mJ goes into friction; ending the last step unbooked takes < 1e-11 J.
TEST(Plant, FrictionDissipatesTheKineticEnergy) {
  Plant plant({.mass_kg = 0.3, .viscous_newton_s_per_m = 0.1, .coulomb_newton = 0.1},
              Vector3::Zero(), Vector3(0.1, 0, 0));

  run(plant, 20'000);

  EXPECT_NEAR(plant.state().energy_joule, 1.5e-3, 1e-11);
  EXPECT_LE(plant.state().energy_joule, 1.5e-3 + 1e-17);
}

// Friction per axis, 0.3 kg: x slides with 0.1 m/s against 0.2 N and stops after m v/f = 0.15 s and
// m v²/(2 f) = 7.5 mm, y slides on with 0.1 m/s against nothing, z sticks under 0.3 N.
TEST(Plant, WithFrictionPerAxisEachAxisSlidesAndSticksIndependently) {
  Plant plant(
      {.mass_kg = 0.3, .per_axis = FrictionPerAxis{Vector3::Zero(), Vector3(0.2, 0.0, 0.31)}},
      Vector3::Zero(), Vector3(0.1, 0.1, 0));

  run(plant, 20'000, Vector3(0, 0, 0.3));  // 1 s

  EXPECT_NEAR(plant.state().hand_position_m.x(), 7.5e-3, 1e-8);
  EXPECT_EQ(plant.state().hand_velocity_m_per_s.x(), 0.0);
  EXPECT_NEAR(plant.state().hand_position_m.y(), 0.1, 1e-10);
  EXPECT_EQ(plant.state().hand_position_m.z(), 0.0);
  // x gave ½ m v² = 1.5 mJ to friction
  EXPECT_NEAR(plant.state().energy_joule, 1.5e-3, 1e-11);
}

// A steady 1 N on each axis for 1 s: v = (1 − f_co)/f_d once it no longer accelerates (m/f_d ≤ 10
// ms): x 0.9/40 = 22.5 mm/s, y 0.8/50 = 16 mm/s. The port's energy is all friction's less all of
// F's, and so −½ m v² of all axes: −½·0.3·(0.0225² + 0.016² + 0.02²) = −174.3 µJ with z (1 −
// 0.4)/30 = 20 mm/s.
TEST(Plant, WithFrictionPerAxisEachAxisHasItsOwnSteadySpeed) {
  Plant plant(
      {.mass_kg = 0.3, .per_axis = FrictionPerAxis{Vector3(40, 50, 30), Vector3(0.1, 0.2, 0.4)}});

  run(plant, 20'000, Vector3(1, 1, 1));

  EXPECT_LT((plant.state().hand_velocity_m_per_s - Vector3(0.0225, 0.016, 0.02)).norm(), 1e-12);
  EXPECT_NEAR(plant.state().energy_joule, -174.3375e-6, 1e-10);
}

// Without friction the rendered force's work is all: E = −F·x, and a force along the motion gives
// energy to the hand.
TEST(Plant, EnergyOfAHelpingForceIsNegativeAndItsMinimumIsKept) {
  Plant plant({.mass_kg = 0.3});

  run(plant, 2'000, Vector3(1, 0, 0));  // 0.1 s: x = F t²/(2m) = 16.7 mm
  const double lowest_joule = -1.0 * plant.state().hand_position_m.x();
  EXPECT_NEAR(plant.state().energy_joule, lowest_joule, 1e-15);
  run(plant, 500, Vector3(-1, 0, 0));  // now it resists

  EXPECT_GT(plant.state().energy_joule, lowest_joule);
  EXPECT_NEAR(plant.state().minimum_energy_joule, lowest_joule, 1e-15);
}

/// Mass, spring, damper after a hand target that swings; position after 0.5 s in n steps.
double swing_position_m(int n) {
  Plant plant({.mass_kg = 0.05,
               .hand_stiffness_newton_per_m = 500,
               .hand_damping_newton_s_per_m = 2,
               .viscous_newton_s_per_m = 0.3});
  const double h = 0.5 / n;
  const double omega = 40.0;
  for (int i = 0; i < n; ++i) {
    const double t = (i + 0.5) * h;
    plant.step(h,
               {Vector3(0.01 * std::sin(omega * t), 0, 0),
                Vector3(0.01 * omega * std::cos(omega * t), 0, 0)},
               Vector3(0.2, 0, 0));
  }
  return plant.state().hand_position_m.x();
}

// Second order: half the step, a quarter of the error. Richardson: (x1 − x2)/(x2 − x4) = 4.
TEST(Plant, HalvingTheStepQuartersTheErrorOfASmoothMotion) {
  const double x1 = swing_position_m(1'000);
  const double x2 = swing_position_m(2'000);
  const double x4 = swing_position_m(4'000);

  EXPECT_NEAR((x1 - x2) / (x2 - x4), 4.0, 0.05);
}

TEST(Plant, EqualStepsFillTheIntervalAndNoneIsLongerThanAllowed) {
  const TimePoint origin = time_at(1.0);
  std::vector<double> middles_s;
  double total_s = 0.0;

  // 130 µs in steps of at most 50: three of 43.3 µs
  in_equal_steps(origin, origin + Duration(10'000), origin + Duration(140'000), Duration(50'000),
                 [&](double middle_s, double h_s) {
                   middles_s.push_back(middle_s);
                   total_s += h_s;
                 });

  ASSERT_EQ(middles_s.size(), 3u);
  EXPECT_NEAR(total_s, 130e-6, 1e-18);
  EXPECT_NEAR(middles_s[0], 10e-6 + 130e-6 / 6, 1e-15);
  EXPECT_NEAR(middles_s[2], 10e-6 + 130e-6 * 5 / 6, 1e-15);
}

}  // namespace
}  // namespace palpate::device
