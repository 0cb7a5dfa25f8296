// SPDX-License-Identifier: Apache-2.0
// The limits of real motors: peak, continuous force, lease.
#include "device_node/drivers/motor_force.h"

#include <gtest/gtest.h>

#include "common/core/random.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr MotorLimits kLimits{
    .peak_force_newton = 8.0, .continuous_force_newton = 2.0, .thermal_time_s = 10.0};

TEST(MotorForce, GivesThePeakWhileColdAndTheContinuousForceInTheEnd) {
  MotorForce motors(kLimits);
  TimePoint now{};
  EXPECT_EQ(motors.set({0, 9, 0}, 2ms, now), Vector3(0, 8, 0));

  double least_newton = 8.0;
  double previous_newton = 8.0;
  for (int i = 0; i < 60'000; ++i) {
    now += 1ms;
    const double newton = motors.set({0, 9, 0}, 2ms, now).norm();
    EXPECT_LE(newton, previous_newton + 1e-9);  // saturates, is not cut
    EXPECT_LE(motors.heat(), 1.0 + 1e-12);
    previous_newton = newton;
    least_newton = std::min(least_newton, newton);
  }

  EXPECT_NEAR(least_newton, 2.0, 1e-3);
}

// (F/Fc)² (1 − e^(−t/τ)) = 1: 16 times the heat of the continuous force lasts 0.645 s.
TEST(MotorForce, ThePeakLastsAsLongAsTheWindingsTakeIt) {
  MotorForce motors(kLimits);
  TimePoint now{};
  while (motors.set({8, 0, 0}, 1ms, now).x() == 8.0) now += 1ms;

  EXPECT_NEAR(seconds_of(now), -10.0 * std::log(1.0 - 1.0 / 16.0), 2e-3);
}

TEST(MotorForce, CoolsWhileItRests) {
  MotorForce motors(kLimits);
  TimePoint now{};
  while (motors.set({8, 0, 0}, 1ms, now).x() == 8.0) now += 1ms;
  motors.set({0, 0, 0}, 0ms, now);

  now += 60s;

  EXPECT_EQ(motors.set({8, 0, 0}, 1ms, now).x(), 8.0);
}

TEST(MotorForce, EndsWithItsLeaseAndHeatsNoLonger) {
  MotorForce motors(kLimits);
  motors.set({0, 0, 1}, 5ms, TimePoint{});

  EXPECT_EQ(motors.at(TimePoint(5ms - 1ns)), Vector3(0, 0, 1));
  EXPECT_EQ(motors.at(TimePoint(5ms)), Vector3(0, 0, 0));
  const double heat = motors.heat();
  EXPECT_NEAR(heat, 0.25 * -std::expm1(-0.005 / 10.0), 1e-12);
  motors.at(TimePoint(100ms));
  EXPECT_LT(motors.heat(), heat);
}

TEST(MotorForce, ALeaseOfNothingIsNoForce) {
  MotorForce motors(kLimits);
  EXPECT_EQ(motors.set({0, 0, 1}, 0ms, TimePoint{}), Vector3(0, 0, 0));
  EXPECT_EQ(motors.at(TimePoint{}), Vector3(0, 0, 0));
}

// At the limit every second rounding to the nearest would exceed it. Two roundings by half a count
// of each motor lose no more than one count of each.
TEST(RoundCounts, NeverMakesMoreForceThanTheLimitAndLosesLittle) {
  Random random(1);
  int scaled = 0;
  for (int i = 0; i < 2'000; ++i) {
    // independent enough that the counts are finite
    Matrix3 newton_per_count = 0.01 * Matrix3::Identity();
    for (Eigen::Index column = 0; column < 3; ++column) {
      newton_per_count.col(column) += 0.005 * random.uniform() * random.direction();
    }
    const Vector3 wanted_newton = 3.3 * random.direction();
    const Vector3 wanted = newton_per_count.inverse() * wanted_newton;
    Vector3 counts = wanted;

    const Vector3 made_newton = round_counts(counts, newton_per_count, 3.3);

    EXPECT_LE(made_newton.norm(), 3.3 + 1e-12);
    EXPECT_LE((made_newton - wanted_newton).norm(), newton_per_count.colwise().norm().sum());
    EXPECT_EQ(counts, Vector3(counts.array().round()));
    EXPECT_EQ(made_newton, newton_per_count * counts);
    if (counts != Vector3(wanted.array().round())) ++scaled;
  }
  EXPECT_GT(scaled, 500);
  EXPECT_LT(scaled, 1'500);
}

TEST(RoundCounts, WithinTheLimitTakesTheNearestAndWithoutForceNone) {
  Vector3 counts(1.4, -2.4, 0.2);
  EXPECT_EQ(round_counts(counts, Matrix3::Identity(), 10.0), Vector3(1, -2, 0));
  counts = {0.6, 0.0, 0.0};
  EXPECT_EQ(round_counts(counts, Matrix3::Identity(), 0.6), Vector3::Zero());
}

// A fallback of f_co needs no credit: one that is rounded up would.
TEST(RoundCounts, NeverMakesMoreForceThanItIsAsked) {
  Vector3 counts(1.6, 0.0, 0.0);
  EXPECT_EQ(round_counts(counts, Matrix3::Identity(), 10.0), Vector3::Zero());
  Random random(2);
  for (int i = 0; i < 2'000; ++i) {
    counts = random.uniform(0.0, 40.0) * random.direction();
    const double wanted_newton = counts.norm();
    EXPECT_LE(round_counts(counts, Matrix3::Identity(), 100.0).norm(), wanted_newton + 1e-9);
  }
}

}  // namespace
}  // namespace palpate::device
