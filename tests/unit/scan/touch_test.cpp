// SPDX-License-Identifier: Apache-2.0
// What a hand feels of a body that came from voxels. Linear elements, so that it takes seconds:
// import_bench has the same with the quadratic elements of a session.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/bench/import/touched_sphere.h"

namespace palpate::bench {
namespace {

constexpr double kYoung_pa = 5200.0;
constexpr double kCell_m = 2e-3;
constexpr double kSiteRadius_m = 0.010;

physics::TetrahedralMesh of_voxels(const Vector3& voxel_m, const std::optional<Ball>& lesion,
                                   double cell_m) {
  return imported_ball(voxel_m, lesion, {.cell_m = cell_m, .site_radius_m = kSiteRadius_m}).mesh;
}

TEST(ImportedBall, HasTheForceOfTheBallThatWasVoxelisedAndNoRippleOfItsStairs) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "takes minutes with sanitizers";
#endif
  const auto directions = slide_over_the_top(7, 0.12);
  SlowTouch ball(analytic_ball({}, kCell_m, kSiteRadius_m), kYoung_pa, 0.0, true);
  const std::vector<double> reference_newton = slide_newton(ball, directions);
  for (const Vector3& voxel_m : {Vector3(1.5e-3, 1.5e-3, 1.5e-3), Vector3(0.8e-3, 0.8e-3, 3e-3)}) {
    SlowTouch touch(of_voxels(voxel_m, {}, kCell_m), kYoung_pa, 0.0, true);

    const Felt felt = felt_of(slide_newton(touch, directions), reference_newton);

    EXPECT_NEAR(felt.error_ratio, 0.0, 0.03);
    EXPECT_LT(felt.ripple_ratio, 0.02);
    RecordProperty("ripple_percent", std::to_string(100.0 * felt.ripple_ratio));
    RecordProperty("error_percent", std::to_string(100.0 * felt.error_ratio));
  }
}

TEST(ImportedBall, FeelsStifferAboveALesionAsTheBallItselfOnAFinerMeshDoes) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "takes minutes with sanitizers";
#endif
  const Ball lesion{.centre_m = {0.0, 0.0, 0.019}, .radius_m = 0.007};
  const auto stiffer_ratio = [](const physics::TetrahedralMesh& mesh) {
    const auto newton = [&](double lesion_young_pa) {
      SlowTouch touch(mesh, kYoung_pa, lesion_young_pa, true);
      return touch.newton_at(Vector3::UnitZ(), kTouchDepth_m).z();
    };
    return newton(20'200.0) / newton(kYoung_pa);
  };
  const double reference = stiffer_ratio(analytic_ball(lesion, 1.8e-3, kSiteRadius_m));
  EXPECT_GT(reference, 1.1);

  const double imported = stiffer_ratio(of_voxels(Vector3::Constant(1.5e-3), lesion, 2.8e-3));

  EXPECT_NEAR(imported / reference, 1.0, 0.05);
}

// One point in the middle of each curved face lets the face go into the tip beside it: a third of
// the force was missing.
TEST(QuadraticBall, IsFeltThroughThePointsOfASessionAsThroughManyMore) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "takes minutes with sanitizers";
#endif
  const physics::TetrahedralMesh mesh = analytic_ball({}, 4.5e-3, kSiteRadius_m);
  SlowTouch many(mesh, kYoung_pa, 0.0, false);
  SlowTouch few(mesh, kYoung_pa, 0.0, false, true);
  for (const Vector3& direction : slide_over_the_top(3, 0.12)) {
    const double reference_newton = many.newton_at(direction, kTouchDepth_m).dot(direction);
    EXPECT_NEAR(few.newton_at(direction, kTouchDepth_m).dot(direction) / reference_newton, 1.0,
                0.05);
  }
}

}  // namespace
}  // namespace palpate::bench
