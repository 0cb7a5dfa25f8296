// SPDX-License-Identifier: Apache-2.0
// What a hand feels of a body that came from voxels, in the elements that a session has, beside a
// reference that shares neither mesh nor elements nor contact with it.
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "tests/bench/import/axisymmetric_ball.h"
#include "tests/bench/import/touched_sphere.h"
#include "tests/property/seeds.h"

namespace palpate::bench {
namespace {

constexpr double kYoung_pa = 5200.0;
constexpr double kLesionYoung_pa = 20'200.0;
constexpr double kCell_m = 4e-3;
constexpr double kReferenceCell_m = 0.8e-3;
constexpr double kSiteRadius_m = 0.010;
const Ball kLesion{.centre_m = {0.0, 0.0, 0.019}, .radius_m = 0.007};

physics::TetrahedralMesh of_voxels(const Vector3& voxel_m, const std::optional<Ball>& lesion) {
  return imported_ball(voxel_m, lesion, {.cell_m = kCell_m, .site_radius_m = kSiteRadius_m}).mesh;
}

double reference_newton(const std::optional<Ball>& lesion, double depth_m = kTouchDepth_m,
                        double cell_m = kReferenceCell_m) {
  AxisymmetricBall ball{
      .radius_m = kBallRadius_m, .tip_radius_m = kTouchRadius_m, .young_pa = kYoung_pa};
  if (lesion) {
    ball.lesion_young_pa = kLesionYoung_pa;
    ball.lesion_radius_m = lesion->radius_m;
    ball.lesion_z_m = lesion->centre_m.z();
  }
  return AxisymmetricPress(ball, cell_m).newton_at(depth_m);
}

// What is left of the error is that balls are no half spaces.
TEST(AxisymmetricBall, FollowsHertzWhereItIsTouchedLightlyAndConverges) {
  constexpr double kDepth_m = 0.2e-3;
  if (test::kIsSanitized) {  // the figures take minutes
    EXPECT_GT(reference_newton({}, kTouchDepth_m, 3.2e-3), 0.0);
    return;
  }
  const double radius_m = 1.0 / (1.0 / kBallRadius_m + 1.0 / kTouchRadius_m);
  const double hertz_newton =
      4.0 / 3.0 * kYoung_pa / (1.0 - 0.45 * 0.45) * std::sqrt(radius_m) * std::pow(kDepth_m, 1.5);
  EXPECT_NEAR(reference_newton({}, kDepth_m, 0.4e-3) / hertz_newton, 1.0, 0.025);
  EXPECT_NEAR(reference_newton({}, kTouchDepth_m, 1.6e-3) / reference_newton({}), 1.0, 0.02);
}

TEST(ImportedBall, HasTheForceOfTheBallThatWasVoxelisedAndNoRippleOfItsStairs) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes minutes; the code is that of the other tests";
  const auto directions = slide_over_the_top(3, 0.12);
  // around another axis of the ball the held half is as far, but for a little
  const std::vector<double> ball_newton(directions.size(), reference_newton({}));
  for (const Vector3& voxel_m : {Vector3(1.5e-3, 1.5e-3, 1.5e-3), Vector3(0.8e-3, 0.8e-3, 3e-3)}) {
    SlowTouch touch(of_voxels(voxel_m, {}), kYoung_pa, 0.0, false);

    const Felt felt = felt_of(slide_newton(touch, directions), ball_newton);

    EXPECT_NEAR(felt.error_ratio, 0.0, 0.03);
    EXPECT_LT(felt.ripple_ratio, 0.02);
    RecordProperty("ripple_percent", std::to_string(100.0 * felt.ripple_ratio));
    RecordProperty("error_percent", std::to_string(100.0 * felt.error_ratio));
  }
}

TEST(ImportedBall, FeelsStifferAboveALesionAsTheBallItselfDoes) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes minutes; the code is that of the other tests";
  const double reference = reference_newton(kLesion) / reference_newton({});
  EXPECT_GT(reference, 1.1);
  const physics::TetrahedralMesh mesh = of_voxels(Vector3::Constant(1.5e-3), kLesion);
  const auto newton = [&](double lesion_young_pa) {
    SlowTouch touch(mesh, kYoung_pa, lesion_young_pa, false);
    return touch.newton_at(Vector3::UnitZ(), kTouchDepth_m).z();
  };

  const double imported = newton(kLesionYoung_pa) / newton(kYoung_pa);

  EXPECT_NEAR(imported / reference, 1.0, 0.05);
  RecordProperty("stiffer", std::to_string(imported));
}

}  // namespace
}  // namespace palpate::bench
