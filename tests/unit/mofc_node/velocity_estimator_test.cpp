// SPDX-License-Identifier: Apache-2.0
// The properties of each velocity estimator: bias, lag, noise, rest, gaps.
#include "mofc_node/velocity_estimator.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <string>

#include "common/core/random.h"
#include "tests/support/alloc_guard.h"

namespace palpate::mofc {
namespace {

using namespace std::chrono_literals;

constexpr double kPeriod_s = 1e-3;
constexpr double kResolution_m = 55e-6;
const Vector3 kNoForce = Vector3::Zero();

TimePoint tick(int k) { return TimePoint(k * 1ms); }

double quantised(double x_m) { return kResolution_m * std::round(x_m / kResolution_m); }

struct Kind {
  const char* name;
  VelocityEstimatorConfig config;
};
const Kind kKinds[] = {
    {"Difference", DifferenceVelocity{}},
    {"LowPass", DifferenceVelocity{.time_constant = 5ms}},
    {"EndFit", AdaptiveWindowVelocity{.max_window = 20ms, .is_best_fit = false}},
    {"BestFit", AdaptiveWindowVelocity{.max_window = 20ms}},
    {"BestFitLowPass", AdaptiveWindowVelocity{.max_window = 20ms, .time_constant = 2ms}},
    {"KalmanVelocity",
     KalmanVelocity{.model = KalmanVelocity::Model::kConstantVelocity, .noise_density = 0.01}},
    {"KalmanAcceleration", KalmanVelocity{}},
};

class EveryEstimator : public testing::TestWithParam<Kind> {
 protected:
  /// A filter knows a reading as ±q/2 and forgets slowly; the others are exact here.
  [[nodiscard]] static double tolerance(double of_filter) {
    return std::holds_alternative<KalmanVelocity>(GetParam().config) ? of_filter : 1e-9;
  }

