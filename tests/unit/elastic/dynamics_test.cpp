// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/dynamics.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <limits>

#include "tests/bench/elastic/elastic_problems.h"
#include "tests/property/seeds.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/machine/machine.h"
#include "tests/unit/elastic/random_shape.h"

namespace palpate::elastic {
namespace {

TEST(ElasticDynamics, NeverGainsEnergyAndKeepsAlmostAllOfIt) {
  for (const Law law : kAllLaws) {
    const Body body(bench::hanging_beam(beam_mesh(8, 2), law, 100e3, 0.45));
    for (const double dt_s : {1e-3, 5e-3, 20e-3}) {
      Dynamics dynamics(body, {.tolerance_m = 1e-8});
      double least = std::numeric_limits<double>::infinity();
      double first = 0.0;
      double most_kinetic = 0.0;
      const int steps = static_cast<int>((test::kIsSanitized ? 0.06 : 0.2) / dt_s);
      for (int i = 0; i < steps; ++i) {
        const StepReport report = dynamics.step(dt_s);
        ASSERT_TRUE(report.search.is_finite);
        if (i == 0) first = report.energy_joule();
        ASSERT_LE(report.energy_joule(), least + 1e-9 * std::abs(first));
        least = report.energy_joule();
        most_kinetic = std::max(most_kinetic, report.kinetic_joule);
      }
      if (dt_s > 2e-3) continue;
      EXPECT_GT(least, first - 0.05 * most_kinetic);
    }
  }
}

/// Of no force; from its second factor on it leaves no positive definite stiffness.
class UnfactorableObstacle final : public Obstacle {
 public:
  double add_gradient(const double* /*x_m*/, double* /*gradient*/) const override { return 0.0; }
  void add_stiffness(const double* /*x_m*/, const BlockPattern& pattern,
                     BlockValues& values) const override {
    if (factors_++ < 1) return;
    for (std::uint32_t row = 0; row < pattern.size(); ++row) {
      values[9 * std::size_t{pattern.slot(row, row)}] -= 1e12;
    }
  }
  [[nodiscard]] int factors() const { return factors_; }

