// SPDX-License-Identifier: Apache-2.0
// The state of tissue between two steps: relaxation and friction.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "common/contact/contact_model.h"
#include "common/core/random.h"
#include "physics_node/scene/scene.h"
#include "tests/property/seeds.h"
#include "tests/unit/physics_node/random_scene.h"

namespace palpate::physics {
namespace {

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
    return scene.step(memory, pressed, kAtRest, time_s).force_on_tool_newton.z();
  };
  scene.step(memory, {0, 0, 0}, kAtRest, 0.0);

  const double stretch_m = 10.0 * 0.1 * (1.0 - std::exp(-0.01));  // (p/T) τ (1 − e^(−T/τ))
  EXPECT_NEAR(newton(0.001), 2.0 + 400.0 * stretch_m, 1e-9);
  EXPECT_NEAR(newton(0.101), 2.0 + 400.0 * stretch_m * std::exp(-1.0), 1e-9);
  EXPECT_NEAR(newton(5.0), 2.0, 1e-9);

  // let go, and it comes back with the same time constant
  scene.step(memory, {0, 0, 0.01}, kAtRest, 5.0 + 1e-9);
  scene.step(memory, {0, 0, 0.01}, kAtRest, 5.1);
  EXPECT_NEAR(scene.step(memory, pressed, kAtRest, 5.1 + 1e-9).force_on_tool_newton.z(),
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
    return scene.step(memory, x, kAtRest, time_s).tissues_asleep;
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

// Before a step, evaluate() gives the force of the step; at the pose of the last step it repeats
// it.
TEST(Scene, EvaluatesAheadAndAtTheLastPoseWhatTheStepGives) {
  Random random(8);
  for (int i = 0; i < 200; ++i) {
    const Scene scene(random_scene(random, 4), 0.02);
    TissueMemory memory = scene.new_memory();
    Vector3 x = random_in_cube(random, 0.1);
    scene.step(memory, x, kAtRest, 0.0);
    for (int step = 1; step < 5; ++step) {
      x += random_in_cube(random, 0.002);
      const double time_s = 1e-3 * step;
      const SceneForce ahead = scene.evaluate(x, kAtRest, time_s, memory);
      const SceneForce stepped = scene.step(memory, x, kAtRest, time_s);
      const SceneForce there = scene.evaluate(x, kAtRest, time_s, memory);
      EXPECT_EQ(ahead.contact_count, there.contact_count);
      EXPECT_LT((ahead.force_on_tool_newton - there.force_on_tool_newton).norm(), 1e-9);
      EXPECT_EQ(ahead.tissues_visited, there.tissues_visited);
      EXPECT_EQ(stepped.force_on_tool_newton, there.force_on_tool_newton);
      EXPECT_EQ(stepped.stored_energy_joule, there.stored_energy_joule);
      EXPECT_EQ(stepped.listed_count, there.listed_count);
      EXPECT_EQ(stepped.tissues_visited, there.tissues_visited);
    }
  }
}

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
    return scene_.step(memory_, x_m, kAtRest, time_s);
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
    for (std::uint64_t path = 0; path < test::seed_count(20); ++path) {
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

// 200 floors at one height, more than there is room for: 200 · 100 N/m · 10 mm. Friction acts where
// there is history.
TEST(SceneMemory, EvaluatesContactsWithoutRoomInEachStep) {
  SceneConfig config;
  for (int i = 0; i < 200; ++i) {
    config.tissues.push_back(
        {.name = std::to_string(i),
         .geometry = HalfSpaceGeometry{},
         .material = KelvinVoigtMaterial{.stiffness_newton_per_m = 100.0,
                                         .friction_coefficient = 0.5,
                                         .friction_stiffness_newton_per_m = 100.0}});
  }
  const Scene scene(config);
  TissueMemory memory = scene.new_memory();

  const SceneForce first = scene.step(memory, {0, 0, -0.01}, kAtRest, 0.0);
  const SceneForce second = scene.step(memory, {0.001, 0, -0.01}, kAtRest, 0.001);

  EXPECT_EQ(first.contact_count, 200U);
  EXPECT_NEAR(first.force_on_tool_newton.z(), 200.0, 1e-9);
  const auto kept = static_cast<double>(memory.touches().size());
  EXPECT_EQ(kept, 128.0);
  EXPECT_EQ(second.contact_count, 200U);
  EXPECT_NEAR(second.force_on_tool_newton.z(), 200.0, 1e-9);
  EXPECT_NEAR(second.force_on_tool_newton.x(), -kept * 100.0 * 0.001, 1e-9);
}

}  // namespace
}  // namespace palpate::physics