  std::unique_ptr<VelocityEstimator> made_ =
      make_velocity_estimator(GetParam().config, kResolution_m, 1.0);
};
INSTANTIATE_TEST_SUITE_P(Kinds, EveryEstimator, testing::ValuesIn(kKinds),
                         [](const auto& kind) { return std::string(kind.param.name); });

TEST_P(EveryEstimator, IsExactOnAUniformMotionForAnyStamps) {
  made_ = make_velocity_estimator(GetParam().config, 0.0, 1.0);
  Random random(1);
  const Vector3 velocity(0.08, -0.02, 0.001);
  double t_s = 0.0;
  Vector3 estimate;
  for (int k = 0; k < 2000; ++k) {
    t_s += random.uniform(0.2, 1.8) * kPeriod_s;
    const TimePoint t = time_at(t_s);
    estimate = made_->update(velocity * seconds_of(t), t, kNoForce);
  }
  EXPECT_LT((estimate - velocity).norm(), tolerance(1e-5));
}

// q = 0.055 mm: the readings of a device without joints, and of one whose counts are not those of
// the axes
TEST_P(EveryEstimator, KeepsItsPositionWithinTheCount) {
  for (const double unit_m : {kResolution_m, 0.3 * kResolution_m}) {
    made_->reset();
    for (int k = 0; k < 1000; ++k) {
      const double x_m = unit_m * std::round(0.01 * std::sin(0.01 * k) / unit_m);
      made_->update({x_m, 0, 0}, tick(k), {k % 7 < 3 ? 2.0 : -2.0, 0, 0});
      EXPECT_LE(std::abs(made_->position_m({x_m, 0, 0}).x() - x_m), 0.5 * kResolution_m + 1e-12);
    }
  }
}

TEST_P(EveryEstimator, ReturnsZeroForTheFirstSampleAlsoAfterReset) {
  const Vector3 away(0.1, 0.2, 0.3);
  EXPECT_EQ(made_->update(away, tick(0), kNoForce), Vector3::Zero());
  for (int k = 1; k < 50; ++k) made_->update(away * (1.0 + 0.01 * k), tick(k), kNoForce);
  made_->reset();
  EXPECT_EQ(made_->update(away, tick(50), kNoForce), Vector3::Zero());
  EXPECT_EQ(made_->update(away, tick(51), kNoForce), Vector3::Zero()) << "nothing has moved since";
}

TEST_P(EveryEstimator, KeepsItsEstimateWithoutALaterSample) {
  Vector3 estimate;
  for (int k = 0; k < 100; ++k) {
    estimate = made_->update({0, 0, 1e-4 * k}, tick(k), kNoForce);
  }
  EXPECT_EQ(made_->update({1, 1, 1}, tick(99), kNoForce), estimate);
  EXPECT_EQ(made_->update({1, 1, 1}, tick(50), kNoForce), estimate);
  // and those samples leave no trace: 0.1 mm per ms
  EXPECT_NEAR(made_->update({0, 0, 1e-4 * 100}, tick(100), kNoForce).z(), 0.1, 2e-3);
}

// 3 mm in a pause of 0.3 s: 10 mm/s on average
TEST_P(EveryEstimator, ContinuesAfterAGap) {
  for (int k = 0; k < 100; ++k) made_->update(Vector3::Zero(), tick(k), kNoForce);
  Vector3 estimate = made_->update({0.003, 0, 0}, tick(399), kNoForce);
  if (std::holds_alternative<KalmanVelocity>(GetParam().config)) {
    EXPECT_TRUE(estimate.allFinite());
  } else {
    EXPECT_LT((estimate - Vector3(0.01, 0, 0)).norm(), 1e-9);
  }
  for (int k = 400; k < 700; ++k) {
    estimate = made_->update({0.003 + 1e-5 * (k - 399), 0, 0}, tick(k), kNoForce);
  }
  EXPECT_NEAR(estimate.x(), 0.01, tolerance(2e-4));
}

// Hours: nothing that was known counts any more.
TEST_P(EveryEstimator, ContinuesAfterHours) {
  for (int k = 0; k < 100; ++k) made_->update(Vector3::Zero(), tick(k), kNoForce);
  Vector3 estimate;
  for (int k = 0; k < 2000; ++k) {
    estimate = made_->update({0.003 + 1e-5 * k, 0, 0}, tick(k) + 10h, kNoForce);
  }
  EXPECT_NEAR(estimate.x(), 0.01, tolerance(2e-4));
}

// Everything has decayed or left the window after a second.
TEST_P(EveryEstimator, FallsToZeroForARestingHand) {
  for (int k = 0; k < 100; ++k) made_->update({quantised(8e-5 * k), 0, 0}, tick(k), kNoForce);
  Vector3 estimate;
  for (int k = 100; k < 1100; ++k) estimate = made_->update({0.008, 0, 0}, tick(k), kNoForce);
  EXPECT_LT(estimate.norm(), tolerance(1e-4)) << "a count in a second is 0.055 mm/s";
}

TEST_P(EveryEstimator, UpdatesWithoutAllocating) {
  const test::AllocGuard guard;
  for (int k = 0; k < 500; ++k) {
    made_->update({1e-3 * std::sin(0.01 * k), 0, 0}, tick(k), kNoForce);
    if (k == 300) made_->reset();
  }
  EXPECT_EQ(guard.count(), 0u);
}

/// Estimate minus truth after 1 s of x = ½ a t², along x.
double error_under_acceleration(VelocityEstimator& estimator, double a_m_per_s2) {
  double error = 0.0;
  for (int k = 0; k <= 1000; ++k) {
    const double t_s = kPeriod_s * k;
    error = estimator.update({0.5 * a_m_per_s2 * t_s * t_s, 0, 0}, tick(k), kNoForce).x() -
            a_m_per_s2 * t_s;
  }
  return error;
}
constexpr double kAcceleration_m_per_s2 = 0.5;

// the mean velocity of one period is that of its middle: T/2
TEST(DifferenceEstimator, LagsHalfAPeriod) {
  DifferenceEstimator estimator(0ms);
  EXPECT_NEAR(error_under_acceleration(estimator, kAcceleration_m_per_s2),
              -kAcceleration_m_per_s2 * 0.5e-3, 1e-9);
}

// v ← v + g (u − v) on a ramp of u settles T (1 − g)/g behind it; g = 1 − exp(−T/τ), T/τ = 1/5
TEST(DifferenceEstimator, AlsoLagsByItsTimeConstant) {
  DifferenceEstimator estimator(5ms);
  const double g = 1.0 - std::exp(-0.2);
  const double lag_s = 0.5e-3 + kPeriod_s * (1.0 - g) / g;
  EXPECT_NEAR(error_under_acceleration(estimator, kAcceleration_m_per_s2),
              -kAcceleration_m_per_s2 * lag_s, 1e-9);
  EXPECT_NEAR(lag_s, 5e-3, 0.1e-3);
}

// 0.055 mm in 1 ms
TEST(DifferenceEstimator, MakesOneCount55MillimetresPerSecond) {
  DifferenceEstimator estimator(0ms);
  estimator.update(Vector3::Zero(), tick(0), kNoForce);
  EXPECT_NEAR(estimator.update({kResolution_m, 0, 0}, tick(1), kNoForce).x(), 0.055, 1e-12);
  EXPECT_EQ(estimator.update({kResolution_m, 0, 0}, tick(2), kNoForce).x(), 0.0);
}

// A resolution of 1 m lets every line pass: the window is full. The slope of a parabola between two
// ends, and its best fit, is that of the middle: W/2 = 10 ms.
TEST(AdaptiveWindowEstimator, LagsHalfItsWindow) {
  for (const bool is_best_fit : {false, true}) {
    AdaptiveWindowEstimator estimator({.max_window = 20ms, .is_best_fit = is_best_fit}, 1.0);
    EXPECT_NEAR(error_under_acceleration(estimator, kAcceleration_m_per_s2),
                -kAcceleration_m_per_s2 * 10e-3, 1e-9);
    EXPECT_NEAR(estimator.window_s().x(), 0.02, 1e-12);
  }
}

TEST(AdaptiveWindowEstimator, IsTheBackwardDifferenceOfExactPositionsThatBend) {
  AdaptiveWindowEstimator estimator({.max_window = 20ms}, 0.0);
  EXPECT_NEAR(error_under_acceleration(estimator, kAcceleration_m_per_s2),
              -kAcceleration_m_per_s2 * 0.5e-3, 1e-9);
}

// every sample of a line is within q/2 of it, so the line between two is within q of all
TEST(AdaptiveWindowEstimator, FillsItsWindowOnAUniformQuantisedMotion) {
  for (const double speed_m_per_s : {0.0, 0.0013, 0.0171, 0.08, 0.3}) {
    AdaptiveWindowEstimator estimator({.max_window = 20ms, .is_best_fit = false}, kResolution_m);
    for (int k = 0; k < 200; ++k) {
      const double x_m = quantised(speed_m_per_s * kPeriod_s * k);
      const double v = estimator.update({x_m, 0, 0}, tick(k), kNoForce).x();
      if (k < 20) continue;
      EXPECT_NEAR(estimator.window_s().x(), 0.02, 1e-12) << speed_m_per_s << " tick " << k;
      EXPECT_LE(std::abs(v - speed_m_per_s), kResolution_m / 0.02 * (1.0 + 1e-9));
    }
  }
}

// 80 mm/s, then back: 1 ms after the turn no line with a sample before it holds
TEST(AdaptiveWindowEstimator, DropsSamplesFromBeforeATurn) {
  AdaptiveWindowEstimator estimator({.max_window = 20ms, .is_best_fit = false}, kResolution_m);
  const auto position = [](int k) { return quantised(8e-5 * (k <= 100 ? k : 200 - k)); };
  for (int k = 0; k <= 103; ++k) estimator.update({position(k), 0, 0}, tick(k), kNoForce);
  // 0.24 mm back from the turn: q off it per 0.69 ms, so the window reaches over it by 1 ms at most
  EXPECT_LE(estimator.window_s().x(), 4e-3 + 1e-12);
  EXPECT_NEAR(estimator.update({position(104), 0, 0}, tick(104), kNoForce).x(), -0.08, 0.03);
}

TEST(AdaptiveWindowEstimator, HasAWindowForEachAxis) {
  AdaptiveWindowEstimator estimator({.max_window = 20ms}, kResolution_m);
  for (int k = 0; k <= 100; ++k) {
    const double bent_m = quantised(0.5 * 20.0 * std::pow(kPeriod_s * k, 2));
    estimator.update({bent_m, 0, quantised(2e-5 * k)}, tick(k), kNoForce);
  }
  EXPECT_LT(estimator.window_s().x(), 0.015);
  EXPECT_NEAR(estimator.window_s().z(), 0.02, 1e-12);
}

/// rms error of velocity and position over a motion measured at 1 kHz with 0.055 mm.
struct Errors {
  double velocity_m_per_s = 0.0;
  double position_m = 0.0;
};
Errors errors_on(VelocityEstimator& estimator, const std::function<double(double)>& position_m) {
  Errors sum;
  constexpr int kFirst = 500;
  constexpr int kTicks = 5000;
  for (int k = 0; k < kTicks; ++k) {
    const double t_s = kPeriod_s * k;
    const double x_m = position_m(t_s);
    const double v = (position_m(t_s + 1e-6) - position_m(t_s - 1e-6)) / 2e-6;
    const double error = estimator.update({quantised(x_m), 0, 0}, tick(k), kNoForce).x() - v;
    if (k < kFirst) continue;
    sum.velocity_m_per_s += error * error / (kTicks - kFirst);
    sum.position_m +=
        std::pow(estimator.position_m({quantised(x_m), 0, 0}).x() - x_m, 2) / (kTicks - kFirst);
  }
  return {std::sqrt(sum.velocity_m_per_s), std::sqrt(sum.position_m)};
}

// A count takes q/v: 28 ms at 2 mm/s. A reading alone is off by q/√12 = 16 µm rms, and the mean
// velocity of 28 ms by q/28 ms = 2 mm/s; the time of a crossing is known within 1 ms: 2 µm.
TEST(KalmanEstimator, TakesTheCrossingOfACountForWhatItTells) {
  KalmanEstimator estimator(KalmanVelocity{}, kResolution_m, 1.0, 0.0);
  const Errors slow = errors_on(estimator, [](double t_s) { return 2e-3 * t_s; });
  EXPECT_LT(slow.velocity_m_per_s, 1.2e-3);
  EXPECT_LT(slow.position_m, 10e-6);
}

// 10 mm to and fro at 1 Hz: 63 mm/s, 0.4 m/s². The backward difference is off by up to 55 mm/s.
TEST(KalmanEstimator, FollowsAHandToAndFro) {
  KalmanEstimator estimator(KalmanVelocity{}, kResolution_m, 1.0, 0.0);
  const Errors errors = errors_on(
      estimator, [](double t_s) { return 0.01 * std::sin(2.0 * std::numbers::pi * t_s); });
  EXPECT_LT(errors.velocity_m_per_s, 1.4e-3);
  EXPECT_LT(errors.position_m, 10e-6);
}

// At rest for a minute in one count, near its edge, then 20 mm/s: a filter that took each of the
// 60 000 equal readings for news would have to unlearn them.
TEST(KalmanEstimator, LearnsNothingFromTheSameCountAgain) {
  KalmanEstimator estimator(KalmanVelocity{}, kResolution_m, 1.0, 0.0);
  Vector3 estimate;
  const double start_m = 0.49 * kResolution_m;
  for (int k = 0; k < 60'100; ++k) {
    const double x_m = start_m + 20e-6 * std::max(0, k - 60'000);
    estimate = estimator.update({quantised(x_m), 0, 0}, tick(k), kNoForce);
  }
  EXPECT_NEAR(estimate.x(), 0.02, 2e-3);
}

// 15 mm/s to 0 within a tick, by nothing that the model knows: less than half is left after 50 ms
TEST(KalmanEstimator, ForgetsItsModelWhenTheHandHitsSomething) {
  KalmanEstimator estimator(KalmanVelocity{}, kResolution_m, 1.0, 0.0);
  Vector3 estimate;
  for (int k = 0; k < 1050; ++k) {
    estimate = estimator.update({quantised(15e-6 * std::min(k, 1000)), 0, 0}, tick(k), kNoForce);
  }
  EXPECT_LT(std::abs(estimate.x()), 7e-3);
}

/// Worst error on a free mass of 0.3 kg that motors push to and fro with 1 N, 5 ms each way.
double worst_error_of_driven_mass(const KalmanVelocity& config, double scale_ratio) {
  const auto estimator = make_velocity_estimator(config, kResolution_m, scale_ratio);
  constexpr double kMass_kg = 0.3;
  double hand_m = 0.0;
  double hand_m_per_s = 0.0;
  double force = 0.0;
  double worst = 0.0;
  for (int k = 0; k < 1000; ++k) {
    const double v = estimator->update({scale_ratio * hand_m, 0, 0}, tick(k), {force, 0, 0}).x();
    if (k > 500) worst = std::max(worst, std::abs(v - scale_ratio * hand_m_per_s));
    force = k / 5 % 2 == 0 ? 1.0 : -1.0;
    hand_m += kPeriod_s * hand_m_per_s + 0.5 * kPeriod_s * kPeriod_s * force / kMass_kg;
    hand_m_per_s += kPeriod_s * force / kMass_kg;
  }
  return worst;
}

// 1 N on 0.3 kg for 5 ms changes the velocity by 17 mm/s: with the known force the estimate follows
// at once
TEST(KalmanEstimator, FollowsTheMotorsWithoutLagIfItKnowsTheMass) {
  // a free mass: no hand holds it
  KalmanVelocity config{.noise_density = 10.0,
                        .moving_mass_kg = 0.3,
                        .hand_stiffness_newton_per_m = 0.0,
                        .hand_damping_newton_s_per_m = 0.0};
  EXPECT_LT(worst_error_of_driven_mass(config, 1.0), 2e-3);
  EXPECT_LT(worst_error_of_driven_mass(config, 2.5), 5e-3) << "a tool that moves 2.5 times as far";
  config.moving_mass_kg = 0.0;
  EXPECT_GT(worst_error_of_driven_mass(config, 1.0), 5e-3);
}

}  // namespace
}  // namespace palpate::mofc
