// SPDX-License-Identifier: Apache-2.0
// The tissue without processes: palpate_tissue.h and .hpp.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <malloc.h>

#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "physics_node/library/palpate_tissue.hpp"
#include "tests/support/alloc_guard.h"
#include "tests/support/machine/places.h"

namespace {

using palpate::tissue::Batch;
using palpate::tissue::Error;
using palpate::tissue::Scene;
using palpate::tissue::Snapshot;
using testing::HasSubstr;

constexpr double kTick_s = 1e-3;
const std::string kSessions = palpate::test::source_dir() + "/deploy/sessions";

/// Rigid tissue that remembers: friction, relaxation, motion.
Scene remembering_scene() {
  return Scene::parse(R"(scene {
    tool { tip_radius_m: 0.005 }
    tissue { name: "floor" half_space {} kelvin_voigt {
      stiffness_newton_per_m: 400 damping_newton_s_per_m: 2 friction_coefficient: 0.3
      relaxing_stiffness_newton_per_m: 200 relaxation_time_ms: 200 } }
    tissue { name: "ball" sphere { center_m { x: 0.03 } radius_m: 0.02 }
      kelvin_voigt { stiffness_newton_per_m: 300 }
      motion { amplitude_m { x: 0.002 } frequency_hz: 3 } }
  })");
}

/// A block of 135 quadratic tetrahedra.
Scene elastic_scene() {
  return Scene::parse(R"(scene {
    tool { tip_radius_m: 0.006 }
    tissue { name: "block" tetrahedral_mesh { file: "small_block.msh" }
      elastic { young_pa: 10e3 viscosity_ms: 5 friction_coefficient: 0.2
                fixed { half_space { point_m { z: -0.0299 } } } solve_rate_hz: 50 } }
  })",
                      kSessions);
}

palpate_tool tool_at(double x_m, double y_m, double z_m) {
  palpate_tool tool{};
  tool.position_m[0] = x_m;
  tool.position_m[1] = y_m;
  tool.position_m[2] = z_m;
  return tool;
}

/// Presses, slides and lets go, each copy elsewhere.
void place(palpate_tool& tool, std::size_t copy, double time_s) {
  const double phase = 0.37 * static_cast<double>(copy);
  tool.position_m[0] = 0.004 * std::sin(7.0 * time_s + phase);
  tool.position_m[1] = 0.003 * std::sin(5.0 * time_s + 2.0 * phase);
  tool.position_m[2] = 0.004 + 0.004 * std::cos(9.0 * time_s + phase);
}

std::string bytes_of(const palpate_tool_force& force) {
  return {reinterpret_cast<const char*>(&force), sizeof(force)};
}

/// Every byte of the answers of one step after the other.
std::string run(Batch& batch, std::size_t copies, std::size_t first_copy, int from, int to) {
  std::string bytes;
  for (int k = from; k < to; ++k) {
    for (std::size_t i = 0; i < copies; ++i) place(batch.tool(i), first_copy + i, kTick_s * k);
    batch.step(kTick_s);
    for (std::size_t i = 0; i < copies; ++i) bytes += bytes_of(batch.force(i));
  }
  return bytes;
}

double newton(const palpate_tool_force& force) {
  const double* f = force.force_on_tool_newton;
  return std::hypot(f[0], f[1], f[2]);
}

TEST(TissueLibrary, EachOfManyIsAsAloneToTheBit) {
  for (const auto& [make, copies, steps] :
       {std::tuple{&remembering_scene, 37, 400}, {&elastic_scene, 7, 220}}) {
    const Scene scene = make();
    std::string together;
    const auto count = static_cast<std::size_t>(copies);
    {
      Batch batch(scene, count, 1, 3);
      together = run(batch, count, 0, 0, steps);
    }
    double most_newton = 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      Batch alone(make(), 1, 1, 1);
      const std::string own = run(alone, 1, i, 0, steps);
      for (std::size_t k = 0; k < static_cast<std::size_t>(steps); ++k) {
        constexpr std::size_t kSize = sizeof(palpate_tool_force);
        ASSERT_EQ(own.compare(k * kSize, kSize, together, (k * count + i) * kSize, kSize), 0)
            << "copy " << i << " step " << k;
        palpate_tool_force force;
        std::memcpy(&force, own.data() + k * kSize, kSize);
        most_newton = std::max(most_newton, newton(force));
      }
    }
    EXPECT_GT(most_newton, 0.1);
  }
}

