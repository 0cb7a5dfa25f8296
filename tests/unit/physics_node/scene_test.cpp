#include "physics_node/scene/scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>

#include "common/contact/contact_model.h"
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

// Half-spaces, spheres, capsules, faces, edges and corners of boxes, damped in every way: inside
// the trust radius what is described is the tissue, not an approximation of it.
TEST(SceneProperty, DescribedContactIsTheTissueAsFarAsItIsTrusted) {
  Random random(7);
  int compared = 0;
  int not_yet_touching = 0;
  double furthest_m = 0.0;
  for (int i = 0; i < 20000; ++i) {
    SCOPED_TRACE(testing::Message() << "sample " << i);
    const Scene scene(random_scene(random, 1), 0.05);
    const Vector3 x = random_in_cube(random, 0.06);
    const SceneForce here = scene.evaluate(x, random_in_cube(random, 0.5));
    if (here.listed_count == 0) continue;

    const Contact& contact = here.contacts[0];
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
  EXPECT_GT(compared, 4000);
  EXPECT_GT(not_yet_touching, 300);
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

// One tissue takes f·v from the tool no faster than it stores: f·v + d/dt (½kp² + ¼k₃p⁴) ≤ 0, ṗ =
// −n·v.
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
    const double p = contact.penetration_m;
    const double elastic_newton =
        material.stiffness_newton_per_m * p + material.stiffening_newton_per_m3 * p * p * p;
    const double storing_watt = -elastic_newton * contact.normal_world.dot(v);
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
  EXPECT_GT(touched, 100);
}

// --- tissue that is near, stiffens, relaxes, moves -----------------------------------------------

// Reach 10 mm: described from 10 mm above on, without force.
TEST(Scene, DescribesWhatIsAboutToBeTouched) {
  const Scene scene(one_tissue(HalfSpaceGeometry{}, KelvinVoigtMaterial{}), 0.01);

  const SceneForce near = scene.evaluate({0, 0, 0.0099}, {0, 0, -1});
  const SceneForce far = scene.evaluate({0, 0, 0.0101}, {0, 0, -1});

  ASSERT_EQ(near.listed_count, 1U);
  EXPECT_EQ(near.contact_count, 0U);
  EXPECT_NEAR(near.contacts[0].penetration_m, -0.0099, 1e-15);
  EXPECT_EQ(near.contacts[0].force_on_tool_newton, Vector3(0, 0, 0));
  EXPECT_EQ(near.force_on_tool_newton, Vector3(0, 0, 0));
  EXPECT_EQ(near.stored_energy_joule, 0.0);
  EXPECT_EQ(far.listed_count, 0U);
}

TEST(Scene, ListsTouchesBeforeWhatIsNear) {
  SceneConfig config;
  for (int i = 0; i < 12; ++i) {  // floors at −6, −5 … 5 mm: six of them above the tip
    config.tissues.push_back({.name = std::to_string(i),
                              .geometry = HalfSpaceGeometry{.point_m = {0, 0, 1e-3 * (i - 6)}},
                              .material = KelvinVoigtMaterial{}});
  }

  const SceneForce force = Scene(config, 0.05).evaluate({0, 0, -0.0005}, kAtRest);

  EXPECT_EQ(force.contact_count, 6U);
  ASSERT_EQ(force.listed_count, kMaxContacts);
  EXPECT_EQ(force.contacts[0].tissue, 11U);
  EXPECT_EQ(force.contacts[5].tissue, 6U);
  EXPECT_EQ(force.contacts[6].tissue, 5U);  // 0.5 mm away
  EXPECT_EQ(force.contacts[7].tissue, 4U);
}

// 300 p + 1e7 p³ at 5 mm: 1.5 + 1.25 N; ½ 300 p² + ¼ 1e7 p⁴ = 3.75 + 1.5625 mJ.
TEST(Scene, StiffensWithTheCubeOfThePenetration) {
  const Scene scene(one_tissue(
      HalfSpaceGeometry{},
      KelvinVoigtMaterial{.stiffness_newton_per_m = 300.0, .stiffening_newton_per_m3 = 1e7}));

  const SceneForce force = scene.evaluate({0, 0, -0.005}, kAtRest);

  EXPECT_NEAR(force.force_on_tool_newton.z(), 2.75, 1e-12);
  EXPECT_NEAR(force.stored_energy_joule, 5.3125e-3, 1e-15);
}

// k 200 and k₁ 400 N/m, τ 0.1 s, pressed 10 mm within 1 ms and held: 6 N less what k₁ relaxed on
// the way (z(1 ms) = p − (p/T) τ (1 − e^(−T/τ)) = 0.0498 mm for T = 1 ms), then k₁ falls as
// e^(−t/τ).
TEST(Scene, RelaxesUnderASteadyPress) {
  const Scene scene(
      one_tissue(HalfSpaceGeometry{}, KelvinVoigtMaterial{.stiffness_newton_per_m = 200.0,
                                                          .relaxing_stiffness_newton_per_m = 400.0,
                                                          .relaxation_time_s = 0.1}));
  const Vector3 pressed(0, 0, -0.01);
  TissueMemory memory = scene.new_memory();
  const auto newton = [&](double time_s) {
    scene.remember(memory, pressed, time_s);
    return scene.evaluate(pressed, kAtRest, time_s, memory).force_on_tool_newton.z();
  };
  scene.remember(memory, {0, 0, 0}, 0.0);

  const double stretch_m = 10.0 * 0.1 * (1.0 - std::exp(-0.01));  // (p/T) τ (1 − e^(−T/τ))
  EXPECT_NEAR(newton(0.001), 2.0 + 400.0 * stretch_m, 1e-9);
  EXPECT_NEAR(newton(0.101), 2.0 + 400.0 * stretch_m * std::exp(-1.0), 1e-9);
  EXPECT_NEAR(newton(5.0), 2.0, 1e-9);

  // let go, and it comes back with the same time constant
  scene.remember(memory, {0, 0, 0.01}, 5.0 + 1e-9);
  scene.remember(memory, {0, 0, 0.01}, 5.1);
  scene.remember(memory, pressed, 5.1 + 1e-9);
  EXPECT_NEAR(scene.evaluate(pressed, kAtRest, 5.1 + 1e-9, memory).force_on_tool_newton.z(),
              2.0 + 400.0 * 0.01 * (1.0 - std::exp(-1.0)), 1e-6);
}

// Three that relax, 20 cm apart: one is pressed and lifted. After 60 time constants nothing is left
// of what it remembers, 1e-2 · e^−60 m, and it sleeps again.
TEST(Scene, LetsRelaxedTissueSleep) {
  SceneConfig config;
  for (int i = 0; i < 3; ++i) {
    config.tissues.push_back(
        {.name = std::to_string(i),
         .geometry = SphereGeometry{.center_m = {0.2 * i, 0, 0}, .radius_m = 0.05},
         .material = KelvinVoigtMaterial{.stiffness_newton_per_m = 200.0,
                                         .relaxing_stiffness_newton_per_m = 400.0,
                                         .relaxation_time_s = 0.1}});
  }
  const Scene scene(config, 0.01);
  TissueMemory memory = scene.new_memory();
  double time_s = 0.0;
  const auto asleep = [&](const Vector3& x, double dt_s) {
    time_s += dt_s;
    scene.remember(memory, x, time_s);
    return scene.evaluate(x, kAtRest, time_s, memory).tissues_asleep;
  };
  const Vector3 above(0, 0, 0.055);
  EXPECT_EQ(asleep(above, 0.0), 3U);  // looked at, and at rest
  EXPECT_EQ(asleep({0, 0, 0.045}, 0.01), 2U);
  EXPECT_EQ(asleep({0, 0.2, 0}, 0.1), 2U);  // far away, and still coming back
  EXPECT_EQ(asleep(above, 6.0), 3U);

  // pressed again, it answers as fresh tissue does: z = p − (p/T) τ (1 − e^(−T/τ))
  const double stretch_m = 0.005 / 0.001 * 0.1 * (1.0 - std::exp(-0.01));
  asleep({0, 0, 0.05}, 1.0);
  asleep({0, 0, 0.045}, 0.001);
  EXPECT_NEAR(scene.evaluate({0, 0, 0.045}, kAtRest, time_s, memory).force_on_tool_newton.z(),
              200.0 * 0.005 + 400.0 * stretch_m, 1e-9);
}

// A step costs nothing for what was remembered and is asked for again.
TEST(Scene, IsEvaluatedWhereItRemembersAsItWasThere) {
  Random random(8);
  for (int i = 0; i < 200; ++i) {
    const Scene scene(random_scene(random, 4), 0.02);
    TissueMemory memory = scene.new_memory();
    Vector3 x = random_in_cube(random, 0.1);
    scene.remember(memory, x, 0.0);
    for (int step = 1; step < 5; ++step) {
      x += random_in_cube(random, 0.002);
      const double time_s = 1e-3 * step;
      const SceneForce foreseen = scene.evaluate(x, kAtRest, time_s, memory);
      scene.remember(memory, x, time_s);
      const SceneForce there = scene.evaluate(x, kAtRest, time_s, memory);
      EXPECT_EQ(foreseen.contact_count, there.contact_count);
      EXPECT_LT((foreseen.force_on_tool_newton - there.force_on_tool_newton).norm(), 1e-9);
      EXPECT_EQ(foreseen.tissues_visited, there.tissues_visited);
    }
  }
}

// ±2 mm at 0.5 Hz: at 0.5 s 2 mm up, at rest; at 1 s back, going down with 2π·0.5·2 mm/s.
TEST(Scene, GoesToAndFro) {
  SceneConfig config = one_tissue(
      HalfSpaceGeometry{},
      KelvinVoigtMaterial{.stiffness_newton_per_m = 500.0, .damping_newton_s_per_m = 10.0});
  config.tissues[0].motion = {.amplitude_m = {0, 0, 0.002}, .frequency_hz = 0.5};
  const Scene scene(config);
  const auto newton = [&](double time_s) {
    return scene.evaluate({0, 0, -0.003}, kAtRest, time_s, TissueMemory{}).force_on_tool_newton.z();
  };

  EXPECT_NEAR(newton(0.5), 2.5, 1e-12);
  EXPECT_NEAR(newton(1.0), 1.5 - 10.0 * std::numbers::pi * 0.002, 1e-12);
}

TEST(SceneBroadPhase, FindsTissueWhereItsMotionTakesIt) {
  SceneConfig config = one_tissue(SphereGeometry{.radius_m = 0.01}, KelvinVoigtMaterial{});
  config.tissues[0].motion = {.amplitude_m = {0.05, 0, 0}, .frequency_hz = 1.0};

  const SceneForce force = Scene(config).evaluate({0.055, 0, 0}, kAtRest, 0.25, TissueMemory{});

  EXPECT_EQ(force.contact_count, 1U);
  EXPECT_NEAR(force.contacts[0].penetration_m, 0.005, 1e-12);
}

// Half-way through the shell k is the mean, deep inside it is the inclusion's.
TEST(Scene, IsStifferInsideAnInclusion) {
  KelvinVoigtMaterial material{.stiffness_newton_per_m = 300.0};
  material.inclusions = {
      {.radius_m = 0.005, .transition_m = 0.002, .stiffness_newton_per_m = 1500.0}};
  const Scene scene(one_tissue(HalfSpaceGeometry{}, material));
  const auto along_normal = [&](double x_m) {
    return scene.evaluate({x_m, 0, -1e-6}, kAtRest).force_on_tool_newton.z() / 1e-6;
  };

  EXPECT_NEAR(along_normal(0.0), 1500.0, 1e-6);
  EXPECT_NEAR(along_normal(0.005), 900.0, 0.01);
  EXPECT_NEAR(along_normal(0.007), 300.0, 1e-6);
}

// --- friction ------------------------------------------------------------------------------------

/// 500 N/m, μ 0.5, k_t 500 N/m.
class Rubbed {
 public:
  explicit Rubbed(const Geometry& geometry = HalfSpaceGeometry{}, TissueMotionConfig motion = {})
      : scene_([&] {
          SceneConfig config =
              one_tissue(geometry, KelvinVoigtMaterial{.stiffness_newton_per_m = 500.0,
                                                       .friction_coefficient = 0.5,
                                                       .friction_stiffness_newton_per_m = 500.0});
          config.tissues[0].motion = motion;
          return config;
        }()),
        memory_(scene_.new_memory()) {}

  SceneForce go_to(const Vector3& x_m, double time_s = 0.0) {
    scene_.remember(memory_, x_m, time_s);
    return scene_.evaluate(x_m, kAtRest, time_s, memory_);
  }
  double newton_at(const Vector3& x_m) { return go_to(x_m).force_on_tool_newton.x(); }

 private:
  Scene scene_;
  TissueMemory memory_;
};

// 10 mm deep, 5 N: holds up to 2.5 N, 5 mm of stretch.
TEST(SceneFriction, SticksWhereItWasTouched) {
  Rubbed floor;
  EXPECT_EQ(floor.newton_at({0, 0, -0.01}), 0.0);
  EXPECT_NEAR(floor.newton_at({0.002, 0, -0.01}), -1.0, 1e-12);
  EXPECT_NEAR(floor.newton_at({0, 0, -0.01}), 0.0, 1e-12);
  EXPECT_NEAR(floor.newton_at({-0.004, 0, -0.01}), 2.0, 1e-12);
}

TEST(SceneFriction, SlipsAtItsLimitAndSticksWhereItStops) {
  Rubbed floor;
  floor.go_to({0, 0, -0.01});
  EXPECT_NEAR(floor.newton_at({0.02, 0, -0.01}), -2.5, 1e-12);
  EXPECT_NEAR(floor.newton_at({0.05, 0, -0.01}), -2.5, 1e-12);
  EXPECT_NEAR(floor.newton_at({0.049, 0, -0.01}), -2.0, 1e-12);
  // ½·500·(4 mm)² beside ½·500·(10 mm)²
  EXPECT_NEAR(floor.go_to({0.049, 0, -0.01}).stored_energy_joule, 0.025 + 0.004, 1e-12);
}

TEST(SceneFriction, HoldsLessWherePressedLess) {
  Rubbed floor;
  floor.go_to({0, 0, -0.01});
  floor.go_to({0.004, 0, -0.01});
  EXPECT_NEAR(floor.newton_at({0.004, 0, -0.004}), -1.0, 1e-12);
  EXPECT_NEAR(floor.newton_at({0.004, 0, -0.01}), -1.0, 1e-12);  // what slipped is gone
  floor.go_to({0.004, 0, 0.001});
  EXPECT_EQ(floor.newton_at({0.004, 0, -0.01}), 0.0);  // lifted: forgotten
}

// At 0.5 s the floor has gone 2 mm with the tip stuck to it.
TEST(SceneFriction, MovingTissueTakesTheTipAlong) {
  Rubbed floor(HalfSpaceGeometry{}, {.amplitude_m = {0.002, 0, 0}, .frequency_hz = 0.5});
  floor.go_to({0, 0, -0.01}, 0.0);
  EXPECT_NEAR(floor.go_to({0, 0, -0.01}, 0.5).force_on_tool_newton.x(), 1.0, 1e-12);
}

// From one message to the next the model does what the tissue does on a straight way.
TEST(SceneFriction, IsWhatTheModelSaysOnAStraightWay) {
  Random random(2);
  for (int i = 0; i < 500; ++i) {
    Rubbed floor;
    floor.go_to({0, 0, -0.005});
    const SceneForce here = floor.go_to({random.uniform(-0.01, 0.01), 0, -0.005});
    const Vector3 d(random.uniform(-0.01, 0.01), random.uniform(-0.01, 0.01),
                    random.uniform(-0.004, 0.004));
    const ModelForce model = palpate::evaluate(here.contacts[0], d, kAtRest, 0.0);
    const Vector3 x = Vector3(0, 0, -0.005) + d;
    const double start_x_m = here.contacts[0].stretch_m.x();
    Rubbed other;  // stuck so that it is stretched alike
    other.go_to({-start_x_m, 0, -0.005});
    other.go_to({0, 0, -0.005});
    const SceneForce truth = other.go_to(x);
    EXPECT_LT((model.force_on_tool_newton - truth.force_on_tool_newton).norm(), 1e-9);
    EXPECT_NEAR(model.stored_energy_joule, truth.stored_energy_joule, 1e-12);
  }
}

// The work on the tool along random closed paths, with steps of about 10 µm: whatever the path, no
// more than rounding and the midpoints' error, and much less than the energy stored on the way.
TEST(SceneFriction, NeverGivesEnergy) {
  Random random(4);
  double least_joule = 0.0;
  for (const Geometry& geometry :
       {Geometry(HalfSpaceGeometry{}),
        Geometry(SphereGeometry{.center_m = {0, 0, -0.03}, .radius_m = 0.03}),
        Geometry(CapsuleGeometry{
            .from_m = {-0.1, 0, -0.02}, .to_m = {0.1, 0, -0.02}, .radius_m = 0.02})}) {
    for (int path = 0; path < 20; ++path) {
      Rubbed tissue(geometry);
      Vector3 x(0, 0, 0.001);
      Vector3 force = tissue.go_to(x).force_on_tool_newton;
      double work_joule = 0.0;
      for (int leg = 0; leg < 12; ++leg) {
        const Vector3 to = leg == 11
                               ? Vector3(0, 0, 0.005)
                               : Vector3(random.uniform(-0.01, 0.01), random.uniform(-0.01, 0.01),
                                         random.uniform(-0.006, 0.001));
        const Vector3 step = (to - x) / 1000.0;
        for (int i = 0; i < 1000; ++i) {
          x += step;
          const Vector3 next = tissue.go_to(x).force_on_tool_newton;
          work_joule += 0.5 * (force + next).dot(step);
          force = next;
        }
      }
      EXPECT_EQ(force, Vector3(0, 0, 0));
      EXPECT_LT(work_joule, 1e-6);
      least_joule = std::min(least_joule, work_joule);
    }
  }
  EXPECT_LT(least_joule, -1e-2);
}

TEST(Scene, TreatsATeleportBeyondAllNumbersAsNoTouch) {
  const SceneForce force = floor_scene(true, true).evaluate({0, 0, -1e200}, kAtRest);

  EXPECT_EQ(force.force_on_tool_newton, Vector3(0, 0, 0));
  EXPECT_EQ(force.stored_energy_joule, 0.0);
  EXPECT_EQ(force.contact_count, 0U);
}

}  // namespace
}  // namespace palpate::physics
