// SPDX-License-Identifier: Apache-2.0
// Friction between two elastic bodies.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/unit/elastic/touching/together.h"

namespace palpate::physics {
namespace {

constexpr double kMu = 0.3;

class Sheared : public testing::Test {
 protected:
  /// Two blocks between the ground and a plate that moves to and fro, and does not let go.
  SceneConfig blocks(const std::array<int, 3>& lower_cells, const std::array<int, 3>& upper_cells) {
    ElasticMaterial lower{.young_pa = 10e3, .poisson_ratio = 0.3, .viscosity_s = 0.01};
    lower.is_linear = true;
    ElasticMaterial upper = lower;
    lower.fixed = {HalfSpaceGeometry{.point_m = {0, 0, 1e-4}}};
    upper.attached = {
        {.where = HalfSpaceGeometry{.point_m = {0, 0, 1}}, .stiffness_pa_per_m = 100.0}};
    upper.touches = {{.tissue = 0, .friction_coefficient = kMu},
                     {.tissue = 2, .friction_coefficient = 10.0}};
    SceneConfig scene{
        .tip_radius_m = kPairTip_m,
        .tissues = {
            soft_box("lower",
                     box_file(folder_, "lower", {-0.03, -0.03, 0}, {0.03, 0.03, 0.02}, lower_cells),
                     lower),
            soft_box("upper",
                     box_file(folder_, "upper", {-0.025, -0.025, 0.02}, {0.025, 0.025, 0.035},
                              upper_cells),
                     upper),
            bone(HalfSpaceGeometry{.point_m = {0, 0, 0.0344}, .normal = {0, 0, -1}})}};
    scene.tissues[2].motion = {
        .amplitude_m = {0.003, 0, 0}, .frequency_hz = kFrequency_hz, .phase_rad = 0.0};
    return scene;
  }
  static constexpr double kFrequency_hz = 0.25;
  test::TempFolder folder_;
};

/// Of the friction of a pair and what it holds: all nodes.
double stored_joule(const BodyPair& pair) {
  double joule = 0.0;
  for (const BodyPair::Touch& one : pair.touches()) {
    joule += 0.5 * one.friction_newton.squaredNorm() / one.stiffness_newton_per_m;
  }
  return joule;
}

TEST_F(Sheared, ABlockOnABlockSticksUntilMuTimesThePressureAndSlipsThen) {
  struct Meshes {
    std::array<int, 3> lower;
    std::array<int, 3> upper;
  };
  double coarsest_newton = 0.0;
  for (const Meshes& meshes :
       {Meshes{{4, 4, 2}, {5, 5, 2}}, Meshes{{6, 6, 2}, {5, 5, 3}}, Meshes{{7, 7, 3}, {8, 8, 3}}}) {
    Together both(blocks(meshes.lower, meshes.upper));
    const BodyPair& pair = both.island->pairs()[0];
    both.set_time(0.0);
    for (int i = 0; i < 30; ++i) both.step();  // pressed, before it is sheared

    double most_ratio = 0.0;      // of the sum along, of mu N
    double first_newton = 0.0;    // along, of mu N, while the plate has gone 0.15 mm
    double last_newton = 0.0;     // along, of mu N, when it is farthest
    double most_imbalance = 0.0;  // of the upper block, of mu N
    double most_work = -1e9;      // of friction in a step [J]
    double dissipated = 0.0;
    double normal_newton = 0.0;
    std::vector<BodyPair::Touch> before = pair.touches();
    elastic::VectorXd before_m[2] = {both.simulations[0]->x_m(), both.simulations[1]->x_m()};
    double before_joule = stored_joule(pair);
    for (int i = 1; i <= 150; ++i) {  // to one side, to the other, and back
      const double time_s = 0.02 * i;
      both.set_time(time_s);
      both.step();
      ASSERT_TRUE(both.is_finite());
      const Vector3 on_lower = pair.force_on_first_newton();
      const Vector3 by_plate =
          both.simulations[1]->rigid().force_on_body_newton(both.simulations[1]->x_m().data());
      const double limit = kMu * -on_lower.z();
      normal_newton = -on_lower.z();
      most_ratio = std::max(most_ratio, on_lower.head<2>().norm() / limit);
      const double way_m = 0.003 * std::sin(2.0 * std::numbers::pi * kFrequency_hz * time_s);
      if (i < 10 && way_m < 0.00015) first_newton = on_lower.x() / limit / way_m * 0.00015;
      if (i == 50) last_newton = on_lower.x() / limit;
      most_imbalance = std::max(most_imbalance, (by_plate - on_lower).head<2>().norm() / limit);
      // what friction did on both bodies, and what its springs gave for it
      double work = 0.0;
      for (const BodyPair::Touch& one : pair.touches()) {
        const std::size_t own = one.is_second ? 1 : 0;
        const auto way_of = [&](std::size_t body, const elastic::SurfacePoint& point) {
          return Vector3(point.position_m(both.simulations[body]->x_m().data()) -
                         point.position_m(before_m[body].data()));
        };
        work += one.friction_newton.dot(way_of(own, one.node_point()) -
                                        way_of(1 - own, one.triangle_point()));
      }
      const double joule = stored_joule(pair);
      most_work = std::max(most_work, work + joule - before_joule);
      dissipated -= work + joule - before_joule;
      before_joule = joule;
      for (std::size_t k = 0; k < 2; ++k) before_m[k] = both.simulations[k]->x_m();
    }
    std::printf(
        "N %.3f N; along: at most %.3f, at 0.15 mm %.3f, at 3 mm %.3f of mu N; imbalance "
        "%.3f; most work in a step %.2g J, dissipated %.3g J, %.3g J on the ways of a rigid "
        "slider\n",
        normal_newton, most_ratio, first_newton, last_newton, most_imbalance, most_work, dissipated,
        kMu * normal_newton * 0.009);
    EXPECT_LE(most_ratio, 1.0 + 1e-6);
    EXPECT_LT(first_newton, 0.8);  // it sticks
    EXPECT_GT(first_newton, 0.05);
    EXPECT_GT(last_newton, 0.97);
    EXPECT_LT(most_imbalance, 0.05);
    EXPECT_LT(most_work, 1e-9);
    EXPECT_GT(dissipated, 0.5 * kMu * normal_newton * 0.009);
    EXPECT_LT(dissipated, kMu * normal_newton * 0.009);
    if (coarsest_newton == 0.0) coarsest_newton = normal_newton;
    EXPECT_NEAR(normal_newton, coarsest_newton, 0.05 * coarsest_newton);
  }
}

}  // namespace
}  // namespace palpate::physics
