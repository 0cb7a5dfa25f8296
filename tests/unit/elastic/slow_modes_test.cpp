// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/condensed/slow_modes.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <numeric>
#include <vector>

#include "physics_node/elastic/condensed/condensed_contact.h"
#include "physics_node/elastic/dynamics.h"

namespace palpate::elastic {
namespace {

// A flap, 60 × 60 × 4 mm, held at one edge.
BodyDescription flap(double young_pa, int along) {
  const std::vector<double> planes_m = equal_planes(-0.03, 0.03, along);
  Mesh mesh = quadratic(box_mesh(planes_m, planes_m, equal_planes(-0.002, 0.002, 1)));
  std::vector<std::uint32_t> fixed =
      nodes_where(mesh, [](const Vector3d& node_m) { return node_m.x() < -0.0299; });
  return {.mesh = std::move(mesh),
          .materials = {{.young_modulus_pa = young_pa,
                         .mass_damping_per_s = 3.0,
                         .stiffness_damping_s = 1e-3}},
          .law = Law::kStableNeoHookean,
          .fixed_nodes = std::move(fixed)};
}

TEST(SlowModes, AreThoseOfADenseSolutionAndLeaveAPositiveCompliance) {
  const Body body(flap(15e3, 2));
  WarpedFactor factor(body, Precision::kDouble);
  const SlowModes modes = slow_modes_of(body, factor, 1e-3, 0.0, 6);
  ASSERT_EQ(modes.count(), 6);

  // K⁻¹, column by column
  const auto& nodes = body.pattern().nodes;
  const auto size = static_cast<Eigen::Index>(3 * nodes.size());
  Eigen::MatrixXd give(size, size);
  Eigen::VectorXd root_mass(size);
  Eigen::MatrixXd shapes(size, modes.count());
  VectorXd load = VectorXd::Zero(body.rest_m().size());
  VectorXd answer = load;
  for (Eigen::Index column = 0; column < size; ++column) {
    const auto of = [&](Eigen::Index row) {
      return 3 * Eigen::Index{nodes[static_cast<std::size_t>(row / 3)]} + row % 3;
    };
    load[of(column)] = 1.0;
    factor.solve(load.data(), answer.data());
    load[of(column)] = 0.0;
    for (Eigen::Index row = 0; row < size; ++row) give(row, column) = answer[of(row)];
    root_mass[column] = std::sqrt(body.mass_kg()[of(column) / 3]);
    shapes.row(column) = modes.shapes.row(of(column));
  }
  const Eigen::MatrixXd weighted = root_mass.asDiagonal() * give * root_mass.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> dense(weighted);
  for (Eigen::Index k = 0; k < modes.count(); ++k) {
    const double rate2 = 1.0 / dense.eigenvalues()[size - 1 - k];
    EXPECT_NEAR(modes.rates_per_s2[k], rate2, 1e-3 * rate2) << k;
    EXPECT_NEAR(modes.damping_per_s[k], 3.0 + 1e-3 * modes.rates_per_s2[k], 1e-6 * rate2);
  }
  const Eigen::MatrixXd mass = shapes.transpose() * root_mass.cwiseAbs2().asDiagonal() * shapes;
  EXPECT_LT((mass - Eigen::MatrixXd::Identity(6, 6)).norm(), 1e-8);
  const Eigen::MatrixXd slow =
      shapes * modes.rates_per_s2.cwiseInverse().asDiagonal() * shapes.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> rest(give - slow);
  EXPECT_GT(rest.eigenvalues().minCoeff(), -1e-9 * give.norm());
}

TEST(SlowModes, AStiffBodyHasNone) {
  const Body body(flap(15e9, 2));
  WarpedFactor factor(body, Precision::kDouble);
  EXPECT_EQ(slow_modes_of(body, factor, 0.01, 0.0, 6).count(), 0);
}

// One node of the flap of a few grams, bent by a newton, goes metres; a tip of 5 mm in it 13 mm.
TEST(SlowModes, AreLeftOutWhereTheMaterialGivesWayMore) {
  const Body body(flap(15e3, 2));
  WarpedFactor factor(body, Precision::kDouble);
  const Eigen::Index all = slow_modes_of(body, factor, 1e-3, 0.0, 6).count();
  const Eigen::Index bending = slow_modes_of(body, factor, 1e-3, 0.2 / (15e3 * 0.005), 6).count();
  EXPECT_GE(bending, 1);
  EXPECT_EQ(all, 6);
  EXPECT_EQ(slow_modes_of(body, factor, 1e-3, 1e3, 6).count(), 0);
}

TEST(SlowModes, MoveAsTheirEquationSaysInStepsOfAnyLength) {
  const Body body(flap(15e3, 2));
  WarpedFactor factor(body, Precision::kDouble);
  SlowModes modes = slow_modes_of(body, factor, 1e-3, 0.0, 2);
  ASSERT_EQ(modes.count(), 2);
  modes.damping_per_s[1] = 5.0 * std::sqrt(modes.rates_per_s2[1]);  // creeps back
  const std::vector<SurfacePoint> points = surface_points(body.mesh(), surface_of(body.mesh()), 1);
  const std::vector<std::size_t> chosen{points.size() - 1, 0};
  const std::vector<Vector3d> forces{{0.0, 1e-3, -2e-3}, {1e-4, 0.0, 1e-3}};
  const VectorXd zero = VectorXd::Zero(body.rest_m().size());
  const VectorXd v = 0.05 * modes.shapes.col(0) - 0.02 * modes.shapes.col(1);
  // without a force it would stay there and at that speed only by what the solution leaves
  ModalMotion motion(modes, points, chosen, body.rest_m(), body.rest_m(), v, zero, {});
  const Eigen::Vector2d kept = modes.damping_per_s.cwiseProduct(Eigen::Vector2d(0.05, -0.02));
  Eigen::Vector2d push = kept;
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    for (Eigen::Index k = 0; k < 2; ++k) {
      const VectorXd shape = modes.shapes.col(k);
      push[k] += points[chosen[i]].position_m(shape.data()).dot(forces[i]);
    }
  }
  Eigen::Vector2d q = Eigen::Vector2d::Zero();
  Eigen::Vector2d rate(0.05, -0.02);
  constexpr double kFine_s = 1e-7;
  for (const double step_s : {1e-3, 5e-3, 2e-2}) {
    motion.set_step(step_s);
    motion.move(forces);
    for (int i = 0; i < static_cast<int>(std::lround(step_s / kFine_s)); ++i) {
      // midpoint rule
      const auto pull = [&](const Eigen::Vector2d& at, const Eigen::Vector2d& speed) {
        return Eigen::Vector2d(push - modes.damping_per_s.cwiseProduct(speed) -
                               modes.rates_per_s2.cwiseProduct(at));
      };
      const Eigen::Vector2d mid_rate = rate + 0.5 * kFine_s * pull(q, rate);
      const Eigen::Vector2d mid = q + 0.5 * kFine_s * rate;
      rate += kFine_s * pull(mid, mid_rate);
      q += kFine_s * mid_rate;
    }
    for (Eigen::Index k = 0; k < 2; ++k) {
      EXPECT_NEAR(motion.amount()[k], q[k], 1e-5 * q.norm()) << step_s;
    }
  }
  motion.set_step(0.0);
  motion.move(forces);
  for (Eigen::Index k = 0; k < 2; ++k) {
    EXPECT_NEAR(motion.amount()[k], push[k] / modes.rates_per_s2[k], 1e-12);
  }
}

// The force on a sphere that comes at 100 mm/s, against full solutions every 0.25 ms.
TEST(SlowModes, HoldASphereByTheInertiaOfAFlap) {
  const Body body(flap(15e3, 5));
  constexpr double kRadius_m = 0.006;
  const auto faces = surface_of(body.mesh());
  const std::vector<SurfacePoint> points = surface_points(body.mesh(), faces, 3);
  const auto centre_m = [](double time_s) {
    return Vector3d(0.012, 0.002, 0.002 + kRadius_m - 0.1 * time_s);
  };
  WarpedFactor modes_factor(body, Precision::kDouble);
  const SlowModes modes = slow_modes_of(body, modes_factor, 0.01, 0.0, 16);
  ASSERT_EQ(modes.count(), 16);
  WarpedFactor factor(body, Precision::kDouble);
  std::vector<std::uint32_t> nodes(body.node_count());
  std::iota(nodes.begin(), nodes.end(), 0U);
  SurfaceCompliance compliance(body, factor, nodes);
  constexpr double kStiffness = 100.0 * 15e3 / kRadius_m;
  CondensedContact still(compliance, 0.0, kStiffness);
  still.prepare(points, body.rest_m(), {}, centre_m(0.0), 64);
  CondensedContact swinging = still;
  const VectorXd zero = VectorXd::Zero(body.rest_m().size());
  swinging.swing(modes, points, body.rest_m(), body.rest_m(), zero, zero);
  still.relax(points, zero, 1e-3);
  swinging.relax(points, zero, 1e-3);

  Dynamics dynamics(body, {.theta = 1.0});
  SphereContact contact(points, kStiffness);
  double all = 0.0;
  double error = 0.0;
  double error_still = 0.0;
  constexpr int kParts = 4;
  for (int tick = 1; tick <= 25; ++tick) {
    for (int part = 1; part <= kParts; ++part) {
      const double time_s = 1e-3 * (tick - 1 + static_cast<double>(part) / kParts);
      contact.set_sphere(centre_m(time_s), kRadius_m);
      contact.choose_near(dynamics.x_m().data(), kRadius_m);
      dynamics.step(1e-3 / kParts, &contact);
      contact.update_multipliers(dynamics.x_m().data(), body.pattern());
    }
    const Vector3d full = contact.force_on_sphere_newton();
    const auto of = [&](CondensedContact& condensed) {
      return condensed.step(centre_m(1e-3 * tick), kRadius_m, 40, 1e-7, 1e-3)
          .force_on_sphere_newton;
    };
    all += full.squaredNorm();
    error += (of(swinging) - full).squaredNorm();
    error_still += (of(still) - full).squaredNorm();
  }
  EXPECT_GT(std::sqrt(error_still / all), 0.8);  // 0.3 mN where there are 15
  // from one state for 25 ms: what faster modes hold in the first touch is missing
  EXPECT_LT(std::sqrt(error / all), 0.6);
}

}  // namespace
}  // namespace palpate::elastic
