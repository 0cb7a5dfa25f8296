// SPDX-License-Identifier: Apache-2.0
// Two elastic bodies that springs tie together: closed forms, action and reaction, tearing, rest.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "common/core/check.h"
#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "tests/property/seeds.h"
#include "tests/unit/elastic/touching/together.h"

namespace palpate::physics {
namespace {

using testing::HasSubstr;

constexpr double kArea_m2 = 0.06 * 0.06;
constexpr double kLower_m = 0.02;
constexpr double kUpper_m = 0.03;
constexpr double kJaws_newton_per_m = 1e6;
constexpr double kGround_pa_per_m = 1e9;

struct Blocks {
  double lower_pa = 10e3;
  double upper_pa = 10e3;
  double tie_pa_per_m = 1e7;
  bool is_linear = true;
  bool is_upper_first = true;
};

class Tied : public testing::Test {
 protected:
  /// Two blocks whose meshes do not match, the upper one tied to the lower one, which stands on
  /// stiff springs.
  SceneConfig blocks(const Blocks& given) {
    ElasticMaterial lower{.young_pa = given.lower_pa, .poisson_ratio = 0.0};
    lower.is_linear = given.is_linear;
    ElasticMaterial upper = lower;
    upper.young_pa = given.upper_pa;
    lower.attached = {{.where = HalfSpaceGeometry{.point_m = {0, 0, 1e-4}},
                       .stiffness_pa_per_m = kGround_pa_per_m}};
    upper.attached = {{.stiffness_pa_per_m = given.tie_pa_per_m,
                       .tissue = given.is_upper_first ? 1 : 0,
                       .is_anywhere = true}};
    const TissueConfig below = soft_box(
        "lower", box_file(folder_, "lower", {-0.03, -0.03, 0}, {0.03, 0.03, kLower_m}, {4, 4, 2}),
        lower);
    const TissueConfig above = soft_box("upper",
                                        box_file(folder_, "upper", {-0.03, -0.03, kLower_m},
                                                 {0.03, 0.03, kLower_m + kUpper_m}, {5, 5, 3}),
                                        upper);
    SceneConfig scene{.tip_radius_m = kPairTip_m, .tissues = {above, below}};
    if (!given.is_upper_first) std::swap(scene.tissues[0], scene.tissues[1]);
    return scene;
  }
  test::TempFolder folder_;
};

/// What jaws on the whole top and the ground feel when the top is moved.
struct Pull {
  Vector3 by_jaws_newton = Vector3::Zero();  // on the upper block
  Vector3 by_ties_newton = Vector3::Zero();
  Vector3 by_ground_newton = Vector3::Zero();  // on the lower one
};

Vector3 by_springs_newton(const ElasticSimulation& body) {
  Vector3 newton = Vector3::Zero();
  for (const elastic::Attachment& one : body.body().body->description().attachments) {
    if (one.is_tie()) continue;
    const auto at = 3 * Eigen::Index{one.node};
    newton -= one.stiffness_newton_per_m *
              (body.x_m().segment<3>(at) - body.body().body->rest_m().segment<3>(at));
  }
  return newton;
}

Pull pull(const SceneConfig& scene, std::size_t upper, const Vector3& way_m) {
  Together both(scene);
  // a place far above, from which only the top is within reach
  const Vector3 from_m(0, 0, kLower_m + kUpper_m + 1.0);
  ElasticSimulation& held = *both.simulations[upper];
  EXPECT_GT(held.hold(0, from_m, 1.0015, 100000, kJaws_newton_per_m), 20U);
  for (int i = 1; i <= 60; ++i) {
    const TipState tip{.tip_m = from_m + std::min(1.0, 0.05 * i) * way_m, .place_m = from_m};
    both.step(tip, upper);
  }
  return {.by_jaws_newton = -held.touch(0).force_on_tool_newton,
          .by_ties_newton =
              both.island->ties()[0].force_on_attached_newton(held, *both.simulations[1 - upper]),
          .by_ground_newton = by_springs_newton(*both.simulations[1 - upper])};
}

// Without lateral contraction the strain is uniaxial: springs in a row, K = 1/Σ (L/(E A) + 1/k).
TEST_F(Tied, TwoBlocksPulledApartAreSpringsInARow) {
  constexpr double kWay_m = 1e-3;
  for (const Blocks& given :
       {Blocks{}, Blocks{.is_upper_first = false}, Blocks{.upper_pa = 40e3},
        Blocks{.is_linear = false}, Blocks{.tie_pa_per_m = 3e5}, Blocks{.tie_pa_per_m = 1.9e7}}) {
    const Pull found = pull(blocks(given), given.is_upper_first ? 0 : 1, {0, 0, kWay_m});
    const double expected =
        kWay_m / (kLower_m / (given.lower_pa * kArea_m2) + kUpper_m / (given.upper_pa * kArea_m2) +
                  1.0 / (given.tie_pa_per_m * kArea_m2) + 1.0 / kJaws_newton_per_m +
                  1.0 / (kGround_pa_per_m * kArea_m2));
    std::printf("jaws %.4f, ties %.4f, ground %.4f of the closed form\n",
                found.by_jaws_newton.z() / expected, -found.by_ties_newton.z() / expected,
                -found.by_ground_newton.z() / expected);
    EXPECT_NEAR(found.by_jaws_newton.z(), expected, 0.03 * expected);
    EXPECT_NEAR(-found.by_ties_newton.z(), found.by_jaws_newton.z(), 0.002 * expected);
    EXPECT_NEAR(-found.by_ground_newton.z(), found.by_jaws_newton.z(), 0.002 * expected);
  }
}

// The same force as in one block of the same height, which has no ties.
TEST_F(Tied, TwoBlocksAreShearedAsOne) {
  const Vector3 way_m(1e-3, 0, 0);
  const Pull found = pull(blocks({.tie_pa_per_m = 1e7}), 0, way_m);
  SceneConfig whole = blocks({});
  auto& material = std::get<ElasticMaterial>(whole.tissues[1].material);
  whole.tissues = {soft_box(
      "whole",
      box_file(folder_, "whole", {-0.03, -0.03, 0}, {0.03, 0.03, kLower_m + kUpper_m}, {5, 5, 5}),
      material)};
  Together one(whole);
  const Vector3 from_m(0, 0, kLower_m + kUpper_m + 1.0);
  one.simulations[0]->hold(0, from_m, 1.0015, 100000, kJaws_newton_per_m);
  for (int i = 1; i <= 60; ++i) {
    one.step(TipState{.tip_m = from_m + std::min(1.0, 0.05 * i) * way_m, .place_m = from_m});
  }
  const double expected = -one.simulations[0]->touch(0).force_on_tool_newton.x();
  std::printf("sheared: %.4f N, one block %.4f N; ties %.4f N, ground %.4f N\n",
              found.by_jaws_newton.x(), expected, found.by_ties_newton.x(),
              found.by_ground_newton.x());
  EXPECT_NEAR(found.by_jaws_newton.x(), expected, 0.03 * expected);
  EXPECT_NEAR(-found.by_ties_newton.x(), found.by_jaws_newton.x(), 0.005 * expected);
  EXPECT_NEAR(-found.by_ground_newton.x(), found.by_jaws_newton.x(), 0.005 * expected);
}

TEST_F(Tied, BothSleepAndWakeTogether) {
  Together both(blocks({.tie_pa_per_m = 3e5}));
  const auto steps_to_sleep = [&] {
    int steps = 0;
    while (both.step() > 0 && steps < 600) ++steps;
    return steps;
  };
  EXPECT_LT(steps_to_sleep(), 600);
  const Vector3 top_m(0, 0, kLower_m + kUpper_m + kPairTip_m);
  for (int i = 0; i < 5; ++i) {
    both.step(TipState{.tip_m = top_m - Vector3(0, 0, 0.004), .place_m = top_m});
  }
  EXPECT_GT((both.simulations[1]->x_m() - both.bodies[1]->start_m).cwiseAbs().maxCoeff(), 1e-4);
  EXPECT_FALSE(both.simulations[1]->is_asleep());
  EXPECT_LT(steps_to_sleep(), 600);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_LT((both.simulations[i]->x_m() - both.bodies[i]->start_m).cwiseAbs().maxCoeff(), 1e-4);
  }
}

TEST_F(Tied, UnderGravityTheyBeginAtRest) {
  SceneConfig scene = blocks({.lower_pa = 2e3, .upper_pa = 2e3, .tie_pa_per_m = 3e5});
  for (TissueConfig& tissue : scene.tissues) {
    std::get<ElasticMaterial>(tissue.material).gravity_m_per_s2 = {3, 0, -9};
    std::get<ElasticMaterial>(tissue.material).viscosity_s = 0.005;
  }
  Together both(scene);
  double moved_m = 0.0;
  double sagged_m = 0.0;
  for (int i = 0; i < 100; ++i) {
    both.step();
    for (std::size_t k = 0; k < 2; ++k) {
      moved_m = std::max(
          moved_m, (both.simulations[k]->x_m() - both.bodies[k]->start_m).cwiseAbs().maxCoeff());
      sagged_m = std::max(sagged_m, both.bodies[k]->sag_m);
    }
  }
  const double weight_newton = 1000.0 * kArea_m2 * (kLower_m + kUpper_m) * 9.0;
  std::printf("moved %.4f mm of %.2f mm\n", 1e3 * moved_m, 1e3 * sagged_m);
  EXPECT_LT(moved_m, 2e-5);
  EXPECT_GT(sagged_m, 1e-3);
  EXPECT_NEAR(by_springs_newton(*both.simulations[1]).z(), weight_newton, 0.01 * weight_newton);
}

TEST_F(Tied, IsRefusedWithoutAFaceWithinTheGap) {
  SceneConfig scene = blocks({});
  auto& attached = std::get<ElasticMaterial>(scene.tissues[0].material).attached[0];
  std::get<FileGeometry>(scene.tissues[0].geometry).position_m.z() = 0.003;
  const auto complaint = [&] {
    try {
      static_cast<void>(elastic_bodies_of(scene));
    } catch (const SetupError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(complaint(), AllOf(HasSubstr("upper.msh"), HasSubstr("elastic.attached[0].tissue"),
                                 HasSubstr("within gap_m, 1 mm; the nearest node is 3 mm away")));
  attached.gap_m = 0.004;
  EXPECT_EQ(complaint(), "");
  attached.is_anywhere = false;
  attached.where = HalfSpaceGeometry{.point_m = {0, 0, -1}};
  EXPECT_THAT(complaint(), HasSubstr("no face of the surface that lies in `where`"));
}

TEST_F(Tied, SpringsThatAreMuchStifferThanTheTissueAreRefused) {
  EXPECT_NO_THROW(static_cast<void>(elastic_bodies_of(blocks({.tie_pa_per_m = 1.9e7}))));
  try {
    static_cast<void>(elastic_bodies_of(blocks({.tie_pa_per_m = 2.1e7})));
    FAIL() << "accepted";
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr("elastic.attached[0].stiffness_pa_per_m = 2.1e+07: must be at most "
                                "20 × young_pa"),
                      HasSubstr("give 2e+07 or less")));
  }
}

TEST_F(Tied, IsRefusedWhereItsWeightTearsIt) {
  SceneConfig scene = blocks({.tie_pa_per_m = 3e5});
  auto& material = std::get<ElasticMaterial>(scene.tissues[0].material);
  material.gravity_m_per_s2 = {0, 0, 20};
  material.fixed = {HalfSpaceGeometry{.point_m = {-0.0299, 0, 0}, .normal = {1, 0, 0}}};
  material.attached[0].toughness_joule_per_m2 = 5.0;
  EXPECT_NO_THROW(static_cast<void>(elastic_bodies_of(scene)));
  material.attached[0].toughness_joule_per_m2 = 0.01;
  try {
    static_cast<void>(elastic_bodies_of(scene));
    FAIL() << "accepted";
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(), HasSubstr("tears under the weight of what it ties together"));
  }
}

}  // namespace
}  // namespace palpate::physics
