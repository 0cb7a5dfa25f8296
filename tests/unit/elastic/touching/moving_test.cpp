// SPDX-License-Identifier: Apache-2.0
// What an elastic body lies on moves, as with breath: the body follows, presses, and is felt so.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "tests/unit/elastic/touching/touching_scene.h"

namespace palpate::physics {
namespace {

constexpr double kCarriedTip_m = 0.006;
constexpr double kCarriedReach_m = 0.05;
constexpr double kCarriedTick_s = 1e-3;
constexpr double kHeight_m = 0.02;

class Carrying : public testing::Test {
 protected:
  /// A block on a plate, that hardly anything else holds.
  SceneConfig block_on_plate(const TissueMotionConfig& motion, double friction_coefficient,
                             const Vector3& gravity_m_per_s2) {
    ElasticMaterial material{.young_pa = 15e3, .poisson_ratio = 0.4, .viscosity_s = 0.005};
    material.is_linear = true;
    material.gravity_m_per_s2 = gravity_m_per_s2;
    material.attached = {
        {.where = HalfSpaceGeometry{.point_m = {0, 0, 1}}, .stiffness_pa_per_m = kSpring_pa_per_m}};
    material.touches = {{.tissue = 1, .friction_coefficient = friction_coefficient}};
    SceneConfig scene{.tip_radius_m = kCarriedTip_m,
                      .tissues = {soft_box("block",
                                           box_file(folder_, "block", {-0.025, -0.025, 0},
                                                    {0.025, 0.025, kHeight_m}, {6, 6, 3}),
                                           material),
                                  bone(HalfSpaceGeometry{})}};
    scene.tissues[1].motion = motion;
    return scene;
  }
  static constexpr double kSpring_pa_per_m = 500.0;
  test::TempFolder folder_;
};

double phase_of(const TissueMotionConfig& motion, double time_s) {
  return std::sin(2.0 * std::numbers::pi * motion.frequency_hz * time_s + motion.phase_rad);
}

// The springs, 500 Pa/m on all six faces, 3 mm stretched: 11·10⁻³ m² · 500 · 0.003 = 16 mN, against
// 0.48 N of weight and a stiffness of A E/H = 1.9 kN/m below: they change its height by 0.01 mm.
TEST_F(Carrying, ABlockOnAPlateThatMovesSlowlyFollowsIt) {
  const TissueMotionConfig motion{
      .amplitude_m = {0.002, -0.001, 0.003}, .frequency_hz = 0.25, .phase_rad = 0.4};
  const auto body = elastic_bodies_of(block_on_plate(motion, 1.0, {0, 0, -9.81}))[0];
  ElasticSimulation simulation(*body, 0, kCarriedTip_m, 0.02);
  double farthest_m = 0.0;
  double deepest_m = 0.0;
  for (int i = 0; i < 220; ++i) {
    const double time_s = 100.0 + 0.02 * i;
    simulation.set_time(time_s);
    EXPECT_TRUE(simulation.step({}));  // what moves keeps it awake
    const Vector3 expected_m = phase_of(motion, time_s) * motion.amplitude_m;
    for (const std::uint32_t node : body->surface_nodes) {
      const Eigen::Index at = 3 * Eigen::Index{node};
      const Vector3 way_m = simulation.x_m().segment<3>(at) - body->start_m.segment<3>(at);
      farthest_m = std::max(farthest_m, (way_m - expected_m).norm());
    }
    deepest_m = std::max(deepest_m, simulation.rigid().deepest_m(simulation.x_m().data()));
  }
  std::printf("carried: %.4f mm from the plate's way, deepest %.4f mm\n", 1e3 * farthest_m,
              1e3 * deepest_m);
  EXPECT_LT(farthest_m, 6e-5);
  EXPECT_LT(deepest_m, 2e-5);
}

TEST_F(Carrying, ABodySleepsWhileThePlateStandsStillAndWakesWhenItMoves) {
  const TissueMotionConfig motion{.amplitude_m = {0, 0, 0.003}, .frequency_hz = 0.25};
  const auto body = elastic_bodies_of(block_on_plate(motion, 0.0, {0, 0, -9.81}))[0];
  ElasticSimulation simulation(*body, 0, kCarriedTip_m, 0.02);
  simulation.set_time(7.3);
  int steps = 0;
  while (simulation.step({}) && steps < 300) ++steps;
  EXPECT_LT(steps, 300);
  EXPECT_FALSE(simulation.step({}));

  simulation.set_time(7.32);
  EXPECT_TRUE(simulation.step({}));
}

// Seen from the plate, a tool that stands still above a plate that rises is one that comes down on
// a plate at rest: so the plate's motion adds nothing to the error of the force between solutions.
TEST_F(Carrying, AToolThatRestsOnTopFeelsThePlateMove) {
  struct Case {
    double amplitude_m;
    double depth_m;
    double most_error;  // rms, of the force
  };
  for (const Case& one : {Case{0.001, 0.004, 0.03}, Case{0.004, 0.001, 0.12}}) {
    const TissueMotionConfig motion{.amplitude_m = {0, 0, one.amplitude_m}, .frequency_hz = 0.5};
    const Vector3 gravity(0, 0, -9.81);
    const SceneConfig at_rest = block_on_plate({}, 0.0, gravity);
    const auto still = ElasticTissues::of(at_rest, 1, ElasticPace::kVirtual);
    ElasticReference reference(elastic_bodies_of(at_rest), kCarriedTip_m, kCarriedTick_s);
    const auto moving =
        ElasticTissues::of(block_on_plate(motion, 0.0, gravity), 1, ElasticPace::kVirtual);
    double error2 = 0.0;
    double still_error2 = 0.0;
    double force2 = 0.0;
    double of_velocity_m_per_s = 0.0;
    const double fastest_m_per_s = 2.0 * std::numbers::pi * motion.frequency_hz * one.amplitude_m;
    for (int tick = 0; tick < 4500; ++tick) {
      const double time_s = kCarriedTick_s * tick;
      // the tool comes down within half a second, and stays
      const double down_m = std::min(1.0, time_s / 0.5) * (0.008 + one.depth_m);
      const Vector3 tip_m(0.001, 0.002, kHeight_m + kCarriedTip_m + 0.008 - down_m);
      const Vector3 seen_m = tip_m - phase_of(motion, time_s) * motion.amplitude_m;
      SceneForce force;
      moving->step(0, tip_m, time_s, kCarriedReach_m, force);
      SceneForce without;
      still->step(0, seen_m, time_s, kCarriedReach_m, without);
      SceneForce ideal;
      reference.advance(time_s, seen_m, ideal);
      if (time_s < 0.5) continue;
      error2 += (force.force_on_tool_newton - ideal.force_on_tool_newton).squaredNorm();
      still_error2 += (without.force_on_tool_newton - ideal.force_on_tool_newton).squaredNorm();
      force2 += ideal.force_on_tool_newton.squaredNorm();
      if (force.contacts[0].penetration_m > 0.0) {
        const double expected =
            fastest_m_per_s * std::cos(2.0 * std::numbers::pi * motion.frequency_hz * time_s);
        of_velocity_m_per_s =
            std::max(of_velocity_m_per_s,
                     std::abs(force.contacts[0].surface_velocity_world_m_per_s.z() - expected));
      }
    }
    const double error = std::sqrt(error2 / force2);
    const double still_error = std::sqrt(still_error2 / force2);
    std::printf(
        "a plate that moves by %.0f mm: error %.1f %%, as at rest %.1f %%; of the velocity "
        "%.2f %%; %.2f N\n",
        1e3 * one.amplitude_m, 1e2 * error, 1e2 * still_error,
        1e2 * of_velocity_m_per_s / fastest_m_per_s, std::sqrt(force2 / 4000));
    EXPECT_LT(error, one.most_error);
    EXPECT_LT(error, still_error + 0.01);
    EXPECT_LT(of_velocity_m_per_s, 0.01 * fastest_m_per_s);
  }
}

}  // namespace
}  // namespace palpate::physics
