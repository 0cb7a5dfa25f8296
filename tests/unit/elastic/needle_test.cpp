// SPDX-License-Identifier: Apache-2.0
// A needle in an elastic body.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "tests/property/seeds.h"
#include "tests/support/machine/places.h"

namespace palpate::physics {
namespace {

constexpr double kNeedle_m = 0.002;  // radius of its tip
constexpr double kWidth_m = 0.002;
constexpr double kToughness_joule_per_m2 = 100.0;  // × 2 mm: cuts with 0.2 N, spreads with 0.06 N
constexpr double kFriction_newton_per_m = 5.0;
constexpr double kMembrane_newton = 0.5;
constexpr double kNeedleReach_m = 0.05;
constexpr double kNeedleTick_s = 1e-3;
constexpr double kSpeed_m_per_s = 0.02;

class NeedleScene : public testing::Test {
 protected:
  NeedleScene() {
    ElasticMaterial material{.young_pa = 8e3, .viscosity_s = 0.002};
    material.is_linear = true;
    material.fixed = {HalfSpaceGeometry{.point_m = {0, 0, -0.0499}}};
    material.pierced = {.toughness_joule_per_m2 = kToughness_joule_per_m2,
                        .spreading_ratio = 0.3,
                        .friction_newton_per_m = kFriction_newton_per_m,
                        .membrane_newton = kMembrane_newton};
    scene_.tip_radius_m = kNeedle_m;
    scene_.needle = NeedleConfig{.width_m = kWidth_m, .reach_m = 0.006};
    scene_.tissues = {
        {.name = "block",
         .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh,
                                  .file = test::source_dir() + "/deploy/sessions/resection.msh"},
         .material = material}};
  }
  ElasticMaterial::Pierced& pierced() {
    return *std::get<ElasticMaterial>(scene_.tissues[0].material).pierced;
  }

  SceneConfig scene_;
};

/// Moves a needle, and counts the work of the hand.
class Hand {
 public:
  explicit Hand(const SceneConfig& scene)
      : elastic_(ElasticTissues::of(scene, 1, ElasticPace::kVirtual)) {}

  void step(double way_m) {
    tip_m_.z() += way_m;
    time_s_ += kNeedleTick_s;
    SceneForce force;
    elastic_->step(0, tip_m_, time_s_, kNeedleReach_m, force,
                   {.velocity_m_per_s = {0, 0, way_m / kNeedleTick_s}});
    const double before = newton_;
    newton_ = force.force_on_tool_newton.z();
    work_joule_ -= 0.5 * (before + newton_) * way_m;
    least_work_joule_ = std::min(least_work_joule_, work_joule_);
    most_newton_ = std::max(most_newton_, newton_);
    contact_ = force.listed_count > 0 ? std::optional(force.contacts[0]) : std::nullopt;
  }
  /// At 20 mm/s.
  void go_to(double z_m) {
    const int ticks =
        static_cast<int>(std::ceil(std::abs(z_m - tip_m_.z()) / (kSpeed_m_per_s * kNeedleTick_s)));
    const double way_m = (z_m - tip_m_.z()) / std::max(1, ticks);
    for (int tick = 0; tick < ticks; ++tick) step(way_m);
  }
  void wait(double seconds) {
    for (int tick = 0; tick < seconds / kNeedleTick_s; ++tick) step(0.0);
  }
  [[nodiscard]] bool is_in() const { return contact_ && contact_->grip.needle.is_there(); }
  [[nodiscard]] double depth_m() const { return is_in() ? -contact_->grip.slip_m.z() : 0.0; }
  [[nodiscard]] double newton() const { return newton_; }
  [[nodiscard]] double work_joule() const { return work_joule_; }
  [[nodiscard]] double least_work_joule() const { return least_work_joule_; }
  double start_peak() { return std::exchange(most_newton_, 0.0); }
  [[nodiscard]] double stiffness_newton_per_m() const {
    return -contact_->d_force_d_position(2, 2);
  }
  [[nodiscard]] double stored_joule() const {
    return 0.5 * newton_ * newton_ / stiffness_newton_per_m();
  }

