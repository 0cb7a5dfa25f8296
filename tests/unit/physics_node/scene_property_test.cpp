// SPDX-License-Identifier: Apache-2.0
// Laws of the scene, for random tissues and motions.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>

#include "common/contact/contact_model.h"
#include "common/core/random.h"
#include "physics_node/scene/scene.h"
#include "tests/property/seeds.h"
#include "tests/unit/physics_node/random_scene.h"

namespace palpate::physics {
namespace {

TEST(SceneProperty, BroadPhaseLosesNoContact) {
  for (std::uint64_t seed = 1; seed <= test::seed_count(20); ++seed) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const SceneConfig config = random_scene(random, 60);
    const Scene together(config);

    for (int i = 0; i < 200; ++i) {
      const Vector3 position = random_in_cube(random, 0.1);
      const Vector3 velocity = random_in_cube(random, 0.5);
      Vector3 sum = Vector3::Zero();
      double energy_joule = 0.0;
      std::uint32_t contacts = 0;
      for (const TissueConfig& tissue : config.tissues) {
        const Scene alone({.tip_radius_m = config.tip_radius_m, .tissues = {tissue}});
        const SceneForce part = alone.evaluate(position, velocity);
        sum += part.force_on_tool_newton;
        energy_joule += part.stored_energy_joule;
        contacts += part.contact_count;
      }

      const SceneForce force = together.evaluate(position, velocity);

      EXPECT_LT((force.force_on_tool_newton - sum).norm(), 1e-9 * (1.0 + sum.norm()));
      EXPECT_NEAR(force.stored_energy_joule, energy_joule, 1e-9 * (1.0 + energy_joule));
      EXPECT_EQ(force.contact_count, contacts);
    }
  }
}

// Half-spaces, spheres, capsules, faces, edges and corners of boxes, damped in every way: inside
// the trust radius what is described is the tissue, not an approximation of it.
TEST(SceneProperty, DescribedContactIsTheTissueAsFarAsItIsTrusted) {
  Random random(7);
  int compared = 0;
  int not_yet_touching = 0;
  double furthest_m = 0.0;
  for (int i = 0; i < test::place_count(20000); ++i) {
    SCOPED_TRACE(testing::Message() << "sample " << i);
    const Scene scene(random_scene(random, 1), 0.05);
    const Vector3 x = random_in_cube(random, 0.06);
    const SceneForce here = scene.evaluate(x, random_in_cube(random, 0.5));
    if (here.listed_count == 0) continue;

    const Contact& contact = here.contacts[0];
    if (contact.trust_radius_m <= kMinTrustRadiusM) continue;  // at least that, whatever is near
    const Vector3 d =
        random.uniform(0.0, 0.99) * std::min(contact.trust_radius_m, 0.1) * random.direction();
    const Vector3 v = random_in_cube(random, 0.5);
    const SceneForce there = scene.evaluate(x + d, v);
    const ModelForce described = palpate::evaluate(contact, d, v, 0.0);

    EXPECT_EQ(described.is_touching, there.contact_count > 0);
    EXPECT_LT((described.force_on_tool_newton - there.force_on_tool_newton).norm(),
              1e-7 * (1.0 + there.force_on_tool_newton.norm()));
    EXPECT_NEAR(described.stored_energy_joule, there.stored_energy_joule,
                1e-7 * (1e-3 + there.stored_energy_joule));
    if (there.contact_count == 0) continue;
    ++compared;
    not_yet_touching += here.contact_count == 0 ? 1 : 0;
    furthest_m = std::max(furthest_m, d.norm());
  }
  EXPECT_GT(compared, test::place_count(4000));
  EXPECT_GT(not_yet_touching, test::place_count(300));
  EXPECT_GT(furthest_m, 0.05);
}

// What changes smoothly with place, as k in the shell of an inclusion, is described to first order:
// ten times nearer, a hundred times less wrong.
TEST(SceneProperty, DescribedContactOfAnInclusionIsRightToFirstOrder) {
  Random random(8);
  KelvinVoigtMaterial material{.stiffness_newton_per_m = 300.0, .stiffening_newton_per_m3 = 1e6};
  material.inclusions = {{.radius_m = 0.01, .transition_m = 0.01, .stiffness_newton_per_m = 1500}};
  const Scene scene(one_tissue(HalfSpaceGeometry{}, material), 0.01);
  double far_error2 = 0.0;
  double near_error2 = 0.0;
  for (int i = 0; i < 2000; ++i) {
    const Vector3 x(random.uniform(0.007, 0.013), 0.0, random.uniform(-0.004, -0.002));
    const SceneForce here = scene.evaluate(x, kAtRest);
    const Vector3 direction = random.direction();
    for (const double step_m : {4e-4, 4e-5}) {
      const Vector3 d = step_m * direction;
      const Vector3 error =
          palpate::evaluate(here.contacts[0], d, kAtRest, 0.0).force_on_tool_newton -
          scene.evaluate(x + d, kAtRest).force_on_tool_newton;
      (step_m > 1e-4 ? far_error2 : near_error2) += error.squaredNorm();
    }
  }
  EXPECT_GT(far_error2, 0.0);
  EXPECT_LT(std::sqrt(near_error2 / far_error2), 0.02);
}

// The elastic force is the gradient of an energy: round any closed path it does no work. Midpoint
// rule over a Lissajous loop through the faces, an edge and a corner of a box and through a sphere,
// with a tip of 10 mm radius that never goes so deep that the nearest face changes; with 20000
// points the error is ≈ (path/points)² · curvature of the force ≪ 1 nJ of some mJ stored.
TEST(SceneProperty, ElasticForceDoesNoWorkRoundAClosedPath) {
  SceneConfig config;
  config.tip_radius_m = 0.010;
  KelvinVoigtMaterial material{.stiffness_newton_per_m = 800.0, .stiffening_newton_per_m3 = 1e6};
  material.inclusions = {{.center_m = {0.0, 0.0, -0.005},
                          .radius_m = 0.02,
                          .transition_m = 0.04,
                          .stiffness_newton_per_m = 1500.0}};
  config.tissues.push_back(
      {.name = "box",
       .geometry = BoxGeometry{.center_m = {-0.03, -0.03, -0.03}, .size_m = {0.05, 0.05, 0.05}},
       .material = material});
  config.tissues.push_back(
      {.name = "sphere",
       .geometry = SphereGeometry{.center_m = {0.03, 0.0, 0.0}, .radius_m = 0.02},
       .material = material});
  const Scene scene(config);
  const auto path = [](double s) {
    const double a = 2.0 * std::numbers::pi * s;
    return Vector3(0.004 + 0.008 * std::cos(a), 0.002 + 0.008 * std::sin(2 * a),
                   0.002 + 0.008 * std::cos(3 * a + 1));
  };

  constexpr int kPoints = 20000;
  double work_joule = 0.0;
  double absolute_work_joule = 0.0;
  double most_stored_joule = 0.0;
  for (int i = 0; i < kPoints; ++i) {
    const Vector3 from = path(static_cast<double>(i) / kPoints);
    const Vector3 to = path(static_cast<double>(i + 1) / kPoints);
    const SceneForce force = scene.evaluate(0.5 * (from + to), kAtRest);
    const double step_joule = force.force_on_tool_newton.dot(to - from);
    work_joule += step_joule;
    absolute_work_joule += std::abs(step_joule);
    most_stored_joule = std::max(most_stored_joule, force.stored_energy_joule);
  }

  EXPECT_GT(most_stored_joule, 1e-3);
  EXPECT_GT(absolute_work_joule, 1e-3);
  EXPECT_NEAR(work_joule, 0.0, 1e-9);
}

// One tissue takes f·v from the tool no faster than it stores: f·v + d/dt (½kp² + ¼k₃p⁴) ≤ 0 (with
// an exponent, d/dt (k p² (p/p₁)ⁿ⁻¹ / (n + 1)) instead), ṗ = −n·v.
TEST(SceneProperty, DampingOnlyTakesPower) {
  Random random(3);
  int touched = 0;
  for (int i = 0; i < test::place_count(20000); ++i) {
    const SceneConfig config = random_scene(random, 1);
    const Vector3 v = random_in_cube(random, 2.0);
    const SceneForce force = Scene(config).evaluate(random_in_cube(random, 0.06), v);
    if (force.contact_count == 0) continue;

    ++touched;
    const auto& material = std::get<KelvinVoigtMaterial>(config.tissues[0].material);
    const Contact& contact = force.contacts[0];
    const double p = contact.penetration_m;
    const double softness = material.exponent > 0.0
                                ? std::pow(p / material.exponent_depth_m, material.exponent - 1.0)
                                : 1.0;
    const double elastic_newton = softness * material.stiffness_newton_per_m * p +
                                  material.stiffening_newton_per_m3 * p * p * p;
    const double storing_watt = -elastic_newton * contact.normal_world.dot(v);
    EXPECT_LE(force.force_on_tool_newton.dot(v) + storing_watt, 1e-9);
    if (!material.is_adhesive) {
      EXPECT_GE(force.force_on_tool_newton.dot(contact.normal_world), -1e-12);
    }
  }
  EXPECT_GT(touched, test::place_count(3000));
}

// A scene turned and moved together with the tool gives the turned force. Boxes have their axes
// along W: they are turned by quarter turns only.
TEST(SceneProperty, TurnsWithTheFrame) {
  Random random(11);
  int touched = 0;
  for (int i = 0; i < test::place_count(3000); ++i) {
    SceneConfig config = random_scene(random, 1);
    const bool is_box = std::holds_alternative<BoxGeometry>(config.tissues[0].geometry);
    const double angle = is_box ? 0.5 * std::numbers::pi * static_cast<double>(random.below(4))
                                : random.uniform(0, 6);
    const Vector3 axis =
        is_box ? Vector3(Vector3::Unit(static_cast<int>(random.below(3)))) : random.direction();
    const Matrix3 turn = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    const Vector3 shift = random_in_cube(random, 1.0);
    const Vector3 x = random_in_cube(random, 0.06);
    const Vector3 v = random_in_cube(random, 0.5);
    const SceneForce before = Scene(config).evaluate(x, v);

    Geometry& geometry = config.tissues[0].geometry;
    if (auto* half_space = std::get_if<HalfSpaceGeometry>(&geometry)) {
      half_space->point_m = turn * half_space->point_m + shift;
      half_space->normal = turn * half_space->normal;
    } else if (auto* sphere = std::get_if<SphereGeometry>(&geometry)) {
      sphere->center_m = turn * sphere->center_m + shift;
    } else if (auto* capsule = std::get_if<CapsuleGeometry>(&geometry)) {
      capsule->from_m = turn * capsule->from_m + shift;
      capsule->to_m = turn * capsule->to_m + shift;
    } else {
      auto& box = std::get<BoxGeometry>(geometry);
      box.center_m = turn * box.center_m + shift;
      box.size_m = (turn * box.size_m).cwiseAbs();
    }
    const SceneForce after = Scene(config).evaluate(turn * x + shift, turn * v);

    touched += before.contact_count > 0 ? 1 : 0;
    EXPECT_LT((after.force_on_tool_newton - turn * before.force_on_tool_newton).norm(), 1e-8);
    EXPECT_NEAR(after.stored_energy_joule, before.stored_energy_joule, 1e-9);
  }
  EXPECT_GT(touched, test::place_count(500));
}

// Magnitudes from 1e-320 to 1e308, signs, zeros, infinities and NaN.
TEST(SceneProperty, NothingNonFiniteComesOut) {
  Random random(5);
  const auto wild = [&random] {
    switch (random.below(12)) {
      case 0:
        return 0.0;
      case 1:
        return std::numeric_limits<double>::infinity();
      case 2:
        return kNaN;
      case 3:
        return random.uniform(-0.1, 0.1);
      default:
        return (random.chance(0.5) ? 1.0 : -1.0) * std::pow(10.0, random.uniform(-320, 308));
    }
  };
  int touched = 0;
  for (int i = 0; i < test::place_count(50000); ++i) {
    const Scene scene(random_scene(random, 3), 0.01);
    const Vector3 position(wild(), wild(), wild());
    const Vector3 velocity(wild(), wild(), wild());

    const SceneForce force = scene.evaluate(position, velocity);

    touched += force.contact_count > 0 ? 1 : 0;
    ASSERT_TRUE(force.force_on_tool_newton.allFinite()) << position.transpose();
    ASSERT_TRUE(std::isfinite(force.stored_energy_joule));
    for (std::size_t c = 0; c < force.listed_count; ++c) {
      ASSERT_TRUE(force.contacts[c].elastic_force_on_tool_newton.allFinite());
      ASSERT_TRUE(force.contacts[c].d_force_d_position.allFinite());
      ASSERT_TRUE(std::isfinite(force.contacts[c].penetration_m));
      ASSERT_TRUE(force.contacts[c].force_on_tool_newton.allFinite());
      ASSERT_NEAR(force.contacts[c].normal_world.norm(), 1.0, 1e-9);
    }
  }
  EXPECT_GT(touched, test::place_count(100));
}

}  // namespace
}  // namespace palpate::physics
