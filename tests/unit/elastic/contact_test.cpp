#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "physics_node/elastic/condensed_contact.h"
#include "physics_node/elastic/equilibrium.h"
#include "physics_node/elastic/sphere_contact.h"
#include "tests/bench/elastic/elastic_problems.h"
#include "tests/support/alloc_guard.h"

namespace palpate::elastic {
namespace {

constexpr double kRadius = 0.005;
Vector3d sphere_at(double depth_m) { return {0.05, 0.05, 0.05 + kRadius - depth_m}; }

std::vector<std::uint32_t> all_nodes(const Body& body) {
  return nodes_where(body.mesh(), [](const Vector3d&) { return true; });
}

TEST(ElasticContact, PointsStandForTheWholeAreaAndInterpolateLinearFunctions) {
  for (const bool is_quadratic : {false, true}) {
    const Mesh linear = beam_mesh(4, 2);
    const Mesh mesh = is_quadratic ? quadratic(linear) : linear;
    double area = 0.0;
    const VectorXd x = Body({.mesh = mesh, .fixed_nodes = {0}}).rest_m();
    for (const SurfacePoint& point : surface_points(mesh, surface_of(mesh), 3)) {
      area += point.area_m2;
      double sum = 0.0;
      for (const double weight : point.weights) sum += weight;
      EXPECT_NEAR(sum, 1.0, 1e-14);
      const Vector3d at = point.position_m(x.data());
      EXPECT_GE(at.minCoeff(), -1e-15);
    }
    EXPECT_NEAR(area, 4 * 0.1 * 0.025 + 2 * 0.025 * 0.025, 1e-12);
  }
}

// Hertz, F = 4/3 E/(1 − ν²) √R d^1.5, holds for d ≪ R in a large block: 37.4 mN at 1 mm.
TEST(ElasticContact, ASmallIndentationFollowsHertzAndThePointsOnlyPress) {
  const Body body(
      bench::standing_block(quadratic(block_mesh(4, 5, 1.6e-3)), Law::kStableNeoHookean));
  SphereContact contact(bench::top_points(body.mesh(), 0.006, 4), 4e7);
  EquilibriumSearch search(body);
  WarpedFactor factor(body, Precision::kDouble);
  VectorXd x = body.rest_m();
  contact.set_sphere(sphere_at(1e-3), kRadius);
  double deepest_m = 0.0;
  for (int round = 0; round < 4; ++round) {
    ASSERT_TRUE(find_rest(search, factor, &contact, {.tolerance_m = 1e-7}, x).is_converged);
    deepest_m = contact.update_multipliers(x.data());
  }
  const double hertz =
      4.0 / 3.0 * 10e3 / (1 - 0.45 * 0.45) * std::sqrt(kRadius) * std::pow(1e-3, 1.5);
  const Vector3d force = contact.force_on_sphere_newton(x.data());
  EXPECT_NEAR(force.z(), hertz, 0.06 * hertz);
  EXPECT_LT(std::hypot(force.x(), force.y()), 0.01 * hertz);
  EXPECT_LT(deepest_m, 3e-5);

  // away from the body it is felt no more: nothing pulls
  contact.set_sphere(sphere_at(-1e-3), kRadius);
  for (int round = 0; round < 2; ++round) {
    static_cast<void>(find_rest(search, factor, &contact, {.tolerance_m = 1e-7}, x));
    contact.update_multipliers(x.data());
  }
  EXPECT_EQ(contact.force_on_sphere_newton(x.data()).norm(), 0.0);
  EXPECT_LT((x - body.rest_m()).cwiseAbs().maxCoeff(), 1e-6);
}

class Condensed : public testing::Test {
 protected:
  Body body_{bench::standing_block(block_mesh(4, 5, 1.25e-3), Law::kCorotational)};
  std::vector<SurfacePoint> points_ = bench::top_points(body_.mesh(), 0.004, 2);
  WarpedFactor factor_{body_, Precision::kFloat};

