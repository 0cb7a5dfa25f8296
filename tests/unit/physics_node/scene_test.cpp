// SPDX-License-Identifier: Apache-2.0
#include "physics_node/scene/scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "tests/unit/physics_node/random_scene.h"

namespace palpate::physics {
namespace {

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

TEST(Scene, TreatsATeleportBeyondAllNumbersAsNoTouch) {
  const SceneForce force = floor_scene(true, true).evaluate({0, 0, -1e200}, kAtRest);

  EXPECT_EQ(force.force_on_tool_newton, Vector3(0, 0, 0));
  EXPECT_EQ(force.stored_energy_joule, 0.0);
  EXPECT_EQ(force.contact_count, 0U);
}

}  // namespace
}  // namespace palpate::physics