TEST(TissueLibrary, ASnapshotContinuesToTheBitAndAResetIsTheStart) {
  for (const auto& make : {&remembering_scene, &elastic_scene}) {
    const Scene scene = make();
    Batch batch(scene, 2, 1, 1);
    const std::string start = run(batch, 2, 3, 0, 150);
    const Snapshot kept = batch.snapshot(1);
    EXPECT_DOUBLE_EQ(batch.time_s(1), 0.15);
    const std::string on = run(batch, 2, 3, 150, 300);

    Batch other(scene, 2, 1, 2);
    run(other, 2, 9, 0, 77);  // what was there leaves nothing
    other.restore(kept);
    EXPECT_DOUBLE_EQ(other.time_s(0), 0.15);
    std::string again;
    for (int k = 150; k < 300; ++k) {
      for (std::size_t i = 0; i < 2; ++i) place(other.tool(i), 4, kTick_s * k);
      other.step(kTick_s);
      EXPECT_TRUE(bytes_of(other.force(0)) == bytes_of(other.force(1)));
      again += bytes_of(other.force(0));
    }
    constexpr std::size_t kSize = sizeof(palpate_tool_force);
    for (std::size_t k = 0; k < 150; ++k) {
      ASSERT_EQ(again.compare(k * kSize, kSize, on, (2 * k + 1) * kSize, kSize), 0) << k;
    }
    batch.reset();
    EXPECT_EQ(batch.time_s(1), 0.0);
    EXPECT_EQ(run(batch, 2, 3, 0, 150), start);
  }
}

// As so many steps, with tools on straight ways.
TEST(TissueLibrary, PartsOfAStepAreSteps) {
  const Scene scene = remembering_scene();
  Batch whole(scene);
  Batch parts(scene);
  for (int k = 0; k < 40; ++k) {
    palpate_tool& tool = whole.tool();
    tool.position_m[2] = 0.004;
    tool.position_m[0] = 1e-3 * k;
    whole.step(10 * kTick_s, 10);
    for (int part = 1; part <= 10; ++part) {
      parts.tool() = tool;
      if (k > 0) parts.tool().position_m[0] = 1e-3 * (k - 1 + 0.1 * part);
      parts.step(kTick_s);
    }
    EXPECT_EQ(whole.time_s(), parts.time_s());
    ASSERT_NEAR(newton(whole.force()), newton(parts.force()), 1e-9) << k;
  }
  EXPECT_GT(newton(whole.force()), 0.1);
}

// Two tools on one body feel each other.
TEST(TissueLibrary, ToolsOfACopyMeetInElasticTissue) {
  const Scene scene = elastic_scene();
  Batch batch(scene, 1, 2);
  const auto press = [&](double other_z_m) {
    batch.reset();
    for (int k = 0; k < 200; ++k) {
      batch.tool(0, 0) = tool_at(-0.004, 0.0, 0.004);
      batch.tool(0, 1) = tool_at(0.006, 0.0, other_z_m);
      batch.step(kTick_s);
    }
    return newton(batch.force(0, 0));
  };
  const double alone = press(0.05);
  const double beside = press(0.002);
  EXPECT_GT(alone, 0.01);
  EXPECT_LT(beside, 0.97 * alone) << "the other one has pressed the surface away";
}

