// SPDX-License-Identifier: Apache-2.0
// Two elastic bodies that touch: closed forms, action and reaction, rest, motion.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "tests/property/seeds.h"
#include "tests/unit/elastic/touching/together.h"

namespace palpate::physics {
namespace {

constexpr double kTick_s = 1e-3;

class TwoBodies : public testing::Test {
 protected:
  test::TempFolder folder_;
};

// Two blocks one on the other between frictionless plates are in uniaxial stress:
// F = A δ/(H₁/E₁ + H₂/E₂). Their meshes do not match; soft springs keep them in place.
TEST_F(TwoBodies, TwoBlocksBetweenPlatesArePushedAsTwoSpringsInARow) {
  for (const double upper_pa : {10e3, 30e3}) {
    for (const bool is_linear : {true, false}) {
      ElasticMaterial lower{.young_pa = 10e3, .poisson_ratio = 0.3};
      lower.is_linear = is_linear;
      lower.attached = {
          {.where = HalfSpaceGeometry{.point_m = {0, 0, 1}}, .stiffness_pa_per_m = 1e3}};
      ElasticMaterial upper = lower;
      upper.young_pa = upper_pa;
      lower.touches = {{.tissue = 2}};
      upper.touches = {{.tissue = 3}, {.tissue = 0}};
      const double half_m = 0.0004;
      const SceneConfig scene{
          .tip_radius_m = kPairTip_m,
          .tissues = {
              soft_box("lower",
                       box_file(folder_, "lower", {-0.03, -0.03, 0}, {0.03, 0.03, 0.02}, {4, 4, 2}),
                       lower),
              soft_box(
                  "upper",
                  box_file(folder_, "upper", {-0.03, -0.03, 0.02}, {0.03, 0.03, 0.05}, {5, 5, 3}),
                  upper),
              bone(HalfSpaceGeometry{.point_m = {0, 0, half_m}}),
              bone(HalfSpaceGeometry{.point_m = {0, 0, 0.05 - half_m}, .normal = {0, 0, -1}})}};
      Together both(scene);
      for (int i = 0; i < 40; ++i) both.step();

      const double expected =
          0.06 * 0.06 * 2.0 * half_m / (0.02 / lower.young_pa + 0.03 / upper.young_pa);
      const auto plate = [&](std::size_t i) {
        return both.simulations[i]->rigid().force_on_body_newton(both.simulations[i]->x_m().data());
      };
      const Vector3 between = both.island->pairs()[0].force_on_first_newton();
      std::printf(
          "%.0f and %.0f Pa, %s: plates %.4f and %.4f, between %.4f of the closed form; "
          "deepest %.4f mm\n",
          lower.young_pa, upper.young_pa, is_linear ? "linear" : "quadratic",
          plate(0).z() / expected, -plate(1).z() / expected, -between.z() / expected,
          1e3 * both.deepest_m());
      // springs that hold the blocks bear up to 1 %
      EXPECT_NEAR(plate(0).z(), expected, 0.04 * expected);
      EXPECT_NEAR(-plate(1).z(), plate(0).z(), 0.02 * expected);
      EXPECT_NEAR(-between.z(), plate(0).z(), 0.02 * expected);
      EXPECT_LT(between.head<2>().norm(), 0.02 * expected);
      EXPECT_LT(both.deepest_m(), 1e-4);
    }
  }
}

TEST_F(TwoBodies, BodiesThatAreApartAreSkippedAndStayAsTheyWouldBeAlone) {
  ElasticMaterial material{.young_pa = 10e3, .poisson_ratio = 0.3};
  material.is_linear = true;
  ElasticMaterial upper = material;
  material.fixed = {HalfSpaceGeometry{.point_m = {0, 0, 1e-4}}};
  upper.fixed = {HalfSpaceGeometry{.point_m = {0, 0, 0.0599}, .normal = {0, 0, -1}}};
  upper.touches = {{.tissue = 1}};
  const auto scene = [&](const ElasticMaterial& above) {
    return SceneConfig{
        .tip_radius_m = kPairTip_m,
        .tissues = {
            soft_box(
                "upper",
                box_file(folder_, "upper", {-0.03, -0.03, 0.04}, {0.03, 0.03, 0.06}, {3, 3, 2}),
                above),
            soft_box("lower",
                     box_file(folder_, "lower", {-0.03, -0.03, 0}, {0.03, 0.03, 0.02}, {3, 3, 2}),
                     material)}};
  };
  Together both(scene(upper));
  int steps = 0;
  while (both.step() > 0 && steps < 200) ++steps;
  EXPECT_LT(steps, 200);
  const TipState side{.tip_m = {0.03 + kPairTip_m - 0.002, 0, 0.045},
                      .place_m = {0.03 + kPairTip_m, 0, 0.045}};
  EXPECT_EQ(both.step(side), 1);  // the other one sleeps on

  Together alone(scene([&] {
    ElasticMaterial none = upper;
    none.touches.clear();
    return none;
  }()));
  for (int i = 0; i <= steps; ++i) alone.step();
  alone.step(side);
  EXPECT_EQ(alone.simulations[0]->x_m(), both.simulations[0]->x_m());
}

/// A soft slab that lies on a softer block, which stands on the ground.
SceneConfig stacked(const test::TempFolder& folder, bool does_touch, double gap_m) {
  ElasticMaterial slab{.young_pa = 15e3, .poisson_ratio = 0.4, .viscosity_s = 0.005};
  slab.fixed = {HalfSpaceGeometry{.point_m = {-0.0299, 0, 0}, .normal = {1, 0, 0}},
                HalfSpaceGeometry{.point_m = {0.0299, 0, 0}, .normal = {-1, 0, 0}}};
  if (does_touch) slab.touches = {{.tissue = 1}};
  ElasticMaterial block{.young_pa = 8e3, .poisson_ratio = 0.4, .viscosity_s = 0.005};
  block.fixed = {HalfSpaceGeometry{.point_m = {0, 0, -0.0299 - gap_m}}};
  return {.tip_radius_m = kPairTip_m,
          .tissues = {soft_box("slab",
                               box_file(folder, "slab", {-0.03, -0.025, 0}, {0.03, 0.025, 0.012},
                                        {6, 5, 2}),
                               slab),
                      soft_box("block",
                               box_file(folder, "block", {-0.025, -0.025, -0.03 - gap_m},
                                        {0.025, 0.025, -gap_m}, {5, 5, 3}),
                               block)}};
}

TEST_F(TwoBodies, ASlabPressedOntoABlockMovesItAndBothComeToRestAgain) {
  Together both(stacked(folder_, true, 0.0));
  double largest_newton = 0.0;
  double deepest_m = 0.0;
  double moved_m = 0.0;
  for (int i = 0; i < 60; ++i) {
    const double way_m = std::min(0.005, 0.0002 * i);
    const TipState tip{.tip_m = {0, 0, 0.012 + kPairTip_m - way_m},
                       .place_m = {0, 0, 0.012 + kPairTip_m}};
    both.step(tip);
    ASSERT_TRUE(both.is_finite());
    EXPECT_FALSE(both.is_inverted());
    largest_newton =
        std::max(largest_newton, both.simulations[0]->touch(0).force_on_tool_newton.z());
    deepest_m = std::max(deepest_m, both.deepest_m());
    moved_m = std::max(
        moved_m, (both.simulations[1]->x_m() - both.bodies[1]->start_m).cwiseAbs().maxCoeff());
  }
  std::printf("slab on block: %.3f N, deepest %.4f mm, block moved %.2f mm\n", largest_newton,
              1e3 * deepest_m, 1e3 * moved_m);
  EXPECT_GT(moved_m, 5e-4);
  EXPECT_LT(deepest_m, 5e-4);
  int steps = 0;
  while (both.step() > 0 && steps < 400) ++steps;
  EXPECT_LT(steps, 400);
}

TEST_F(TwoBodies, TheForceBetweenFullSolutionsKnowsThatTheOtherBodyGivesWay) {
  for (const double gap_m : {0.0, 0.0015}) {
    const SceneConfig scene = stacked(folder_, true, gap_m);
    const auto elastic = ElasticTissues::of(scene, 1, ElasticPace::kVirtual);
    ElasticReference reference(elastic_bodies_of(scene), kPairTip_m, 2e-3);
    double error2 = 0.0;
    double force2 = 0.0;
    double largest = 0.0;
    for (int tick = 0; tick < 600; ++tick) {
      const double time_s = kTick_s * tick;
      const double way_m = 0.006 * 0.5 * (1.0 - std::cos(2.0 * 3.14159265 * time_s / 0.5));
      const Vector3 tip_m(0.0, 0.001, 0.012 + kPairTip_m + 0.001 - way_m);
      SceneForce force;
      elastic->step(0, tip_m, time_s, 0.05, force);
      SceneForce ideal;
      reference.advance(time_s, tip_m, ideal);
      error2 += (force.force_on_tool_newton - ideal.force_on_tool_newton).squaredNorm();
      force2 += ideal.force_on_tool_newton.squaredNorm();
      largest = std::max(largest, ideal.force_on_tool_newton.norm());
    }
    std::printf("gap %.1f mm: error %.1f %%, %.2f N\n", 1e3 * gap_m,
                1e2 * std::sqrt(error2 / force2), largest);
    EXPECT_LT(std::sqrt(error2 / force2), 0.1);
  }
}

// Two blocks that nobody drew, pressed onto each other in a hurry and let go.
TEST_F(TwoBodies, RandomPairsStayFinite) {
  const int runs = test::kIsSanitized ? 3 : 30;
  for (int seed = 1; seed <= runs; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 random(static_cast<std::uint64_t>(seed));
    const auto between = [&](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random);
    };
    const Vector3 upper(between(0.02, 0.05), between(0.02, 0.05), between(0.005, 0.02));
    const Vector3 lower(between(0.02, 0.05), between(0.02, 0.05), between(0.005, 0.02));
    const double gap_m = between(-0.001, 0.003);
    ElasticMaterial above{.young_pa = std::pow(10.0, between(3.3, 5.0)),
                          .poisson_ratio = between(0.2, 0.48),
                          .viscosity_s = between(0.0, 0.01)};
    above.is_linear = between(0.0, 1.0) < 0.6;
    ElasticMaterial below = above;
    below.young_pa = std::pow(10.0, between(3.3, 5.0));
    above.fixed = {
        HalfSpaceGeometry{.point_m = {0.5e-3 - 0.5 * upper.x(), 0, 0}, .normal = {1, 0, 0}}};
    below.fixed = {HalfSpaceGeometry{.point_m = {0, 0, 0.5e-3 - lower.z() - gap_m}}};
    above.touches = {{.tissue = 1}};
    const SceneConfig scene{
        .tip_radius_m = kPairTip_m,
        .tissues = {soft_box("above",
                             box_file(folder_, "above", {-0.5 * upper.x(), -0.5 * upper.y(), 0},
                                      {0.5 * upper.x(), 0.5 * upper.y(), upper.z()}, {4, 3, 2}),
                             above),
                    soft_box("below",
                             box_file(folder_, "below",
                                      {-0.5 * lower.x(), -0.5 * lower.y(), -lower.z() - gap_m},
                                      {0.5 * lower.x(), 0.5 * lower.y(), -gap_m}, {3, 4, 2}),
                             below)}};
    Together both(scene, 0.005);
    const double speed = between(0.02, 0.4);
    const double depth_m = between(0.2, 1.0) * upper.z();
    const Vector3 top(between(-0.2, 0.4) * upper.x(), between(-0.3, 0.3) * upper.y(),
                      upper.z() + kPairTip_m);
    double deepest_m = 0.0;
    int inverted = 0;
    int most_inverted = 0;
    for (int i = 0; i < 80; ++i) {
      const double t_s = 0.005 * i;
      const double way_m = t_s < 0.25 ? std::min(depth_m, speed * t_s)
                                      : std::max(-0.02, depth_m - speed * (t_s - 0.25));
      std::optional<TipState> tip;
      if (way_m > -0.02) {
        tip = TipState{.tip_m = top - Vector3(0, 0, way_m), .place_m = top};
        if (way_m < 0.0) tip->place_m = tip->tip_m;
      }
      both.step(tip);
      ASSERT_TRUE(both.is_finite());
      deepest_m = std::max(deepest_m, both.deepest_m());
      inverted = both.is_inverted() ? inverted + 1 : 0;
      most_inverted = std::max(most_inverted, inverted);
    }
    std::printf("seed %d: deepest %.3f mm, inverted %d, failed %d\n", seed, 1e3 * deepest_m,
                most_inverted, static_cast<int>(both.simulations[0]->failed_steps()));
    EXPECT_LE(most_inverted, 1);
    EXPECT_LT(deepest_m, 1e-3);
  }
}

}  // namespace
}  // namespace palpate::physics