 private:
  mutable int factors_ = 0;
};

TEST(ElasticDynamics, AFactorThatCannotBeRenewedEndsTheSearch) {
  const Body body(bench::hanging_beam(beam_mesh(8, 2), kAllLaws[0], 100e3, 0.45));
  const UnfactorableObstacle obstacle;
  EquilibriumSearch search(body);
  WarpedFactor factor(body, Precision::kFloat);
  VectorXd x = body.rest_m();
  // every iteration is slow
  const SearchReport report = find_rest(search, factor, &obstacle, {.slow_ratio = 0.0}, x);
  EXPECT_GT(obstacle.factors(), 1);
  EXPECT_FALSE(factor.is_ready());
  EXPECT_FALSE(report.is_converged);
  EXPECT_TRUE(report.is_finite);
  EXPECT_TRUE(x.allFinite());
}

TEST(ElasticDynamics, StaysFiniteAndComesToTheStaticAnswer) {
  for (const Law law : kAllLaws) {
    for (const double E : {1e3, 1e5, 1e7}) {
      if (test::kIsSanitized && E < 1e5) continue;
      BodyDescription beam = bench::hanging_beam(beam_mesh(8, 2), law, E, 0.45);
      const double damping = 2.0 * 26.0 * std::sqrt(E / 100e3);
      beam.materials[0].mass_damping_per_s = damping;
      const Body body(beam);
      EquilibriumSearch search(body);
      WarpedFactor factor(body, Precision::kDouble);
      VectorXd x = body.rest_m();
      ASSERT_TRUE(find_rest(search, factor, nullptr, {.most_iterations = 1000}, x).is_converged);
      Dynamics dynamics(body, {.theta = 1.0});
      const double end_s = std::max(24.0 / damping, 0.8);
      for (double t = 0.0; t < end_s; t += 20e-3) {
        ASSERT_TRUE(dynamics.step(20e-3).search.is_finite);
      }
      const Eigen::Index tip = bench::tip_of(body.mesh());
      const double way = x[tip] - body.rest_m()[tip];
      EXPECT_NEAR(dynamics.x_m()[tip] - body.rest_m()[tip], way, 0.01 * std::abs(way))
          << E << " Pa, law " << static_cast<int>(law);
    }
  }
}

TEST(ElasticDynamics, DampingTakesEnergyAndZeroDampingTakesNone) {
  const auto left_ratio = [](double alpha, double beta) {
    BodyDescription beam = bench::hanging_beam(beam_mesh(8, 2), Law::kCorotational, 100e3, 0.45);
    beam.gravity_m_per_s2.setZero();
    beam.materials[0].mass_damping_per_s = alpha;
    beam.materials[0].stiffness_damping_s = beta;
    const Body body(beam);
    VectorXd v = VectorXd::Zero(body.rest_m().size());
    for (Eigen::Index i = 0; i < v.size(); i += 3) v[i + 2] = 2.0 * body.rest_m()[i];
    Dynamics dynamics(body, {.theta = 0.5, .tolerance_m = 1e-9});
    dynamics.set_state(body.rest_m(), v);
    const double first = dynamics.step(1e-3).energy_joule();
    StepReport last;
    for (int i = 0; i < 100; ++i) last = dynamics.step(1e-3);
    return last.energy_joule() / first;
  };
  EXPECT_NEAR(left_ratio(0.0, 0.0), 1.0, 1e-3);
  // −α M v halves a velocity in ln 2 / (α / 2) while it swings: energy e^(−α t) on average
  EXPECT_NEAR(left_ratio(10.0, 0.0), std::exp(-1.0), 0.12);
  const double viscous = left_ratio(0.0, 1e-3);
  EXPECT_LT(viscous, 0.97);
  EXPECT_GT(viscous, 0.2);
}

TEST(ElasticDynamics, TheWarpedFactorNoticesWhenItIsNoLongerValid) {
  const Body body(bench::hanging_beam(beam_mesh(8, 2), Law::kStableNeoHookean, 20e3, 0.45));
  // one factor for ever, and few iterations: the report must say that it is not good
  Dynamics dynamics(body, {.theta = 1.0,
                           .tolerance_m = 1e-9,
                           .most_iterations = 3,
                           .is_exact = false,
                           .slow_ratio = 0.2});
  bool was_due = false;
  double worst_m = 0.0;
  for (int i = 0; i < 100; ++i) {
    const StepReport report = dynamics.step(10e-3);
    ASSERT_TRUE(report.search.is_finite);
    was_due = was_due || report.is_factor_due;
    if (!report.search.is_converged) worst_m = std::max(worst_m, report.search.remaining_m);
  }
  EXPECT_TRUE(was_due);
  EXPECT_GT(worst_m, 1e-9);

  // the other thread delivers
  const auto deadline = std::chrono::steady_clock::now() + test::patience(std::chrono::seconds(60));
  const auto before = dynamics.counters().factorisations;
  while (dynamics.counters().factorisations == before &&
         std::chrono::steady_clock::now() < deadline) {
    dynamics.step(5e-3);
  }
  EXPECT_GT(dynamics.counters().factorisations, before);
}

// A step of a quarter of the length converges over the factor that is there.
TEST(ElasticDynamics, AStepOfAnotherLengthKeepsTheFactorIfItMay) {
  const Body body(bench::hanging_beam(beam_mesh(8, 2), Law::kStableNeoHookean, 100e3, 0.45));
  const auto factors = [&](double other_step_ratio) {
    Dynamics dynamics(body, {.theta = 1.0,
                             .most_exact_iterations = 100,
                             .slow_ratio = 0.9,
                             .slow_iterations = 4,
                             .other_step_ratio = other_step_ratio});
    dynamics.step(2e-3);
    const auto before = dynamics.counters().factorisations;
    for (int i = 0; i < 3; ++i) EXPECT_TRUE(dynamics.step(5e-4).search.is_converged);
    return dynamics.counters().factorisations - before;
  };
  EXPECT_GT(factors(1.0), 0U);
  EXPECT_EQ(factors(4.0), 0U);
}

TEST(ElasticDynamics, AStepDoesNotAllocate) {
  const Body body(bench::hanging_beam(beam_mesh(8, 2), Law::kCorotational, 100e3, 0.45));
  Dynamics dynamics(body, {.is_exact = false});
  for (int i = 0; i < 5; ++i) dynamics.step(1e-3);
  const test::AllocGuard guard;
  for (int i = 0; i < 100; ++i) dynamics.step(1e-3);
  EXPECT_EQ(guard.count(), 0U);
}

TEST(ElasticDynamics, AnUntouchedBodyAtRestIsSkipped) {
  BodyDescription beam = bench::hanging_beam(beam_mesh(8, 2), Law::kCorotational, 100e3, 0.45);
  beam.gravity_m_per_s2.setZero();
  const Body body(beam);
  Dynamics dynamics(body, {});
  for (int i = 0; i < 60; ++i) dynamics.step(1e-3);
  EXPECT_TRUE(dynamics.is_asleep());
  const auto iterations = dynamics.counters().iterations;
  for (int i = 0; i < 100; ++i) dynamics.step(1e-3);
  EXPECT_GE(dynamics.counters().skipped, 100U);
  EXPECT_EQ(dynamics.counters().iterations, iterations);

  // a push wakes it
  dynamics.set_state(random_shape(body, 1e-4, 1), VectorXd::Zero(body.rest_m().size()));
  EXPECT_FALSE(dynamics.is_asleep());
  dynamics.step(1e-3);
  EXPECT_GT(dynamics.counters().iterations, iterations);
}

TEST(ElasticDynamics, StepControlDividesStepsUntilThePeriodIsRight) {
  const Body body(bench::hanging_beam(beam_mesh(8, 2), Law::kCorotational, 100e3, 0.45));
  const Eigen::Index tip = bench::tip_of(body.mesh());
  const auto track = [&](double dt_s, const DynamicsSettings& settings, int& substeps) {
    Dynamics dynamics(body, settings);
    for (double t = dt_s; t < 0.15 + 1e-9; t += dt_s) substeps = dynamics.step(dt_s).substeps;
    return dynamics.x_m()[tip];
  };
  int parts = 0;
  const double right_m = track(0.25e-3, {.theta = 0.5, .tolerance_m = 1e-9}, parts);
  EXPECT_EQ(parts, 1);
  const double plain_m = track(10e-3, {.theta = 0.5, .tolerance_m = 1e-8}, parts);
  EXPECT_EQ(parts, 1);
  const double divided_m =
      track(10e-3, {.theta = 0.5, .tolerance_m = 1e-8, .accuracy_m = 3e-7}, parts);
  EXPECT_GT(parts, 1);
  EXPECT_LT(std::abs(divided_m - right_m), 0.5 * std::abs(plain_m - right_m));
}

TEST(ElasticDynamics, ABodyThatRestsFoldedBeginsAgainAndEndsWhereItShould) {
  BodyDescription beam = bench::hanging_beam(beam_mesh(8, 2), Law::kStableNeoHookean, 100e3, 0.45);
  beam.materials[0].mass_damping_per_s = 52.0;  // critical
  const Body body(beam);
  Dynamics dynamics(body, {.theta = 1.0});
  VectorXd x = body.rest_m();
  for (Eigen::Index i = 0; i < x.size(); i += 3) x[i] = -x[i];
  dynamics.set_state(x, VectorXd::Zero(x.size()));
  EXPECT_TRUE(body.has_inverted_element(dynamics.x_m()));
  for (int i = 0; i < 300; ++i) ASSERT_TRUE(dynamics.step(10e-3).search.is_finite);

  EXPECT_EQ(dynamics.counters().untangled, 1U);
  EquilibriumSearch search(body);
  WarpedFactor factor(body, Precision::kDouble);
  VectorXd wanted = body.rest_m();
  ASSERT_TRUE(find_rest(search, factor, nullptr, {.tolerance_m = 1e-7}, wanted).is_converged);
  EXPECT_LT((dynamics.x_m() - wanted).cwiseAbs().maxCoeff(), 1e-5);
}

}  // namespace
}  // namespace palpate::elastic
