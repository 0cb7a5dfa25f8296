// SPDX-License-Identifier: Apache-2.0
// The stated bounds of adaptive windowing, over seeded random smooth motions measured with an
// encoder. PALPATE_SEEDS=10 in the environment tries ten times as many seeds.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "common/core/random.h"
#include "mofc_node/velocity_estimator.h"
#include "tests/property/seeds.h"

namespace palpate::mofc {
namespace {

using namespace std::chrono_literals;

constexpr double kResolution_m = 55e-6;

/// Three sines per axis, slow ones large: |acceleration| of each axis has a known bound.
class SmoothMotion {
 public:
  explicit SmoothMotion(Random& random) {
    for (auto& axis : terms_) {
      for (Term& term : axis) {
        const double frequency_hz = 0.2 * std::pow(50.0, random.uniform());
        term.rate = 2.0 * std::numbers::pi * frequency_hz;
        term.amplitude_m = random.uniform(0.0, 0.02) / (1.0 + frequency_hz * frequency_hz);
        term.phase = random.uniform(0.0, 2.0 * std::numbers::pi);
      }
    }
  }
  [[nodiscard]] Vector3 measured_m(double t_s) const {
    const auto x = sum([&](const Term& s) { return s.amplitude_m * std::sin(s.at(t_s)); });
    return kResolution_m * (x / kResolution_m).array().round().matrix();
  }
  [[nodiscard]] Vector3 velocity_m_per_s(double t_s) const {
    return sum([&](const Term& s) { return s.amplitude_m * s.rate * std::cos(s.at(t_s)); });
  }
  [[nodiscard]] Vector3 most_acceleration_m_per_s2() const {
    return sum([](const Term& s) { return s.amplitude_m * s.rate * s.rate; });
  }

 private:
  struct Term {
    double amplitude_m = 0.0;
    double rate = 0.0;
    double phase = 0.0;
    [[nodiscard]] double at(double t_s) const { return rate * t_s + phase; }
  };
  template <class Part>
  [[nodiscard]] Vector3 sum(const Part& part) const {
    Vector3 total = Vector3::Zero();
    for (int axis = 0; axis < 3; ++axis) {
      for (const Term& term : terms_[static_cast<std::size_t>(axis)]) total[axis] += part(term);
    }
    return total;
  }
  std::array<std::array<Term, 3>, 3> terms_;
};

/// Largest share of the bound c_q q/W + c_a A W that an error reached, over all runs.
double worst_share(bool is_best_fit, double c_q, double c_a, double jitter) {
  double worst = 0.0;
  for (const std::uint64_t seed : test::seeds(100)) {
    Random random(seed);
    const SmoothMotion motion(random);
    const Vector3 a = motion.most_acceleration_m_per_s2();
    const double period_s = random.chance(0.5) ? 1e-3 : 0.25e-3;
    AdaptiveWindowEstimator estimator(
        {.max_window = from_seconds(random.uniform(0.003, 0.04)), .is_best_fit = is_best_fit},
        kResolution_m);
    double t_s = 0.0;
    for (int k = 0; k < 2000; ++k) {
      t_s += period_s * random.uniform(1.0 - jitter, 1.0 + jitter);
      const TimePoint t = time_at(t_s);
      const double at_s = seconds_of(t);
      const Vector3 error = estimator.update(motion.measured_m(at_s), t, Vector3::Zero()) -
                            motion.velocity_m_per_s(at_s);
      if (k == 0) continue;
      for (int axis = 0; axis < 3; ++axis) {
        const double window_s = estimator.window_s()[axis];
        const double bound = c_q * kResolution_m / window_s + c_a * a[axis] * window_s;
        worst = std::max(worst, std::abs(error[axis]) / bound);
      }
    }
  }
  return worst;
}

TEST(AdaptiveWindowProperty, TheEndFitStaysWithinItsBoundForAnyStamps) {
  const double worst = worst_share(false, 1.0, 0.5, 0.9);
  EXPECT_LE(worst, 1.0 + 1e-6);
  EXPECT_GT(worst, 0.7) << "a bound that is never nearly reached says little";
}

TEST(AdaptiveWindowProperty, TheBestFitStaysWithinItsBoundOnRegularStamps) {
  const double worst = worst_share(true, 1.5, 0.57, 0.0);
  EXPECT_LE(worst, 1.0 + 1e-6);
  EXPECT_GT(worst, 0.5);
}

}  // namespace
}  // namespace palpate::mofc