TEST(TissueLibrary, TellsWhereAndHowWell) {
  Batch floor(Scene::parse(R"(scene {
    tool { tip_radius_m: 0.005 shaft_length_m: 0.1 shaft_radius_m: 0.002 }
    tissue { name: "floor" half_space {} kelvin_voigt { stiffness_newton_per_m: 400 } }
    tissue { name: "bar" box { center_m { x: 0.05 z: 0.05 } size_m { x: 0.02 y: 0.1 z: 0.02 } }
             kelvin_voigt { stiffness_newton_per_m: 400 } }
  })"));
  floor.tool() = tool_at(0.0, 0.0, 0.004);
  floor.step(kTick_s);
  ASSERT_EQ(floor.force().listed_count, 1U);
  const palpate_contact& tip = floor.force().contacts[0];
  EXPECT_NEAR(tip.point_m[2], 0.0, 1e-12);
  EXPECT_NEAR(tip.penetration_m, 1e-3, 1e-12);
  EXPECT_NEAR(tip.force_on_tool_newton[2], 0.4, 1e-9);
  EXPECT_EQ(tip.error_newton, 0.0);
  EXPECT_EQ(floor.force().torque_on_tool_newton_m[1], 0.0);

  // the shaft stands upright beside the bar, 1 mm in it
  floor.reset();
  floor.tool() = tool_at(0.039, 0.0, 0.02);
  floor.step(kTick_s);
  ASSERT_EQ(floor.force().listed_count, 1U);
  const palpate_contact& side = floor.force().contacts[0];
  EXPECT_EQ(side.is_shaft, 1);
  EXPECT_EQ(side.tissue, 1U);
  EXPECT_NEAR(side.point_m[0], 0.04, 1e-9);
  EXPECT_LT(side.force_on_tool_newton[0], -0.1);
  const double lever_m = side.point_m[2] - 0.02;
  EXPECT_GT(lever_m, 0.01);
  EXPECT_NEAR(floor.force().torque_on_tool_newton_m[1], lever_m * side.force_on_tool_newton[0],
              1e-9);

  Batch block(elastic_scene());
  palpate_surface before = block.surface();
  ASSERT_GT(before.vertex_count, 100U);
  ASSERT_NE(before.strain, nullptr);
  float top_m = -1.0F;
  for (std::size_t i = 0; i < before.vertex_count; ++i) {
    top_m = std::max(top_m, before.vertices_m[3 * i + 2]);
  }
  EXPECT_NEAR(top_m, 0.0F, 1e-6F);
  for (int k = 0; k < 400; ++k) {
    block.tool() = tool_at(0.0, 0.0, 0.006 - 1e-5 * std::min(k, 200));
    block.step(kTick_s);
  }
  ASSERT_EQ(block.force().listed_count, 1U);
  EXPECT_GT(newton(block.force()), 0.01);
  EXPECT_LT(block.force().error_newton, 0.1 * newton(block.force())) << "measured at rest";
  const palpate_surface after = block.surface();
  float least_m = 0.0F;
  float most_strain = 0.0F;
  for (std::size_t i = 0; i < after.triangle_count * 3; ++i) {
    const std::uint32_t vertex = after.triangles[i];
    ASSERT_LT(vertex, after.vertex_count);
    const float* at = after.vertices_m + 3 * std::size_t{vertex};
    if (std::hypot(at[0], at[1]) < 0.004F && at[2] > -0.01F) least_m = std::min(least_m, at[2]);
    most_strain = std::max(most_strain, after.strain[vertex]);
  }
  EXPECT_LT(least_m, -1e-3F);
  EXPECT_GT(most_strain, 0.02F);
}

// Real-time programs may call it.
// A shaft that leans on a round bar and turns about the tip moves in it as fast as it turns times
// how far away that is: 5 N·s/m · 0.2 rad/s · 50 mm.
TEST(TissueLibrary, ViscousTissueResistsAShaftThatTurns) {
  Batch batch(Scene::parse(R"(scene {
    tool { tip_radius_m: 0.002 shaft_length_m: 0.1 shaft_radius_m: 0.002 }
    tissue { name: "bar" capsule { from_m { x: 0.011 y: -0.1 z: 0.05 } to_m { x: 0.011 y: 0.1 z: 0.05 } radius_m: 0.01 }
             kelvin_voigt { stiffness_newton_per_m: 400 damping_newton_s_per_m: 5 } }
  })"));
  const auto newton_at = [&](double rad) {
    batch.tool() = tool_at(0.0, 0.0, 0.0);
    batch.tool().orientation_wxyz[0] = std::cos(0.5 * rad);
    batch.tool().orientation_wxyz[2] = std::sin(0.5 * rad);
    batch.step(kTick_s);
    return newton(batch.force());
  };
  const double at_rest = newton_at(0.0);
  newton_at(-0.0002);
  const double turning = newton_at(0.0);  // towards the bar
  EXPECT_NEAR(at_rest, 0.4, 1e-3);
  EXPECT_NEAR(turning - at_rest, 5.0 * 0.2 * 0.05, 5e-4);
  EXPECT_NEAR(newton_at(0.0), at_rest, 1e-9);
}

