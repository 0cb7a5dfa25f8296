// SPDX-License-Identifier: Apache-2.0
// Elastic bodies against what does not give way: closed forms, balance of forces, motion.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>

#include "common/core/check.h"
#include "physics_node/elastic_tissue/elastic_simulation.h"
#include "tests/property/seeds.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/elastic/touching/touching_scene.h"

namespace palpate::physics {
namespace {

constexpr double kTip_m = 0.006;

std::shared_ptr<const ElasticBody> first_body(const SceneConfig& scene) {
  return elastic_bodies_of(scene).front();
}

/// Force of what it lies on, after a while at rest.
Vector3 resting_newton(const ElasticBody& body) {
  ElasticSimulation simulation(body, 0, kTip_m, 0.02);
  for (int i = 0; i < 20; ++i) simulation.step({});
  return simulation.rigid().force_on_body_newton(simulation.x_m().data());
}

class OnBone : public testing::Test {
 protected:
  test::TempFolder folder_;
  ElasticMaterial material_{.young_pa = 10e3, .poisson_ratio = 0.3};
};

// A column that stands on a frictionless plane with Poisson's ratio 0 sinks by ρ g H²/2E at its
// top; springs that hold it sideways and up take less than 1 % of its weight.
TEST_F(OnBone, AColumnSinksUnderItsWeightAsTheClosedFormSaysAndTheBoneBearsIt) {
  const double height_m = 0.06;
  material_ = {.young_pa = 5e3, .poisson_ratio = 0.0};
  material_.gravity_m_per_s2 = {0, 0, -9.81};
  material_.attached = {
      {.where = HalfSpaceGeometry{.point_m = {0, 0, height_m - 1e-4}, .normal = {0, 0, -1}},
       .stiffness_pa_per_m = 500.0}};
  material_.touches = {{.tissue = 1}};
  const std::string file =
      box_file(folder_, "column", {-0.015, -0.015, 0}, {0.015, 0.015, height_m}, {3, 3, 6});
  const SceneConfig scene{
      .tip_radius_m = kTip_m,
      .tissues = {soft_box("column", file, material_), bone(HalfSpaceGeometry{})}};

  const auto body = first_body(scene);
  const double weight_newton = 1000.0 * 9.81 * 0.03 * 0.03 * height_m;
  const double sunk_m = 1000.0 * 9.81 * height_m * height_m / (2.0 * 5e3);
  double top_m = 0.0;
  for (const std::uint32_t node : body->surface_nodes) {
    top_m = std::max(top_m, body->start_m[3 * Eigen::Index{node} + 2]);
  }
  EXPECT_NEAR(height_m - top_m, sunk_m, 0.04 * sunk_m);  // 3.5 mm, of 60: large strain
  const Vector3 bone_newton = resting_newton(*body);
  EXPECT_NEAR(bone_newton.z(), weight_newton, 0.01 * weight_newton);
  EXPECT_LT(bone_newton.head<2>().norm(), 1e-3 * weight_newton);
}

// A rigid ball presses into a thick block by δ: F = 4/3 E/(1 − ν²) √R δ^1.5 [Hertz].
double hertz_ratio(const test::TempFolder& folder, int cells, double depth_m) {
  ElasticMaterial material{.young_pa = 10e3, .poisson_ratio = 0.3};
  material.fixed = {HalfSpaceGeometry{.point_m = {0, 0, -0.0799}}};
  material.touches = {{.tissue = 1}};
  const std::string file = box_file(folder, "block" + std::to_string(cells), {-0.06, -0.06, -0.08},
                                    {0.06, 0.06, 0}, {cells, cells, cells * 2 / 3});
  const double radius_m = 0.04;
  const SceneConfig scene{
      .tip_radius_m = kTip_m,
      .tissues = {soft_box("block", file, material),
                  bone(SphereGeometry{.center_m = {0.0012, 0.0007, radius_m - depth_m},
                                      .radius_m = radius_m})}};
  const auto body = first_body(scene);
  const Vector3 newton = resting_newton(*body);
  return -newton.z() /
         (4.0 / 3.0 * 10e3 / (1.0 - 0.09) * std::sqrt(radius_m) * std::pow(depth_m, 1.5));
}

TEST_F(OnBone, ABallOfBoneInABlockIsPushedBackAsHertzSays) {
  if (test::kIsSanitized) GTEST_SKIP() << "minutes; the code is that of the other tests";
  const double coarse = hertz_ratio(folder_, 9, 0.0025);
  const double fine = hertz_ratio(folder_, 12, 0.0025);
  std::printf("Hertz: coarse %.3f, fine %.3f\n", coarse, fine);
  EXPECT_NEAR(fine, 1.0, 0.12) << coarse;
  EXPECT_NEAR(fine, coarse, 0.1);
}

// Between two frictionless plates a block is in uniaxial stress: F = E A ε, whatever Poisson's
// ratio.
TEST_F(OnBone, ABlockBetweenTwoPlatesIsPushedAsUniaxialCompressionSays) {
  for (const double poisson_ratio : {0.0, 0.3, 0.45}) {
    for (const bool is_linear : {false, true}) {
      ElasticMaterial material{.young_pa = 10e3, .poisson_ratio = poisson_ratio};
      material.is_linear = is_linear;
      material.attached = {{.where = HalfSpaceGeometry{.point_m = {0, 0, 0.1}},
                            .stiffness_pa_per_m = 1e3}};  // 5 % of a newton
      material.touches = {{.tissue = 1}, {.tissue = 2}};
      const std::string file =
          box_file(folder_, "block", {-0.03, -0.03, 0}, {0.03, 0.03, 0.04}, {4, 4, 3});
      const double half_m = 0.0004;
      const SceneConfig scene{
          .tip_radius_m = kTip_m,
          .tissues = {
              soft_box("block", file, material), bone(HalfSpaceGeometry{.point_m = {0, 0, half_m}}),
              bone(HalfSpaceGeometry{.point_m = {0, 0, 0.04 - half_m}, .normal = {0, 0, -1}})}};
      const auto body = first_body(scene);
      ElasticSimulation simulation(*body, 0, kTip_m, 0.02);
      for (int i = 0; i < 20; ++i) simulation.step({});
      double newton = 0.0;  // of both plates
      for (const elastic::ContactPlane& plane : simulation.rigid().pressed()) {
        newton += plane.force_on_body_newton(simulation.x_m().data()).norm();
      }
      const double expected = 10e3 * 0.06 * 0.06 * 2.0 * half_m / 0.04;
      std::printf("nu %.2f %s: %.4f of E A eps, deepest %.5f mm\n", poisson_ratio,
                  is_linear ? "linear" : "quadratic", 0.5 * newton / expected,
                  1e3 * simulation.rigid().deepest_m(simulation.x_m().data()));
      EXPECT_NEAR(0.5 * newton, expected, 0.03 * expected);
      EXPECT_LT(simulation.rigid().deepest_m(simulation.x_m().data()), 5e-5);
    }
  }
}

TEST_F(OnBone, ABodyAtRestOnBoneSleepsAndWakesUnderATool) {
  material_.gravity_m_per_s2 = {0, 0, -9.81};
  material_.fixed = {HalfSpaceGeometry{.point_m = {-0.0399, 0, 0}, .normal = {1, 0, 0}}};
  material_.touches = {{.tissue = 1, .friction_coefficient = 0.3}};
  const std::string file =
      box_file(folder_, "slab", {-0.04, -0.03, 0}, {0.04, 0.03, 0.012}, {8, 6, 2});
  const SceneConfig scene{.tip_radius_m = kTip_m,
                          .tissues = {soft_box("slab", file, material_),
                                      bone(HalfSpaceGeometry{.point_m = {0, 0, -0.0005}})}};
  const auto body = first_body(scene);
  ElasticSimulation simulation(*body, 1, kTip_m, 0.02);
  std::array<std::optional<TipState>, 1> none;
  int steps = 0;
  while (simulation.step(none) && steps < 400) ++steps;
  EXPECT_LT(steps, 400);
  EXPECT_FALSE(simulation.step(none));
  EXPECT_GT(simulation.rigid().force_on_body_newton(simulation.x_m().data()).z(), 0.1);

  std::array<std::optional<TipState>, 1> tips;
  tips[0] = {.tip_m = {0, 0, 0.012 + kTip_m - 0.002}, .place_m = {0, 0, 0.012 + kTip_m}};
  EXPECT_TRUE(simulation.step(tips));
  EXPECT_GT(simulation.touch(0).force_on_tool_newton.z(), 0.0);
}

struct Pressed {
  double deepest_m = 0.0;  // node in bone
  double largest_newton = 0.0;
  int inverted_in_a_row = 0;
  bool is_finite = true;
  std::uint64_t failed = 0;
};

/// The tip goes down along z at a speed, waits, and comes back.
Pressed press_on(const ElasticBody& body, const Vector3& top_m, double depth_m,
                 double speed_m_per_s) {
  const double step_s = 0.005;
  ElasticSimulation simulation(body, 1, kTip_m, step_s);
  Pressed all;
  int inverted = 0;
  const double down_s = (depth_m + 0.004) / speed_m_per_s;
  for (int i = 0; i < 120; ++i) {
    const double t_s = step_s * i;
    double way_m = std::min(t_s, down_s) * speed_m_per_s;
    if (t_s > down_s + 0.15) way_m -= std::min(way_m, (t_s - down_s - 0.15) * speed_m_per_s);
    std::array<std::optional<TipState>, 1> tips;
    const Vector3 free_m = top_m + Vector3(0, 0, kTip_m);
    tips[0] = {.tip_m = free_m + Vector3(0, 0, 0.004 - way_m), .place_m = free_m};
    if (way_m < 0.004) tips[0]->place_m = tips[0]->tip_m;
    simulation.step(tips);
    all.is_finite = all.is_finite && simulation.x_m().allFinite();
    all.deepest_m = std::max(all.deepest_m, simulation.rigid().deepest_m(simulation.x_m().data()));
    all.largest_newton =
        std::max(all.largest_newton, simulation.touch(0).force_on_tool_newton.norm());
    inverted = body.body->has_inverted_element(simulation.x_m()) ? inverted + 1 : 0;
    all.inverted_in_a_row = std::max(all.inverted_in_a_row, inverted);
  }
  all.failed = simulation.failed_steps();
  return all;
}

TEST_F(OnBone, AFastPressAgainstBoneStaysFiniteAndOutOfIt) {
  if (test::kIsSanitized) GTEST_SKIP() << "minutes; the code is that of the other tests";
  material_ = {.young_pa = 15e3, .poisson_ratio = 0.45, .viscosity_s = 0.005};
  material_.fixed = {HalfSpaceGeometry{.point_m = {-0.0399, 0, 0}, .normal = {1, 0, 0}}};
  material_.touches = {{.tissue = 1}};
  for (const double thick_m : {0.02, 0.008, 0.004}) {
    const std::string file = box_file(folder_, "plate" + std::to_string(thick_m), {-0.04, -0.03, 0},
                                      {0.04, 0.03, thick_m}, {10, 8, 2});
    const SceneConfig scene{
        .tip_radius_m = kTip_m,
        .tissues = {soft_box("plate", file, material_),
                    bone(BoxGeometry{.center_m = {0, 0, -0.01}, .size_m = {0.2, 0.2, 0.02}})}};
    const auto body = first_body(scene);
    for (const double speed : {0.05, 0.4}) {
      SCOPED_TRACE(testing::Message() << thick_m << " m, " << speed << " m/s");
      const Pressed now = press_on(*body, {0, 0, thick_m}, 1.2 * thick_m, speed);
      std::printf("thick %.1f mm, %.2f m/s: deepest %.4f mm, %.2f N, inverted %d, failed %d\n",
                  1e3 * thick_m, speed, 1e3 * now.deepest_m, now.largest_newton,
                  now.inverted_in_a_row, static_cast<int>(now.failed));
      EXPECT_TRUE(now.is_finite);
      EXPECT_LT(now.deepest_m, 5e-4);
      EXPECT_LE(now.inverted_in_a_row, 1);
      EXPECT_GT(now.largest_newton, 0.2);
    }
  }
}

// Pulled along bone by gravity at an angle: friction holds up to µ N, then it slides.
TEST_F(OnBone, FrictionBearsUpToTheCoefficientTimesThePressure) {
  const auto sideways = [&](double friction, double slope) {
    ElasticMaterial material{.young_pa = 20e3, .poisson_ratio = 0.3};
    material.gravity_m_per_s2 = {9.81 * slope, 0, -9.81};
    material.attached = {
        {.where = HalfSpaceGeometry{.point_m = {0, 0, 0.0199}, .normal = {0, 0, -1}},
         .stiffness_pa_per_m = 2e3}};
    material.touches = {{.tissue = 1, .friction_coefficient = friction}};
    const std::string file =
        box_file(folder_, "box", {-0.03, -0.03, 0}, {0.03, 0.03, 0.02}, {6, 6, 2});
    const SceneConfig scene{
        .tip_radius_m = kTip_m,
        .tissues = {soft_box("box", file, material), bone(HalfSpaceGeometry{})}};
    return resting_newton(*first_body(scene));
  };
  const Vector3 slips = sideways(0.2, 0.6);
  EXPECT_NEAR(-slips.x(), 0.2 * slips.z(), 0.02 * slips.z());
  const Vector3 sticks = sideways(0.8, 0.3);
  EXPECT_LT(-sticks.x(), 0.8 * sticks.z());
  EXPECT_GT(-sticks.x(), 0.2 * sticks.z());
}

TEST_F(OnBone, AMeshThatBeginsInsideOfBoneIsRefusedWithBothNames) {
  material_.fixed = {HalfSpaceGeometry{.point_m = {0, 0, 0.0199}, .normal = {0, 0, -1}}};
  material_.touches = {{.tissue = 1}};
  const std::string file =
      box_file(folder_, "box", {-0.03, -0.03, -0.005}, {0.03, 0.03, 0.02}, {3, 3, 2});
  const SceneConfig scene{.tip_radius_m = kTip_m,
                          .tissues = {soft_box("box", file, material_), bone(HalfSpaceGeometry{})}};
  try {
    static_cast<void>(first_body(scene));
    FAIL() << "must be refused";
  } catch (const SetupError& error) {
    EXPECT_NE(std::string(error.what()).find("begins inside of \"bone\": by 5 mm"),
              std::string::npos)
        << error.what();
  }
}

// Nobody drew these: sizes, stiffness, bone of every kind, and a tip that goes anywhere.
TEST_F(OnBone, RandomBodiesPressedAgainstBoneStayFinite) {
  const int runs = test::kIsSanitized ? 4 : 30;
  for (int seed = 1; seed <= runs; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    std::mt19937_64 random(static_cast<std::uint64_t>(seed));
    const auto between = [&](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random);
    };
    const Vector3 size_m(between(0.02, 0.08), between(0.02, 0.08), between(0.004, 0.03));
    ElasticMaterial material{.young_pa = std::pow(10.0, between(3.0, 5.0)),
                             .poisson_ratio = between(0.2, 0.48),
                             .viscosity_s = between(0.0, 0.01)};
    material.is_linear = between(0.0, 1.0) < 0.5;
    material.fixed = {
        HalfSpaceGeometry{.point_m = {0.501e-3 - 0.5 * size_m.x(), 0, 0}, .normal = {1, 0, 0}}};
    if (between(0.0, 1.0) < 0.5) material.gravity_m_per_s2 = {0, 0, -9.81};
    material.touches = {{.tissue = 1, .friction_coefficient = seed % 2 == 0 ? 0.0 : 0.4}};
    const Vector3 half = 0.5 * size_m;
    const std::string file =
        box_file(folder_, "body", {-half.x(), -half.y(), 0}, {half.x(), half.y(), size_m.z()},
                 {4, static_cast<int>(between(2, 5)), 2});
    const double gap_m = between(-0.001, 0.004);
    Geometry shape = HalfSpaceGeometry{.point_m = {0, 0, -gap_m}};
    if (seed % 3 == 1) shape = SphereGeometry{.center_m = {0, 0, -gap_m - 0.03}, .radius_m = 0.03};
    if (seed % 3 == 2) {
      shape = BoxGeometry{.center_m = {0.2 * size_m.x(), 0, -gap_m - 0.01},
                          .size_m = {0.4 * size_m.x(), 0.5 * size_m.y(), 0.02}};
    }
    const SceneConfig scene{.tip_radius_m = kTip_m,
                            .tissues = {soft_box("body", file, material), bone(shape)}};
    const auto body = first_body(scene);
    if (body->body->has_inverted_element(body->start_m)) continue;  // by its weight
    const Pressed now = press_on(
        *body, {between(-0.3, 0.3) * size_m.x(), between(-0.3, 0.3) * size_m.y(), size_m.z()},
        between(0.2, 1.2) * size_m.z(), between(0.02, 0.4));
    std::printf("seed %d: deepest %.4f mm, %.2f N, inverted %d, failed %d\n", seed,
                1e3 * now.deepest_m, now.largest_newton, now.inverted_in_a_row,
                static_cast<int>(now.failed));
    EXPECT_TRUE(now.is_finite);
    EXPECT_LE(now.inverted_in_a_row, 1);
    EXPECT_LT(now.deepest_m, 2e-3);
  }
}

}  // namespace
}  // namespace palpate::physics
