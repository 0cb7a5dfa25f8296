// SPDX-License-Identifier: Apache-2.0
// Between two full solutions the force on a tool knows that the body is squeezed against bone.
#include <gtest/gtest.h>

#include <cmath>

#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "tests/property/seeds.h"
#include "tests/unit/elastic/touching/touching_scene.h"

namespace palpate::physics {
namespace {

constexpr double kLeaningTip_m = 0.006;
constexpr double kLeaningReach_m = 0.05;
constexpr double kLeaningTick_s = 1e-3;

struct Errors {
  double error = 0.0;    // root mean square over that of the reference
  double largest = 0.0;  // force of the reference
};

/// Of a tip that goes down to the depth, up again, and down at another place.
Errors errors_of(const SceneConfig& scene, double top_m, double depth_m, double speed_m_per_s) {
  const auto elastic = ElasticTissues::of(scene, 1, ElasticPace::kVirtual);
  ElasticReference reference(elastic_bodies_of(scene), kLeaningTip_m, kLeaningTick_s);
  double error2 = 0.0;
  double force2 = 0.0;
  Errors errors;
  const double period_s = 2.0 * (depth_m + 0.001) / speed_m_per_s;
  const int ticks = static_cast<int>(2.0 * period_s / kLeaningTick_s);
  for (int tick = 0; tick < ticks; ++tick) {
    const double time_s = kLeaningTick_s * tick;
    const double in_s = std::fmod(time_s, period_s);
    const double way_m = std::min(in_s, period_s - in_s) * speed_m_per_s;
    const Vector3 tip_m(time_s < period_s ? 0.0 : 0.004, 0.001,
                        top_m + kLeaningTip_m + 0.001 - way_m);
    SceneForce force;
    elastic->step(0, tip_m, time_s, kLeaningReach_m, force);
    SceneForce ideal;
    reference.advance(time_s, tip_m, ideal);
    error2 += (force.force_on_tool_newton - ideal.force_on_tool_newton).squaredNorm();
    force2 += ideal.force_on_tool_newton.squaredNorm();
    errors.largest = std::max(errors.largest, ideal.force_on_tool_newton.norm());
  }
  errors.error = std::sqrt(error2 / force2);
  return errors;
}

class Leaning : public testing::Test {
 protected:
  test::TempFolder folder_;

  /// A slab that spans over a gap, over a plate of bone.
  [[nodiscard]] SceneConfig slab(double gap_m, bool has_bone) const {
    ElasticMaterial material{.young_pa = 15e3, .poisson_ratio = 0.4, .viscosity_s = 0.005};
    material.fixed = {HalfSpaceGeometry{.point_m = {-0.0299, 0, 0}, .normal = {1, 0, 0}},
                      HalfSpaceGeometry{.point_m = {0.0299, 0, 0}, .normal = {-1, 0, 0}}};
    if (has_bone) material.touches = {{.tissue = 1}};
    const std::string file =
        box_file(folder_, "slab", {-0.03, -0.025, 0}, {0.03, 0.025, 0.012}, {6, 5, 2});
    return {.tip_radius_m = kLeaningTip_m,
            .tissues = {soft_box("slab", file, material),
                        bone(HalfSpaceGeometry{.point_m = {0, 0, -gap_m}})}};
  }
};

TEST_F(Leaning, TheForceBetweenFullSolutionsIsThatOfABodySqueezedBetweenTipAndBone) {
  const SceneConfig on_bone = slab(0.0, true);
  const Errors errors = errors_of(on_bone, 0.012, 0.004, 0.04);
  const Errors free = errors_of(slab(0.0, false), 0.012, 0.004, 0.04);
  std::printf("on bone: error %.1f %%, %.2f N; hanging: %.1f %%, %.2f N\n", 1e2 * errors.error,
              errors.largest, 1e2 * free.error, free.largest);
  EXPECT_GT(errors.largest, 1.2 * free.largest);  // it is stiffer
  EXPECT_LT(errors.error, 0.08);
}

TEST_F(Leaning, ItIsRightAgainWhenTheContactOpensAndCloses) {
  const Errors errors = errors_of(slab(0.0015, true), 0.012, 0.005, 0.05);
  std::printf("over a gap: error %.1f %%, %.2f N\n", 1e2 * errors.error, errors.largest);
  EXPECT_LT(errors.error, 0.10);
}

}  // namespace
}  // namespace palpate::physics