TEST(TissueLibrary, AStepOnTissueThatIsNotElasticAllocatesNothing) {
  Batch batch(remembering_scene(), 4, 1, 1);
  run(batch, 4, 0, 0, 10);
  const palpate::test::AllocGuard guard;
  for (int k = 10; k < 3000; ++k) {
    for (std::size_t i = 0; i < 4; ++i) place(batch.tool(i), i, kTick_s * k);
    batch.step(kTick_s);
  }
  EXPECT_EQ(guard.count(), 0U);
}

TEST(TissueLibrary, KeepsNothingOfWhatItDid) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  const Scene scene = elastic_scene();
  const auto cycle = [&] {
    Batch batch(scene, 2, 1, 2);
    run(batch, 2, 0, 0, 150);
    const Snapshot kept = batch.snapshot(0);
    batch.reset(1);
    batch.restore(kept);
    run(batch, 2, 0, 150, 200);
  };
  cycle();
  cycle();
  const std::size_t before = mallinfo2().uordblks;
  for (int i = 0; i < 3; ++i) cycle();
  EXPECT_LT(mallinfo2().uordblks, before + 20'000U);
#endif
}

/// The text of the error of a call.
std::string error_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(TissueLibrary, RefusesWithAReasonAndARemedy) {
  EXPECT_THAT(error_of([] { static_cast<void>(Scene::load("nowhere.txtpb")); }),
              HasSubstr("nowhere.txtpb"));
  EXPECT_THAT(
      error_of([] { static_cast<void>(Scene::parse("scene { tissue { half_spaze {} } }")); }),
      HasSubstr("scene:1:18"));
  EXPECT_THAT(error_of([] {
                static_cast<void>(Scene::load(kSessions + "/block_with_tumour.txtpb",
                                              {"scene.tissue[0].elastic.young_pa=-1"}));
              }),
              HasSubstr("young_pa"));
  EXPECT_THAT(
      error_of([] { static_cast<void>(Scene::load(kSessions + "/engines/bullet_block.txtpb")); }),
      HasSubstr("physics.command"));
  const Scene scene = remembering_scene();
  EXPECT_THAT(error_of([&] { Batch(scene, 0); }), HasSubstr("scenes = 0: must be 1 to"));
  EXPECT_THAT(error_of([&] { Batch(scene, 1, 65); }), HasSubstr("tools = 65"));
  Batch batch(scene, 3, 2);
  EXPECT_THAT(error_of([&] { batch.step(0.0); }), HasSubstr("dt_s"));
  EXPECT_THAT(error_of([&] { batch.step(1e-3, 0); }), HasSubstr("parts"));
  EXPECT_THAT(error_of([&] { batch.reset(3); }), HasSubstr("copy 3: there are 3"));
  EXPECT_THAT(error_of([&] { static_cast<void>(batch.surface(2)); }), HasSubstr("tissue 2"));
  const Snapshot other = Batch(elastic_scene()).snapshot();
  EXPECT_THAT(error_of([&] { batch.restore(other); }), HasSubstr("another scene"));
  // and nothing has moved
  batch.tool(1, 1).position_m[2] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(error_of([&] { batch.step(1e-3); }), HasSubstr("copy 1, tool 1: position_m"));
  EXPECT_EQ(batch.time_s(0), 0.0);
  batch.tool(1, 1) = {};
  batch.tool(1, 1).orientation_wxyz[0] = 2.0;
  EXPECT_THAT(error_of([&] { batch.step(1e-3); }), HasSubstr("length 1"));
  batch.tool(1, 1) = {};
  batch.tool(1, 1).velocity_m_per_s[0] = INFINITY;
  batch.tool(1, 1).is_velocity_known = 1;
  EXPECT_THAT(error_of([&] { batch.step(1e-3); }), HasSubstr("velocity"));

  EXPECT_EQ(palpate_batch_step(nullptr, 1e-3, 1), PALPATE_TISSUE_NULL_POINTER);
  EXPECT_EQ(palpate_batch_create(nullptr, 1, 1, 1), nullptr);
  EXPECT_EQ(palpate_scene_load(nullptr, nullptr, 0), nullptr);
  EXPECT_TRUE(std::isnan(palpate_batch_time_s(nullptr, 0)));
  EXPECT_EQ(palpate_scene_tissue_name(scene.get(), 2), nullptr);
  EXPECT_STREQ(palpate_scene_tissue_name(scene.get(), 1), "ball");
  palpate_scene_destroy(nullptr);
  palpate_batch_destroy(nullptr);
  palpate_snapshot_destroy(nullptr);
}

}  // namespace