  void SetUp() override {
    ASSERT_TRUE(factor_.factor(body_.rest_m(), no_rotations(body_.node_count()), {}, nullptr));
  }
};

TEST_F(Condensed, GivesTheForceOfTheFullSolution) {
  SurfaceCompliance compliance(body_, factor_, all_nodes(body_));
  CondensedContact condensed(compliance, 0.0);
  condensed.prepare(points_, body_.rest_m(), {}, sphere_at(0.0), 30);
  ASSERT_EQ(condensed.point_count(), 30);
  std::vector<SurfacePoint> same;
  for (const std::size_t i : condensed.chosen()) same.push_back(points_[i]);
  SphereContact contact(same, 4e7);
  EquilibriumSearch search(body_);
  WarpedFactor full(body_, Precision::kDouble);
  VectorXd x = body_.rest_m();
  // a linear model: its error grows with the depth
  for (const auto& [depth_m, error_ratio] : {std::pair{0.2e-3, 0.03}, {0.5e-3, 0.08}}) {
    contact.set_sphere(sphere_at(depth_m), kRadius);
    for (int round = 0; round < 6; ++round) {
      ASSERT_TRUE(find_rest(search, full, &contact, {.tolerance_m = 1e-8}, x).is_converged);
      contact.update_multipliers(x.data());
    }
    const CondensedReport report = condensed.step(sphere_at(depth_m), kRadius, 500, 1e-10);
    const double newton = contact.force_on_sphere_newton(x.data()).z();
    EXPECT_NEAR(report.force_on_sphere_newton.z(), newton, error_ratio * newton) << depth_m;
    EXPECT_GT(report.touching, 3);
    EXPECT_LT(report.deepest_m, 1e-7);
  }
  // the surface went where the full solution says, within the error of the linear model
  std::vector<float> moved(condensed.surface_size());
  condensed.move_surface(moved.data());
  double largest_m = 0.0;
  double error_m = 0.0;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double way = x[i] - body_.rest_m()[i];
    largest_m = std::max(largest_m, std::abs(way));
    error_m =
        std::max(error_m, std::abs(way - static_cast<double>(moved[static_cast<std::size_t>(i)])));
  }
  EXPECT_LT(error_m, 0.1 * largest_m);
}

TEST_F(Condensed, CondensesOnlyWhatIsTouchedAndOnlyOnce) {
  SurfaceCompliance compliance(body_, factor_, all_nodes(body_));
  CondensedContact condensed(compliance, 0.0);
  EXPECT_EQ(compliance.columns_made(), 0U);
  condensed.prepare(points_, body_.rest_m(), {}, sphere_at(0.0), 10);
  const std::size_t made = compliance.columns_made();
  EXPECT_GT(made, 0U);
  EXPECT_LT(made, 20U);
  condensed.prepare(points_, body_.rest_m(), {}, sphere_at(0.0), 10);
  EXPECT_EQ(compliance.columns_made(), made);
}

TEST_F(Condensed, FrictionStaysWithinTheConeAndHoldsWithoutSliding) {
  SurfaceCompliance compliance(body_, factor_, all_nodes(body_));
  const auto drag_newton = [&](double friction, double way_m) {
    CondensedContact condensed(compliance, friction);
    condensed.prepare(points_, body_.rest_m(), {}, sphere_at(0.0), 30);
    Vector3d centre = sphere_at(0.4e-3);
    condensed.step(centre, kRadius, 500, 1e-10);
    CondensedReport report;
    for (int i = 0; i < 20; ++i) {
      centre.x() += way_m / 20;
      report = condensed.step(centre, kRadius, 500, 1e-10);
    }
    return report.force_on_sphere_newton;
  };
  const Vector3d without = drag_newton(0.0, 0.2e-3);
  const Vector3d slight = drag_newton(0.2, 0.2e-3);
  const Vector3d strong = drag_newton(5.0, 0.02e-3);
  EXPECT_LT(slight.x(), without.x() - 0.05 * slight.z());  // resists the motion along +x
  // each point is within its cone, so the sum is within µ times the sum of normal forces
  EXPECT_LT(std::abs(slight.x() - without.x()), 0.25 * slight.z());
  EXPECT_LT(strong.x(), 0.0);
}

TEST_F(Condensed, AStepDoesNotAllocateAndNothingTouchedGivesNoForce) {
  SurfaceCompliance compliance(body_, factor_, all_nodes(body_));
  CondensedContact condensed(compliance, 0.3);
  condensed.prepare(points_, body_.rest_m(), {}, sphere_at(0.0), 30);
  std::vector<float> moved(condensed.surface_size());
  const test::AllocGuard guard;
  for (int i = 0; i < 50; ++i) {
    condensed.step(sphere_at(1e-5 * i), kRadius, 10, 1e-9);
    condensed.move_surface(moved.data());
  }
  const CondensedReport away = condensed.step(sphere_at(-5e-3), kRadius, 100, 1e-9);
  EXPECT_EQ(guard.count(), 0U);
  EXPECT_EQ(away.touching, 0);
  EXPECT_EQ(away.force_on_sphere_newton.norm(), 0.0);
}

}  // namespace
}  // namespace palpate::elastic
