// SPDX-License-Identifier: Apache-2.0
#include "device_node/simulation/hand.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace palpate::device {
namespace {

void expect_at(const Target& target, const Vector3& position_m, const Vector3& velocity_m_per_s,
               double tolerance = 1e-12) {
  EXPECT_LT((target.position_m - position_m).norm(), tolerance);
  EXPECT_LT((target.velocity_m_per_s - velocity_m_per_s).norm(), tolerance);
}

/// The largest |position change| / time over steps of 10 µs: a jump would show as a huge speed.
double fastest_m_per_s(const VPath& path, double until_s) {
  double fastest = 0.0;
  Vector3 previous = target_on(path, 0.0).position_m;
  for (double t = 1e-5; t < until_s; t += 1e-5) {
    const Vector3 position = target_on(path, t).position_m;
    fastest = std::max(fastest, (position - previous).norm() / 1e-5);
    previous = position;
  }
  return fastest;
}

// Legs (0.03, 0, 0.04): 50 mm long, 0.5 s each at 0.1 m/s.
VPath v_path() {
  return {
      .apex_m = Vector3(0, 0, -0.02), .height_m = 0.04, .half_width_m = 0.03, .speed_m_per_s = 0.1};
}

TEST(VPath, RunsDownOneLegUpTheOtherAndHoldsAtTheEnd) {
  const VPath path = v_path();

  expect_at(target_on(path, 0.0), {-0.03, 0, 0.02}, {0.06, 0, -0.08});
  expect_at(target_on(path, 0.25), {-0.015, 0, 0}, {0.06, 0, -0.08});
  expect_at(target_on(path, 0.5), {0, 0, -0.02}, {0.06, 0, 0.08});
  expect_at(target_on(path, 0.75), {0.015, 0, 0}, {0.06, 0, 0.08});
  expect_at(target_on(path, 1.0 + 1e-9), {0.03, 0, 0.02}, {0, 0, 0});
  expect_at(target_on(path, 100.0), {0.03, 0, 0.02}, {0, 0, 0});
}

TEST(VPath, LiesInAnyPlane) {
  VPath path = v_path();
  path.normal = Vector3::UnitY();
  path.tangent = Vector3::UnitZ();

  expect_at(target_on(path, 0.25), {0, 0.02, -0.035}, {0, -0.08, 0.06});
}

// Free motion of the defaults: a circle of 20 mm at 0.5 Hz in the V's plane, through the start and
// above it, at 2π·0.5·0.02 = 62.8 mm/s.
TEST(VPath, CirclesAboveItsStartBeforeTheV) {
  VPath path = v_path();
  path.free_motion_s = 14.0;
  const Vector3 start(-0.03, 0, 0.02);
  const double speed = 0.02 * std::numbers::pi;

  expect_at(target_on(path, 0.0), start, {speed, 0, 0});
  expect_at(target_on(path, 0.5), start + Vector3(0.02, 0, 0.02), {0, 0, speed});
  expect_at(target_on(path, 1.0), start + Vector3(0, 0, 0.04), {-speed, 0, 0});
  expect_at(target_on(path, 1.5), start + Vector3(-0.02, 0, 0.02), {0, 0, -speed});
  // 7 whole turns end at the start: the V follows 14 s later, otherwise unchanged
  expect_at(target_on(path, 14.0 - 1e-6), start, {speed, 0, 0}, 1e-6);
  expect_at(target_on(path, 14.25), {-0.015, 0, 0}, {0.06, 0, -0.08});
}

// 2.4 s leave the circle at 0.4π, 2·20·sin(0.2π) = 23.5 mm from the start; taken back over 0.5 s
// that adds at most 1.5·23.5/0.5 = 71 mm/s, mostly against the circle's 63. A jump would read as
// 1900 m/s.
TEST(VPath, ThePositionIsContinuousWhateverTheFreeTime) {
  for (const double free_s : {0.0, 0.1, 0.5, 2.0, 2.4, 3.7}) {
    VPath path = v_path();
    path.free_motion_s = free_s;

    EXPECT_LT(fastest_m_per_s(path, free_s + 1.2), 0.13) << "free " << free_s << " s";
  }
}

TEST(VPath, VelocityIsTheDerivativeOfThePosition) {
  VPath path = v_path();
  path.free_motion_s = 2.4;
  const double d = 1e-6;
  for (const double t : {0.3, 1.2, 1.95, 2.1, 2.35, 2.6, 3.1}) {
    const Vector3 slope =
        (target_on(path, t + d).position_m - target_on(path, t - d).position_m) / (2 * d);
    EXPECT_LT((target_on(path, t).velocity_m_per_s - slope).norm(), 1e-7) << "t = " << t;
  }
}

TEST(HoldPath, HoldsStill) {
  expect_at(target_on(HoldPath{.position_m = Vector3(1, 2, 3)}, 5.0), {1, 2, 3}, {0, 0, 0});
}

// x: 1 Hz, 10 mm; z: 2 Hz, 5 mm a quarter turn ahead. At 1/12 s: sin 30° = ½, sin 150° = ½.
TEST(SinusoidPath, MovesEachAxisIndependently) {
  const SinusoidPath path{.center_m = Vector3(0.1, 0.2, 0.3),
                          .amplitude_m = Vector3(0.01, 0, 0.005),
                          .frequency_hz = Vector3(1, 7, 2),
                          .phase_rad = Vector3(0, 0, std::numbers::pi / 2)};
  const double root3 = std::sqrt(3.0);

  expect_at(target_on(path, 1.0 / 12), {0.1 + 0.005, 0.2, 0.3 + 0.0025},
            {0.01 * std::numbers::pi * root3, 0, -0.01 * std::numbers::pi * root3});
}

RecordedPath recorded_path() {
  RecordedPath path;
  path.samples = {
      {1.0, Vector3(0, 0, 0)}, {2.0, Vector3(0.01, 0, 0)}, {4.0, Vector3(0.01, 0.04, 0)}};
  return path;
}

TEST(SinusoidPath, IsTheSameInStepsOfAnyLength) {
  const SinusoidPath path{.center_m = Vector3(0.01, 0, -0.02),
                          .amplitude_m = Vector3(0.015, 0, 0.01),
                          .frequency_hz = Vector3(0.7, 1.0, 5.0),
                          .phase_rad = Vector3(-0.94, 0, 1.57)};
  for (const double begin_s : {0.0, 3600.0}) {
    const double tolerance = begin_s == 0.0 ? 1e-13 : 1e-9;
    SinusoidSteps steps(path);
    double t_s = begin_s;
    for (int i = 0; i < 3000; ++i) {
      // the length changes now and then, for a step or for many
      t_s += i % 1000 == 7 ? 13e-6 : i < 1500 ? 50e-6 : 33.3e-6;
      const Target exact = target_on(path, t_s);
      const Target stepped = steps.at(t_s);
      ASSERT_LT((stepped.position_m - exact.position_m).norm(), tolerance * 0.02);
      ASSERT_LT((stepped.velocity_m_per_s - exact.velocity_m_per_s).norm(), tolerance * 0.4);
    }
  }
}

TEST(RecordedPath, IsLinearBetweenSamplesAndHoldsItsEnds) {
  const RecordedPath path = recorded_path();

  expect_at(target_on(path, 0.0), {0, 0, 0}, {0, 0, 0});
  expect_at(target_on(path, 1.5), {0.005, 0, 0}, {0.01, 0, 0});
  expect_at(target_on(path, 2.0), {0.01, 0, 0}, {0, 0.02, 0});
  expect_at(target_on(path, 3.0), {0.01, 0.02, 0}, {0, 0.02, 0});
  expect_at(target_on(path, 9.0), {0.01, 0.04, 0}, {0, 0, 0});
}

// Span 3 s from t = 1: 7.5 s is 1 + (6.5 mod 3) = 1.5 s.
TEST(RecordedPath, ALoopBeginsAgain) {
  RecordedPath path = recorded_path();
  path.loops = true;

  expect_at(target_on(path, 7.5), {0.005, 0, 0}, {0.01, 0, 0});
}

TEST(RecordedPath, OneSampleIsHeld) {
  RecordedPath path;
  path.samples = {{3.0, Vector3(0.01, 0, 0)}};
  path.loops = true;

  expect_at(target_on(path, 0.0), {0.01, 0, 0}, {0, 0, 0});
  expect_at(target_on(path, 9.0), {0.01, 0, 0}, {0, 0, 0});
}

TEST(HostileHand, StaysInItsBallBelowItsSpeedAndUsesBoth) {
  const HostilePath path{.center_m = Vector3(0.1, 0, 0), .radius_m = 0.02, .v_max_m_per_s = 0.5};
  HostileHand hand(path, {}, 3);
  Vector3 previous = path.center_m;
  double farthest_m = 0.0;
  double fastest_m_per_s = 0.0;

  for (int i = 1; i <= 200'000; ++i) {
    // a force that grows, turns and vanishes
    const double t = 50e-6 * i;
    const Vector3 force(std::sin(7 * t), 2 * std::cos(11 * t), t > 5 ? 0.0 : 3.0);
    hand.feel(force);
    const Target target = hand.target(t);
    ASSERT_LT((target.position_m - previous - 50e-6 * target.velocity_m_per_s).norm(), 1e-12);
    farthest_m = std::max(farthest_m, (target.position_m - path.center_m).norm());
    fastest_m_per_s = std::max(fastest_m_per_s, target.velocity_m_per_s.norm());
    previous = target.position_m;
  }

  EXPECT_LE(farthest_m, 0.02 + 1e-12);
  EXPECT_GT(farthest_m, 0.019);
  EXPECT_LE(fastest_m_per_s, 0.5 + 1e-9);
  EXPECT_GT(fastest_m_per_s, 0.4);
}

/// Intended velocities of a hostile hand under a constant force, for one second.
std::vector<Vector3> hostile_velocities(const SimulatedDeviceConfig& device, const Vector3& force) {
  HostileHand hand({.radius_m = 100.0, .v_max_m_per_s = 0.5}, device, 3);
  hand.feel(force);
  std::vector<Vector3> velocities;
  for (int i = 1; i <= 20'000; ++i) {
    velocities.push_back(hand.target(50e-6 * i).velocity_m_per_s);
  }
  return velocities;
}

bool contains(const std::vector<Vector3>& all, const Vector3& wanted) {
  return std::any_of(all.begin(), all.end(),
                     [&](const Vector3& v) { return (v - wanted).norm() < 1e-9; });
}

// Eq. (12) on each axis: x: (0.3 − 0.1)/(2·0.5) = 0.2 m/s, y: −(0.5 − 0.1)/(2·1) = −0.2 m/s, z:
// 0.05 N are less than 0.2. 10 N on x and y: the cap, along the surplus (9.9, 9.9), 0.5/√2 m/s
// each.
TEST(HostileHand, DrainsEachAxisAgainstItsOwnFriction) {
  const SimulatedDeviceConfig device{
      .per_axis = FrictionPerAxis{Vector3(0.5, 1.0, 0.0), Vector3(0.1, 0.1, 0.2)}};

  EXPECT_TRUE(contains(hostile_velocities(device, Vector3(0.3, -0.5, 0.05)), {0.2, -0.2, 0.0}));
  const double v = 0.5 / std::sqrt(2.0);
  EXPECT_TRUE(contains(hostile_velocities(device, Vector3(10, 10, 0)), {v, v, 0.0}));
}

Vector3 hostile_position_after_5_s(std::uint64_t seed) {
  Hand hand({.path = HostilePath{}}, {}, seed);
  Target target;
  for (int i = 1; i <= 100'000; ++i) {
    const Vector3 force = -100.0 * target.position_m;
    target = hand.target(50e-6 * i, force);
  }
  return target.position_m;
}

TEST(HostileHand, IsTheSameToTheBitForASeedAndDiffersForAnother) {
  EXPECT_EQ(hostile_position_after_5_s(1), hostile_position_after_5_s(1));
  EXPECT_NE(hostile_position_after_5_s(1), hostile_position_after_5_s(2));
}

TEST(Hand, RestsOnItsPathsStart) {
  EXPECT_EQ(Hand({.path = HostilePath{.center_m = Vector3(1, 2, 3)}}, {}, 1).start_position_m(),
            Vector3(1, 2, 3));
  EXPECT_LT((Hand({.path = v_path()}, {}, 1).start_position_m() - Vector3(-0.03, 0, 0.02)).norm(),
            1e-15);
}

TEST(Hand, PressesAButtonFromItsStartToItsEnd) {
  const Hand hand({.presses = {{.button = 1, .from_s = 1.0, .until_s = 2.0},
                               {.button = 31, .from_s = 1.5, .until_s = 3.0}}},
                  {}, 1);

  EXPECT_EQ(hand.buttons(0.999), 0u);
  EXPECT_EQ(hand.buttons(1.0), 2u);
  EXPECT_EQ(hand.buttons(1.7), 0x80000002u);
  EXPECT_EQ(hand.buttons(2.0), 0x80000000u);
  EXPECT_EQ(hand.buttons(3.0), 0u);
}

// A dead-man button that is not on the handle.
TEST(Hand, WhoStandsBesideTheDevicePressesItsButtonsAndDoesNotHoldIt) {
  const HandConfig let_go = beside({.presses = {{.button = 1, .from_s = 1.0, .until_s = 2.0}}});
  EXPECT_EQ(let_go.mass_kg, 0.0);
  EXPECT_EQ(let_go.stiffness_newton_per_m, 0.0);
  EXPECT_EQ(let_go.damping_newton_s_per_m, 0.0);
  EXPECT_EQ(Hand(let_go, {}, 1).buttons(1.5), 2u);
}

}  // namespace
}  // namespace palpate::device
