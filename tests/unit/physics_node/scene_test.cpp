#include "physics_node/scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>

#include "common/core/random.h"
#include "tests/unit/physics_node/random_scene.h"

namespace palpate::physics {
namespace {

const Vector3 kAtRest = Vector3::Zero();

SceneConfig one_tissue(const Geometry& geometry, const Material& material,
                       double tip_radius_m = 0.0) {
  return {.tip_radius_m = tip_radius_m,
          .tissues = {{.name = "tissue", .geometry = geometry, .material = material}}};
}

// 500 N/m, 2 N·s/m below z = 0.
Scene floor_scene(bool is_damping_isotropic, bool is_adhesive, double tip_radius_m = 0.0) {
  return Scene(one_tissue(HalfSpaceGeometry{},
                          KelvinVoigtMaterial{.stiffness_newton_per_m = 500.0,
                                              .damping_newton_s_per_m = 2.0,
                                              .is_damping_isotropic = is_damping_isotropic,
                                              .is_adhesive = is_adhesive},
                          tip_radius_m));
}

// k p = 500·0.01 = 5 N, b ṗ = 2·0.1 = 0.2 N, ½ k p² = 0.025 J.
TEST(Scene, AnswersPenetrationAndItsRateAlongTheNormal) {
  const SceneForce force = floor_scene(false, false).evaluate({0.3, 0.4, -0.01}, {7.0, 0.0, -0.1});

  EXPECT_LT((force.force_on_tool_newton - Vector3(0, 0, 5.2)).norm(), 1e-12);
  EXPECT_NEAR(force.stored_energy_joule, 0.025, 1e-15);
  ASSERT_EQ(force.contact_count, 1U);
  EXPECT_EQ(force.contacts[0].tissue, 0U);
  EXPECT_NEAR(force.contacts[0].penetration_m, 0.01, 1e-15);
  EXPECT_EQ(force.contacts[0].normal_world, Vector3(0, 0, 1));
  EXPECT_EQ(force.contacts[0].force_on_tool_newton, force.force_on_tool_newton);
}

// Tip of 5 mm radius, centre 2 mm above the surface: 3 mm deep, 1.5 N.
TEST(Scene, CountsPenetrationFromTheSurfaceOfTheTip) {
  const SceneForce force = floor_scene(false, false, 0.005).evaluate({0, 0, 0.002}, kAtRest);

  EXPECT_NEAR(force.contacts[0].penetration_m, 0.003, 1e-15);
  EXPECT_NEAR(force.force_on_tool_newton.z(), 1.5, 1e-12);
}

// Leaving at 3 m/s, 10 mm deep: 5 − 2·3 = −1 N.
TEST(Scene, PullsOnlyWhereTheTissueIsAdhesive) {
  const Vector3 position(0, 0, -0.01);
  const Vector3 leaving(0, 0, 3);

  EXPECT_EQ(floor_scene(false, false).evaluate(position, leaving).force_on_tool_newton,
            Vector3(0, 0, 0));
  EXPECT_NEAR(floor_scene(false, true).evaluate(position, leaving).force_on_tool_newton.z(), -1.0,
              1e-12);
}

TEST(Scene, KeepsEnergyAndContactWhileThePullIsCutOff) {
  const SceneForce force = floor_scene(false, false).evaluate({0, 0, -0.01}, {0, 0, 3});

  EXPECT_EQ(force.contact_count, 1U);
  EXPECT_NEAR(force.stored_energy_joule, 0.025, 1e-15);
  EXPECT_EQ(force.d_force_d_position, Matrix3(Matrix3::Zero()));
  EXPECT_EQ(force.d_force_d_velocity, Matrix3(Matrix3::Zero()));
}

// Along the surface −b v_t = (−2·0.3, +2·0.4) N, whatever happens along the normal.
TEST(Scene, DampsMotionAlongTheSurfaceWhereDampingIsIsotropic) {
  const Scene scene = floor_scene(true, false);

  const Vector3 pressed = scene.evaluate({0, 0, -0.01}, {0.3, -0.4, 0}).force_on_tool_newton;
  const Vector3 cut_off = scene.evaluate({0, 0, -0.01}, {0.3, -0.4, 3}).force_on_tool_newton;

  EXPECT_LT((pressed - Vector3(-0.6, 0.8, 5)).norm(), 1e-12);
  EXPECT_LT((cut_off - Vector3(-0.6, 0.8, 0)).norm(), 1e-12);
}

TEST(Scene, IsExactlyZeroWithoutPenetration) {
  const Scene scene = floor_scene(true, true);

  for (const double z : {0.0, 1e-300, 0.01}) {
    const SceneForce force = scene.evaluate({0, 0, z}, {1, 2, 3});
    EXPECT_EQ(force.force_on_tool_newton, Vector3(0, 0, 0)) << z;
    EXPECT_EQ(force.d_force_d_position, Matrix3(Matrix3::Zero()));
    EXPECT_EQ(force.d_force_d_velocity, Matrix3(Matrix3::Zero()));
    EXPECT_EQ(force.stored_energy_joule, 0.0);
    EXPECT_EQ(force.contact_count, 0U);
  }
}

// Box of half edges 10 mm, tip of 5 mm radius 3 and 4 mm beyond the edge's faces would just touch;
// at (1.8, 2.4) mm the edge is 3 mm away: 2 mm deep, 1000 N/m → 2 N along (0.6, 0.8).
TEST(Scene, PushesTheTipAwayFromAnEdge) {
  const Scene scene(one_tissue(BoxGeometry{.size_m = {0.02, 0.02, 0.02}},
                               KelvinVoigtMaterial{.stiffness_newton_per_m = 1000.0}, 0.005));

  const Vector3 touching = scene.evaluate({0.0118, 0.0124, 0}, kAtRest).force_on_tool_newton;

  EXPECT_LT((touching - Vector3(1.2, 1.6, 0)).norm(), 1e-9);
  EXPECT_EQ(scene.evaluate({0.01301, 0.01401, 0}, kAtRest).contact_count, 0U);
  EXPECT_EQ(scene.evaluate({0.01299, 0.01399, 0}, kAtRest).contact_count, 1U);
}

// At a sphere's centre: as deep as it gets, upwards.
TEST(Scene, PushesUpwardsAtTheCentreOfASphere) {
  const Scene scene(one_tissue(SphereGeometry{.radius_m = 0.01},
                               KelvinVoigtMaterial{.stiffness_newton_per_m = 100.0}, 0.002));

  const SceneForce force = scene.evaluate({0, 0, 0}, kAtRest);

  EXPECT_NEAR(force.contacts[0].penetration_m, 0.012, 1e-15);
  EXPECT_LT((force.force_on_tool_newton - Vector3(0, 0, 1.2)).norm(), 1e-12);
}

TEST(Scene, AddsTheForcesOfAllTissues) {
  // two floors, 10 mm and 4 mm deep: 500·0.01 + 50·0.004 = 5.2 N, 0.025 + 0.0004 J
  SceneConfig config =
      one_tissue(HalfSpaceGeometry{}, KelvinVoigtMaterial{.stiffness_newton_per_m = 500.0});
  config.tissues.push_back({.name = "lower",
                            .geometry = HalfSpaceGeometry{.point_m = {0, 0, -0.006}},
                            .material = KelvinVoigtMaterial{.stiffness_newton_per_m = 50.0}});

  const Scene scene(config);
  const SceneForce force = scene.evaluate({0, 0, -0.01}, kAtRest);

  EXPECT_EQ(scene.tissue_count(), 2U);
  EXPECT_NEAR(force.force_on_tool_newton.z(), 5.2, 1e-12);
  EXPECT_NEAR(force.stored_energy_joule, 0.0254, 1e-15);
}

TEST(Scene, ListsTheDeepestContactsFirstAndCountsAll) {
  // twelve floors at different heights, in a shuffled order
  SceneConfig config;
  for (int i = 0; i < 12; ++i) {
    const double top_m = -0.001 * ((i * 5) % 12);
    config.tissues.push_back({.name = std::to_string(i),
                              .geometry = HalfSpaceGeometry{.point_m = {0, 0, top_m}},
                              .material = KelvinVoigtMaterial{}});
  }

  const SceneForce force = Scene(config).evaluate({0, 0, -0.02}, kAtRest);

  ASSERT_EQ(force.contact_count, 12U);
  for (std::size_t i = 0; i < kMaxContacts; ++i) {
    // the floor whose top is i mm down: index j with 5 j = i (mod 12), and 5·5 = 1 (mod 12)
    EXPECT_EQ(force.contacts[i].tissue, 5 * i % 12);
    EXPECT_NEAR(force.contacts[i].penetration_m, 0.02 - 0.001 * static_cast<double>(i), 1e-15);
  }
}

TEST(Scene, ListsEquallyDeepContactsByTissue) {
  SceneConfig config;
  for (int i = 0; i < 10; ++i) {
    config.tissues.push_back({.name = std::to_string(i),
                              .geometry = SphereGeometry{.radius_m = 0.01},
                              .material = KelvinVoigtMaterial{}});
  }

  const SceneForce force = Scene(config).evaluate({0, 0, 0.005}, kAtRest);

  for (std::uint32_t i = 0; i < kMaxContacts; ++i) EXPECT_EQ(force.contacts[i].tissue, i);
}

TEST(Scene, WithoutTissueGivesNothing) {
  const SceneForce force = Scene(SceneConfig{}).evaluate({0, 0, 0}, {1, 1, 1});

  EXPECT_EQ(force.force_on_tool_newton, Vector3(0, 0, 0));
  EXPECT_EQ(force.tissues_skipped, 0U);
}

TEST(SceneBroadPhase, StepsOverEveryTissueThatIsFar) {
  // a row of 100 spheres of 4 mm radius every 10 mm; the tip of 0.5 mm radius is at number 42
  SceneConfig config;
  config.tip_radius_m = 0.0005;
  for (int i = 0; i < 100; ++i) {
    config.tissues.push_back(
        {.name = std::to_string(i),
         .geometry = SphereGeometry{.center_m = {0.01 * i, 0, 0}, .radius_m = 0.004},
         .material = KelvinVoigtMaterial{}});
  }
  const Scene scene(config);

  const SceneForce near = scene.evaluate({0.42, 0.0044, 0}, kAtRest);

  ASSERT_EQ(near.contact_count, 1U);
  EXPECT_EQ(near.contacts[0].tissue, 42U);
  EXPECT_EQ(near.tissues_skipped, 99U);
  EXPECT_EQ(scene.evaluate({0.42, 0.1, 0}, kAtRest).tissues_skipped, 100U);
}

TEST(SceneProperty, BroadPhaseLosesNoContact) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
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

// A force with a kink or jump between the samples (edge of contact, cut-off, another face) cannot
// be differenced; such places are recognised by a one-sided difference that disagrees with the
// other.
TEST(SceneProperty, JacobiansMatchFiniteDifferences) {
  constexpr double kStep_m = 1e-7;
  constexpr double kStep_m_per_s = 1e-5;
  Random random(7);
  int differences = 0;
  int compared = 0;
  for (int i = 0; i < 10000; ++i) {
    SCOPED_TRACE(testing::Message() << "sample " << i);
    const Scene scene(random_scene(random, 1));
    const Vector3 x = random_in_cube(random, 0.06);
    const Vector3 v = random_in_cube(random, 0.5);
    const SceneForce force = scene.evaluate(x, v);
    if (force.contact_count == 0) continue;

    const double stiffness_scale = 1.0 + force.d_force_d_position.norm();
    const double damping_scale = 1.0 + force.d_force_d_velocity.norm();
    differences += 6;
    for (int axis = 0; axis < 3; ++axis) {
      const auto f = [&](const Vector3& dx, const Vector3& dv) {
        return scene.evaluate(x + dx, v + dv).force_on_tool_newton;
      };
      const Vector3 f0 = force.force_on_tool_newton;
      const Vector3 dx = kStep_m * Vector3::Unit(axis);
      const Vector3 ahead_x = (f(dx, kAtRest) - f0) / kStep_m;
      const Vector3 behind_x = (f0 - f(-dx, kAtRest)) / kStep_m;
      if ((ahead_x - behind_x).norm() < 1e-2 * stiffness_scale) {
        ++compared;
        EXPECT_LT((force.d_force_d_position.col(axis) - 0.5 * (ahead_x + behind_x)).norm(),
                  1e-4 * stiffness_scale);
      }
      const Vector3 dv = kStep_m_per_s * Vector3::Unit(axis);
      const Vector3 ahead_v = (f(kAtRest, dv) - f0) / kStep_m_per_s;
      const Vector3 behind_v = (f0 - f(kAtRest, -dv)) / kStep_m_per_s;
      if ((ahead_v - behind_v).norm() < 1e-4 * damping_scale) {
        ++compared;
        EXPECT_LT((force.d_force_d_velocity.col(axis) - 0.5 * (ahead_v + behind_v)).norm(),
                  1e-6 * damping_scale);
      }
    }
  }
  EXPECT_GT(differences, 10000);
  EXPECT_GT(compared, 0.99 * differences);
}

// The elastic force is the gradient of an energy: round any closed path it does no work. Midpoint
// rule over a Lissajous loop through the faces, an edge and a corner of a box and through a sphere,
// with a tip of 10 mm radius that never goes so deep that the nearest face changes; with 20000
// points the error is ≈ (path/points)² · curvature of the force ≪ 1 nJ of some mJ stored.
TEST(SceneProperty, ElasticForceDoesNoWorkRoundAClosedPath) {
  SceneConfig config;
  config.tip_radius_m = 0.010;
  const KelvinVoigtMaterial material{.stiffness_newton_per_m = 800.0};
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

// One tissue takes f·v from the tool no faster than it stores: f·v + d/dt ½kp² ≤ 0, ṗ = −n·v.
TEST(SceneProperty, DampingOnlyTakesPower) {
  Random random(3);
  int touched = 0;
  for (int i = 0; i < 20000; ++i) {
    const SceneConfig config = random_scene(random, 1);
    const Vector3 v = random_in_cube(random, 2.0);
    const SceneForce force = Scene(config).evaluate(random_in_cube(random, 0.06), v);
    if (force.contact_count == 0) continue;

    ++touched;
    const auto& material = std::get<KelvinVoigtMaterial>(config.tissues[0].material);
    const Contact& contact = force.contacts[0];
    const double storing_watt =
        -material.stiffness_newton_per_m * contact.penetration_m * contact.normal_world.dot(v);
    EXPECT_LE(force.force_on_tool_newton.dot(v) + storing_watt, 1e-9);
    if (!material.is_adhesive) {
      EXPECT_GE(force.force_on_tool_newton.dot(contact.normal_world), -1e-12);
    }
  }
  EXPECT_GT(touched, 3000);
}

// A scene turned and moved together with the tool gives the turned force. Boxes have their axes
// along W: they are turned by quarter turns only.
TEST(SceneProperty, TurnsWithTheFrame) {
  Random random(11);
  int touched = 0;
  for (int i = 0; i < 3000; ++i) {
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
    EXPECT_LT(
        (after.d_force_d_position - turn * before.d_force_d_position * turn.transpose()).norm(),
        1e-6 * (1.0 + before.d_force_d_position.norm()));
    EXPECT_LT(
        (after.d_force_d_velocity - turn * before.d_force_d_velocity * turn.transpose()).norm(),
        1e-9 * (1.0 + before.d_force_d_velocity.norm()));
    EXPECT_NEAR(after.stored_energy_joule, before.stored_energy_joule, 1e-9);
  }
  EXPECT_GT(touched, 500);
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
  for (int i = 0; i < 50000; ++i) {
    const Scene scene(random_scene(random, 3));
    const Vector3 position(wild(), wild(), wild());
    const Vector3 velocity(wild(), wild(), wild());

    const SceneForce force = scene.evaluate(position, velocity);

    touched += force.contact_count > 0 ? 1 : 0;
    ASSERT_TRUE(force.force_on_tool_newton.allFinite()) << position.transpose();
    ASSERT_TRUE(force.d_force_d_position.allFinite()) << position.transpose();
    ASSERT_TRUE(force.d_force_d_velocity.allFinite());
    ASSERT_TRUE(std::isfinite(force.stored_energy_joule));
    for (std::size_t c = 0; c < std::min<std::size_t>(force.contact_count, kMaxContacts); ++c) {
      ASSERT_TRUE(std::isfinite(force.contacts[c].penetration_m));
      ASSERT_TRUE(force.contacts[c].force_on_tool_newton.allFinite());
      ASSERT_NEAR(force.contacts[c].normal_world.norm(), 1.0, 1e-9);
    }
  }
  EXPECT_GT(touched, 100);
}

TEST(Scene, TreatsATeleportBeyondAllNumbersAsNoTouch) {
  const SceneForce force = floor_scene(true, true).evaluate({0, 0, -1e200}, kAtRest);

  EXPECT_EQ(force.force_on_tool_newton, Vector3(0, 0, 0));
  EXPECT_EQ(force.stored_energy_joule, 0.0);
  EXPECT_EQ(force.contact_count, 0U);
}

}  // namespace
}  // namespace palpate::physics