 private:
  std::shared_ptr<ElasticTissues> elastic_;
  Vector3 tip_m_{0.003, 0.002, 0.005};
  double time_s_ = 0.0;
  double newton_ = 0.0;
  double work_joule_ = 0.0;
  double least_work_joule_ = 0.0;
  double most_newton_ = 0.0;
  std::optional<Contact> contact_;
};

TEST_F(NeedleScene, PuncturesTheMembraneAndSpringsBackAlongTheNeedle) {
  Hand hand(scene_);
  double z_m = 0.004;
  while (!hand.is_in() && z_m > -0.015) hand.go_to(z_m -= 1e-4);
  ASSERT_TRUE(hand.is_in());
  EXPECT_NEAR(hand.start_peak(), kMembrane_newton, 0.1);
  // the tool stands; the surface, which it had indented by some mm, springs back along the
  // needle
  hand.wait(0.1);
  const double yield = 1.3 * kToughness_joule_per_m2 * kWidth_m;
  EXPECT_NEAR(hand.newton(), yield + kFriction_newton_per_m * hand.depth_m(), 0.03);
  const double indented_m = kNeedle_m - z_m;
  const double left_m = hand.newton() / hand.stiffness_newton_per_m();
  EXPECT_GT(indented_m, 0.004);
  EXPECT_NEAR(hand.depth_m(), indented_m - left_m, 0.25 * indented_m);
}

TEST_F(NeedleScene, TheWorkIsToughnessTimesAreaWhatSpreadsRubsAndIsStored) {
  Hand hand(scene_);
  hand.go_to(-0.012);
  ASSERT_TRUE(hand.is_in());
  const double depth_0 = hand.depth_m();
  const double work_0 = hand.work_joule();
  const double stored_0 = hand.stored_joule();
  hand.go_to(-0.024);
  const double depth_1 = hand.depth_m();
  const double cut = kToughness_joule_per_m2 * kWidth_m * (depth_1 - depth_0);
  const double rub = 0.5 * kFriction_newton_per_m * (depth_1 * depth_1 - depth_0 * depth_0);
  const double expected = 1.3 * cut + rub + hand.stored_joule() - stored_0;
  EXPECT_GT(depth_1 - depth_0, 0.008);
  EXPECT_NEAR(hand.work_joule() - work_0, expected, 0.03 * expected);
}

TEST_F(NeedleScene, AHoleStaysAndNeedsNoMembrane) {
  Hand hand(scene_);
  hand.go_to(-0.020);
  ASSERT_TRUE(hand.is_in());
  const double deepest_m = hand.depth_m();
  hand.go_to(0.006);
  EXPECT_FALSE(hand.is_in());
  EXPECT_EQ(hand.newton(), 0.0);
  EXPECT_GE(hand.least_work_joule(), -1e-9);
  hand.wait(0.3);
  hand.start_peak();

  hand.go_to(-0.012);
  ASSERT_TRUE(hand.is_in());
  // spreads and rubs
  EXPECT_LT(hand.start_peak(), 0.06 + kFriction_newton_per_m * 0.02 + 0.08);
  EXPECT_NEAR(hand.newton(), 0.06 + kFriction_newton_per_m * hand.depth_m(), 0.03);
  hand.go_to(-0.026);
  EXPECT_GT(hand.depth_m(), deepest_m);
  EXPECT_NEAR(hand.newton(), 0.26 + kFriction_newton_per_m * hand.depth_m(), 0.03);
}

TEST_F(NeedleScene, TheForceIsThatOfFullSolutionsEveryMillisecond) {
  if (test::kIsSanitized) GTEST_SKIP() << "too slow";
  const auto elastic = ElasticTissues::of(scene_, 1, ElasticPace::kVirtual);
  ElasticReference reference(elastic_bodies_of(scene_), kNeedle_m, kNeedleTick_s, scene_.holder());
  double error2 = 0.0;
  double peak = 0.0;
  constexpr int kTicks = 2500;
  double before_m = 0.004;
  for (int tick = 0; tick < kTicks; ++tick) {
    const double time_s = kNeedleTick_s * tick;
    const double z_m = 0.004 - 0.012 * (1.0 - std::cos(2.5 * time_s));
    SceneForce force;
    elastic->step(0, {0.003, 0.002, z_m}, time_s, kNeedleReach_m, force,
                  {.velocity_m_per_s = {0, 0, (z_m - before_m) / kNeedleTick_s}});
    SceneForce ideal;
    reference.advance(time_s, {0.003, 0.002, z_m}, ideal);
    before_m = z_m;
    error2 += (force.force_on_tool_newton - ideal.force_on_tool_newton).squaredNorm();
    peak = std::max(peak, ideal.force_on_tool_newton.norm());
  }
  EXPECT_GT(peak, 0.4);
  EXPECT_LT(std::sqrt(error2 / kTicks) / peak, 0.06);
}

TEST_F(NeedleScene, ATougherPartNeedsMoreForce) {
  pierced().parts.push_back({.where = HalfSpaceGeometry{.point_m = {0, 0, -0.008}},
                             .toughness_joule_per_m2 = 2.0 * kToughness_joule_per_m2});
  Hand hand(scene_);
  hand.go_to(-0.024);
  ASSERT_TRUE(hand.is_in());
  EXPECT_NEAR(hand.newton(), 0.52 + kFriction_newton_per_m * hand.depth_m(), 0.03);
}

TEST_F(NeedleScene, NothingIsPiercedThatIsNotSaidToBe) {
  std::get<ElasticMaterial>(scene_.tissues[0].material).pierced.reset();
  Hand hand(scene_);
  hand.go_to(-0.007);
  EXPECT_FALSE(hand.is_in());
  EXPECT_GT(hand.newton(), 0.4);
}

}  // namespace
}  // namespace palpate::physics
