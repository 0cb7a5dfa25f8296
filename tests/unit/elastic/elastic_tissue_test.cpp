// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include "common/core/check.h"
#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/files/surface_files.h"
#include "physics_node/files/tetrahedral_files.h"
#include "physics_node/scene_engine.h"
#include "tests/property/seeds.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/machine/machine.h"
#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/elastic/block_mesh.h"

namespace palpate::physics {
namespace {

constexpr double kTip_m = 0.006;
constexpr double kReach_m = 0.05;
constexpr double kTick_s = 1e-3;

/// 100 × 100 × 50 mm, its top at z = 0, of 540 linear tetrahedra.
std::string elastic_block_file() {
  std::string file = testing::TempDir() + "elastic_block_" +
                     testing::UnitTest::GetInstance()->current_test_info()->name() + ".msh";
  std::ofstream(file) << msh_text(block_of(3, 3, 9e-3));
  return file;
}

SceneConfig elastic_scene(const std::string& file, ElasticMaterial material = {}) {
  material.young_pa = 15e3;
  material.is_linear = true;
  material.fixed = {HalfSpaceGeometry{.point_m = {0, 0, -0.0499}}};
  return {.tip_radius_m = kTip_m,
          .tissues = {
              {.name = "block",
               .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh, .file = file},
               .material = material}}};
}

/// The centre of a tip this deep in the block.
Vector3 tip_at(double depth_m, double x_m = 0.0) { return {x_m, 0.0, kTip_m - depth_m}; }

/// Presses at 25 mm/s to 3 mm and stays there for a while.
Vector3 pressing(double time_s) { return tip_at(std::min(0.003, 0.025 * time_s - 0.001)); }

class ElasticScene : public testing::Test {
 protected:
  std::string file_ = elastic_block_file();
  SceneConfig scene_ = elastic_scene(file_);

  [[nodiscard]] std::shared_ptr<ElasticTissues> tissues(std::size_t tools = 1) const {
    return ElasticTissues::of(scene_, tools, ElasticPace::kVirtual);
  }
  void TearDown() override { std::filesystem::remove(file_); }
};

// The same model with a full solution every millisecond is the reference; 50 Hz in between.
TEST_F(ElasticScene, TheForceBetweenFullSolutionsIsThatOfTheFullSolution) {
  const auto elastic = tissues();
  ElasticReference reference(elastic_bodies_of(scene_), kTip_m, kTick_s);
  double error2 = 0.0;
  double held2 = 0.0;  // of the force of the last full solution, held
  double force2 = 0.0;
  double held = 0.0;
  const int ticks = test::kIsSanitized ? 120 : 220;
  for (int tick = 0; tick < ticks; ++tick) {
    const double time_s = kTick_s * tick;
    SceneForce force;
    elastic->step(0, pressing(time_s), time_s, kReach_m, force);
    SceneForce ideal;
    reference.advance(time_s, pressing(time_s), ideal);
    const double wanted = ideal.force_on_tool_newton.z();
    if (tick % 20 == 0) held = wanted;
    error2 += std::pow(force.force_on_tool_newton.z() - wanted, 2);
    held2 += std::pow(held - wanted, 2);
    force2 += wanted * wanted;
  }
  const double error = std::sqrt(error2 / force2);
  EXPECT_LT(error, 0.08);
  EXPECT_LT(error, 0.7 * std::sqrt(held2 / force2));

  PhysicsCounters counters;
  elastic->count_into(counters);
  elastic->count_tool_into(0, counters);
  EXPECT_EQ(counters.elastic_solves + counters.elastic_solves_skipped,
            static_cast<std::uint64_t>(ticks / 20));
  EXPECT_LT(counters.elastic_residual_ratio, 1e-2);
  EXPECT_GT(counters.elastic_bound_newton, 0.0);
  EXPECT_GE(counters.elastic_bound_newton, counters.elastic_error_newton);
  EXPECT_GT(counters.elastic_bounds_checked, 0U);
  EXPECT_EQ(counters.elastic_tips_appeared, 0U);
  // until the second full solution in contact
  EXPECT_GT(counters.elastic_unknown_bound_steps, 0U);
  EXPECT_LT(counters.elastic_unknown_bound_steps, counters.elastic_contact_steps / 2);
}

// A bound of 0 would be the strongest claim where least is known: before an error has been
// measured, and where the tip has left the points of the last solution.
TEST_F(ElasticScene, TheBoundOfWhatWasNeverMeasuredIsUnknown) {
  const auto elastic = tissues();
  PhysicsCounters counters;
  const auto step = [&](int tick, const Vector3& tip_m) {
    SceneForce force;
    elastic->step(0, tip_m, kTick_s * tick, kReach_m, force);
    elastic->count_into(counters);
    elastic->count_tool_into(0, counters);
    return force.force_on_tool_newton.norm();
  };
  int tick = 0;
  for (; tick < 10; ++tick) step(tick, tip_at(-0.001));
  EXPECT_TRUE(std::isnan(counters.elastic_bound_newton));
  EXPECT_TRUE(std::isnan(counters.elastic_error_newton));
  // no full solution yet: the force is that of the material
  EXPECT_GT(step(tick++, tip_at(0.001)), 0.0);
  EXPECT_TRUE(std::isnan(counters.elastic_bound_newton));
  EXPECT_EQ(counters.elastic_unknown_bound_steps, 1U);
  for (; tick < 120; ++tick) step(tick, tip_at(0.001));
  EXPECT_GE(counters.elastic_bound_newton, 0.0);
  EXPECT_GE(counters.elastic_error_newton, 0.0);
  // two radii aside, before anything is solved there
  EXPECT_GT(step(tick++, tip_at(0.001, 0.012)), 0.0);
  EXPECT_TRUE(std::isnan(counters.elastic_bound_newton));
}

// More than a radius deep above a hard part, where many points touch, and along the surface.
TEST_F(ElasticScene, SoItIsInADeepPress) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  ElasticMaterial material{.viscosity_s = 0.005};
  material.parts = {{.where = SphereGeometry{.center_m = {0, 0, -0.016}, .radius_m = 0.0095},
                     .young_pa = 150e3,
                     .poisson_ratio = 0.45,
                     .density_kg_per_m3 = 1000.0}};
  SceneConfig scene = elastic_scene(test::source_dir() + "/deploy/sessions/block.msh", material);
  std::get<ElasticMaterial>(scene.tissues[0].material).is_linear = false;
  const auto elastic = ElasticTissues::of(scene, 1, ElasticPace::kVirtual);
  ElasticReference reference(elastic_bodies_of(scene), kTip_m, kTick_s);
  double error2 = 0.0;
  double force2 = 0.0;
  const int ticks = 700;
  for (int tick = 0; tick < ticks; ++tick) {
    const double time_s = kTick_s * tick;
    const double depth_m = 0.0075 * std::sin(std::numbers::pi * time_s / 0.7);
    const Vector3 tip_m = tip_at(depth_m, 0.010 * (time_s - 0.35));
    SceneForce force;
    elastic->step(0, tip_m, time_s, kReach_m, force);
    SceneForce ideal;
    reference.advance(time_s, tip_m, ideal);
    error2 += (force.force_on_tool_newton - ideal.force_on_tool_newton).squaredNorm();
    force2 += ideal.force_on_tool_newton.squaredNorm();
  }
  EXPECT_LT(std::sqrt(error2 / force2), 0.08);  // 0.16 without the untouched body
}

/// Root mean square of the error over that of the force, and Σ F·F_ideal / Σ |F_ideal|², of a
/// session against a full solution every millisecond.
struct Agreement {
  double error = 0.0;
  double gain = 0.0;
  double least_ratio = 1.0;  // of the force along the ideal one, where that is above 0.1 N
};
template <class Tip>
Agreement agreement(const SceneConfig& scene, int ticks, const Tip& tip_m) {
  const auto elastic = ElasticTissues::of(scene, 1, ElasticPace::kVirtual);
  ElasticReference reference(elastic_bodies_of(scene), kTip_m, kTick_s);
  Agreement agreement;
  double force2 = 0.0;
  for (int tick = 0; tick < ticks; ++tick) {
    const double time_s = kTick_s * tick;
    SceneForce force;
    elastic->step(0, tip_m(time_s), time_s, kReach_m, force);
    SceneForce ideal;
    reference.advance(time_s, tip_m(time_s), ideal);
    const Vector3& wanted = ideal.force_on_tool_newton;
    agreement.error += (force.force_on_tool_newton - wanted).squaredNorm();
    agreement.gain += force.force_on_tool_newton.dot(wanted);
    force2 += wanted.squaredNorm();
    if (wanted.norm() > 0.1) {
      agreement.least_ratio = std::min(
          agreement.least_ratio, force.force_on_tool_newton.dot(wanted) / wanted.squaredNorm());
    }
  }
  agreement.error = std::sqrt(agreement.error / force2);
  agreement.gain /= force2;
  return agreement;
}

// The viscous part of a full solution's force is not held, nor taken for stiffness.
TEST_F(ElasticScene, TheForceOfAViscousBodyIsThatOfTheFullSolution) {
  const SceneConfig scene = elastic_scene(file_, {.viscosity_s = 0.02});
  const Agreement at = agreement(
      scene, 300, [](double time_s) { return tip_at(std::min(0.005, 0.05 * time_s - 0.003)); });
  EXPECT_LT(at.error, 0.10);
  EXPECT_NEAR(at.gain, 1.0, 0.05);
}

// What relaxes does so between full solutions too, and gives way at once as stiffly as it is then.
TEST_F(ElasticScene, TheForceOfARelaxingBodyIsThatOfTheFullSolution) {
  for (const double tau_s : {0.015, 0.1, 1.0}) {
    const SceneConfig scene = elastic_scene(
        file_,
        {.branches = {{.share = 0.3, .tau_s = tau_s}, {.share = 0.2, .tau_s = 5.0 * tau_s}}});
    const Agreement at = agreement(
        scene, 400, [](double time_s) { return tip_at(std::min(0.005, 0.05 * time_s - 0.003)); });
    EXPECT_LT(at.error, 0.05) << tau_s;
    EXPECT_NEAR(at.gain, 1.0, 0.05) << tau_s;
  }
}

// In its place within one period of the full solution, which is 20 ms.
TEST_F(ElasticScene, TheForceOfAStepPressIsThatOfTheFullSolution) {
  for (const double tau_s : {0.0, 0.1}) {
    ElasticMaterial material;
    if (tau_s > 0.0) {
      material.branches = {{.share = 0.3, .tau_s = tau_s}, {.share = 0.2, .tau_s = 5.0 * tau_s}};
    }
    const Agreement at = agreement(elastic_scene(file_, material), 300, [](double time_s) {
      return tip_at(std::min(0.005, 0.25 * time_s - 0.015));
    });
    EXPECT_LT(at.error, 0.05) << tau_s;
    EXPECT_NEAR(at.gain, 1.0, 0.05) << tau_s;
  }
}

// Within a period of the full solution this tip goes as deep as a radius.
TEST_F(ElasticScene, AFastPressIsFeltAtOnceAndKept) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  const SceneConfig scene = elastic_scene(file_, {.viscosity_s = 0.005});
  const Agreement at = agreement(scene, 200, [](double time_s) {
    return tip_at(std::min(0.008, 0.25 * std::max(0.0, time_s - 0.05) - 0.004));
  });
  EXPECT_LT(at.error, 0.15);
  EXPECT_NEAR(at.gain, 1.0, 0.1);
  EXPECT_GT(at.least_ratio, 0.5);
}

// A viscous body has not followed a tip that leaves fast: the force falls and does not alternate.
TEST_F(ElasticScene, NoForceAlternatesBehindATipThatLeaves) {
  for (const double viscosity_s : {0.005, 0.05, 0.1}) {
    const SceneConfig scene = elastic_scene(file_, {.viscosity_s = viscosity_s});
    const auto elastic = ElasticTissues::of(scene, 1, ElasticPace::kVirtual);
    double before = 0.0;
    double change_before = 0.0;
    double largest = 0.0;
    int turns = 0;  // of the change's sign, one after the other
    int most_turns = 0;
    for (int tick = 0; tick < 600; ++tick) {
      const double time_s = kTick_s * tick;
      SceneForce force;
      elastic->step(0, tip_at(0.005 * std::sin(2.0 * std::numbers::pi * 1.5 * time_s)), time_s,
                    kReach_m, force);
      const double newton = force.force_on_tool_newton.z();
      const double change = newton - before;
      turns = change * change_before < 0.0 && std::abs(change) > 0.005 ? turns + 1 : 0;
      most_turns = std::max(most_turns, turns);
      largest = std::max(largest, newton);
      before = newton;
      change_before = change;
    }
    EXPECT_GT(largest, 0.3);
    EXPECT_LE(most_turns, 2) << viscosity_s;  // when a full solution arrives
  }
}

TEST_F(ElasticScene, OutOfReachAndAtRestNothingIsComputed) {
  const auto elastic = tissues();
  const Vector3 far(0.0, 0.0, 0.3);
  for (int tick = 0; tick < 3000; ++tick) {
    SceneForce force;
    elastic->step(0, far, kTick_s * tick, kReach_m, force);
    ASSERT_EQ(force.listed_count, 0U);
  }
  PhysicsCounters before;
  elastic->count_into(before);
  for (int tick = 3000; tick < 4000; ++tick) {
    SceneForce force;
    elastic->step(0, far, kTick_s * tick, kReach_m, force);
  }
  PhysicsCounters after;
  elastic->count_into(after);
  elastic->count_tool_into(0, after);
  EXPECT_EQ(after.elastic_solves, before.elastic_solves);
  EXPECT_EQ(after.elastic_solves_skipped, before.elastic_solves_skipped + 50);
  EXPECT_EQ(after.elastic_steps_skipped, 4000U);
}

TEST_F(ElasticScene, AStepOfTheToolAllocatesNothing) {
  ElasticTissue tissue(compliances_of(elastic_bodies_of(scene_)).front(), 1, kTip_m);
  tissue.note(0, tip_at(0.002), kReach_m, 0.0);
  for (int i = 0; i < 5; ++i) {
    tissue.solve(tissue.longest_step_s());
    tissue.publish();
  }
  Contact contact;
  ASSERT_TRUE(tissue.touch(0, contact));
  tissue.solve(tissue.longest_step_s());
  tissue.publish();
  const test::AllocGuard guard;
  for (int i = 0; i < 20; ++i) {
    tissue.note(0, tip_at(0.002 + 1e-5 * i), kReach_m, kTick_s * i);
    ASSERT_TRUE(tissue.touch(0, contact));
  }
  EXPECT_EQ(guard.count(), 0U);
  EXPECT_GT(contact.force_on_tool_newton.z(), 0.05);
}

// One presses 6 mm deep, 25 mm beside the other that only rests on the surface.
TEST_F(ElasticScene, TwoHandsFeelEachOtherThroughTheBody) {
  const auto scene = std::make_shared<const Scene>(scene_, kReach_m);
  const auto elastic = tissues(2);
  SceneEngine resting(scene, 1000.0, InteractionUse::kLocal, kReach_m, elastic, 0);
  SceneEngine pressing_hand(scene, 1000.0, InteractionUse::kLocal, kReach_m, elastic, 1);
  double alone = 0.0;
  double together = 0.0;
  Interaction answer;
  for (int tick = 0; tick < 800; ++tick) {
    const TimePoint now{std::chrono::milliseconds(tick)};
    ToolMotion motion;
    motion.tool_position_world_m = tip_at(0.002);
    resting.step(motion, true, now, answer);
    const double newton = answer.force_on_tool_newton.z();
    if (tick == 399) alone = newton;
    if (tick == 799) together = newton;
    motion.tool_position_world_m = tip_at(tick < 400 ? -0.04 : 0.006, 0.025);
    pressing_hand.step(motion, true, now, answer);
  }
  EXPECT_GT(alone, 0.05);
  EXPECT_LT(together, 0.8 * alone);  // the other has pressed the surface away from it
}

// 3 mm deep, then 8 mm along the surface: it sticks, slips, and the surface is dragged along.
TEST_F(ElasticScene, FrictionSticksThenSlipsAndDragsTheSurface) {
  constexpr double kMu = 0.1;
  const auto place = [](int tick) {
    return tip_at(0.003, tick < 200 ? 0.0 : 1e-3 * 0.04 * (tick - 200));
  };
  /// Mean displacement of the nodes within 15 mm of the tip along the way, in the end.
  const auto dragged_m = [&](double mu) {
    ElasticMaterial material;
    material.friction_coefficient = mu;
    const auto elastic =
        ElasticTissues::of(elastic_scene(file_, material), 1, ElasticPace::kVirtual);
    ElasticTissue& tissue = *elastic->tissues().front();
    const ElasticBody& body = tissue.body();
    std::vector<float> vertices_m;
    std::vector<float> strain;
    for (int tick = 0; tick < 400; ++tick) {
      SceneForce force;
      elastic->step(0, place(tick), kTick_s * tick, kReach_m, force);
      static_cast<void>(tissue.take_surface(vertices_m, strain));
      const Contact& contact = force.contacts[0];
      const double friction_newton = -body.shear_newton_per_m * contact.stretch_m.x();
      if (tick == 199) {
        EXPECT_NEAR(friction_newton, 0.0, 1e-12);
      }
      if (mu == 0.0) continue;
      if (tick == 205) {
        EXPECT_NEAR(contact.stretch_m.x(), 0.2e-3, 0.02e-3);
      }
      if (tick != 399) continue;
      const double normal_newton = contact.normal_world.dot(contact.elastic_force_on_tool_newton);
      EXPECT_GT(normal_newton, 0.2);
      EXPECT_NEAR(-friction_newton, mu * normal_newton, 0.05 * mu * normal_newton);
      const Vector3 whole =
          contact.elastic_force_on_tool_newton - body.shear_newton_per_m * contact.stretch_m;
      EXPECT_NEAR((contact.force_on_tool_newton - whole).norm(), 0.0, 1e-12);
    }
    double sum_m = 0.0;
    int count = 0;
    for (std::size_t i = 0; i < body.surface_nodes.size(); ++i) {
      const auto start = body.start_m.segment<3>(3 * Eigen::Index{body.surface_nodes[i]});
      if ((start - place(399)).norm() > 0.02) continue;
      sum_m += vertices_m[3 * i] - start.x();
      ++count;
    }
    return sum_m / count;
  };
  EXPECT_GT(dragged_m(kMu), dragged_m(0.0) + 0.1e-3);
}

TEST_F(ElasticScene, AHardPartIsFelt) {
  const auto force_with = [&](double part_pa) {
    ElasticMaterial material;
    material.parts = {{.where = SphereGeometry{.center_m = {0, 0, -0.015}, .radius_m = 0.014},
                       .young_pa = part_pa,
                       .poisson_ratio = 0.45,
                       .density_kg_per_m3 = 1000.0}};
    const SceneConfig scene = elastic_scene(file_, material);
    ElasticReference reference(elastic_bodies_of(scene), kTip_m, 0.02);
    SceneForce force;
    for (int i = 0; i < 12; ++i) {
      force = {};
      reference.advance(0.02 * i, tip_at(0.001 + 0.0005 * std::min(i, 8)), force);
    }
    return force.force_on_tool_newton.z();
  };
  EXPECT_GT(force_with(150e3), 1.1 * force_with(15e3));
}

TEST_F(ElasticScene, AToolThatAppearsInsideIsPushedOutAndTheBodyComesToRestAgain) {
  const auto elastic = tissues();
  double largest = 0.0;
  SceneForce force;
  for (int tick = 0; tick < 600; ++tick) {
    force = {};
    elastic->step(0, tick < 300 ? tip_at(0.025) : tip_at(-0.1), kTick_s * tick, kReach_m, force);
    ASSERT_TRUE(force.force_on_tool_newton.allFinite());
    largest = std::max(largest, force.force_on_tool_newton.z());
  }
  EXPECT_GT(largest, 0.5);
  EXPECT_EQ(force.listed_count, 0U);
  std::vector<float> vertices_m;
  std::vector<float> strain;
  ElasticTissue& tissue = *elastic->tissues().front();
  EXPECT_FALSE(tissue.take_surface(vertices_m, strain));  // asks for it
  elastic->step(0, tip_at(-0.1), 0.7, kReach_m, force);
  ASSERT_TRUE(tissue.take_surface(vertices_m, strain));
  EXPECT_LT(*std::max_element(strain.begin(), strain.end()), 0.02F);
}

TEST_F(ElasticScene, TheSurfaceForViewersIsTheComputedOne) {
  const auto elastic = tissues();
  ElasticTissue& tissue = *elastic->tissues().front();
  std::vector<float> vertices_m;
  std::vector<float> strain;
  EXPECT_FALSE(tissue.take_surface(vertices_m, strain));
  for (int tick = 0; tick < 300; ++tick) {
    SceneForce force;
    elastic->step(0, pressing(kTick_s * tick), kTick_s * tick, kReach_m, force);
    if (tick % 33 == 0) tissue.take_surface(vertices_m, strain);
  }
  ASSERT_EQ(vertices_m.size(), 3 * tissue.body().surface_nodes.size());
  ASSERT_EQ(strain.size(), tissue.body().surface_nodes.size());
  float lowest_of_top_m = 0.0F;
  for (std::size_t i = 0; i < vertices_m.size(); i += 3) {
    if (vertices_m[i + 2] > -0.005F) {
      lowest_of_top_m = std::min(lowest_of_top_m, vertices_m[i + 2]);
    }
  }
  EXPECT_LT(lowest_of_top_m, -0.002F);
  EXPECT_GT(lowest_of_top_m, -0.0035F);
  EXPECT_GT(*std::max_element(strain.begin(), strain.end()), 0.05F);
}

TEST_F(ElasticScene, InRealTimeAThreadSolvesAndTheToolFeelsIt) {
  const auto elastic = ElasticTissues::of(scene_, 1, ElasticPace::kThread);
  const auto deadline = std::chrono::steady_clock::now() + test::patience(std::chrono::seconds(60));
  PhysicsCounters counters;
  SceneForce force;
  while (counters.elastic_solves < 5 || !(force.force_on_tool_newton.z() > 0.05)) {
    ASSERT_LT(std::chrono::steady_clock::now(), deadline);
    force = {};
    elastic->step(0, tip_at(0.003), 0.0, kReach_m, force);
    elastic->count_into(counters);
    std::this_thread::yield();
  }
}

TEST_F(ElasticScene, TheNextRunFindsTheColumnsOfTheLast) {
  const test::TempFolder home;
  const std::filesystem::path folder = home.path() / "made" / "here";
  struct Run {
    ElasticTissue::Columns before{};
    ElasticTissue::Columns after{};
    double newton = 0.0;
  };
  const auto run = [&](const SceneConfig& scene) {
    ElasticTissue tissue(compliances_of(elastic_bodies_of(scene), folder).front(), 1, kTip_m);
    Run run{.before = tissue.columns()};
    Contact contact;
    for (int i = 0; i < 20; ++i) {
      tissue.note(0, tip_at(0.0002 * i - 0.002), kReach_m, kTick_s * i);
      tissue.solve(tissue.longest_step_s());
      tissue.publish();
      EXPECT_TRUE(tissue.touch(0, contact));
    }
    run.newton = contact.force_on_tool_newton.z();
    run.after = tissue.columns();
    return run;
  };
  const Run first = run(scene_);
  EXPECT_EQ(first.before.all, 0U);
  EXPECT_GT(first.after.computed, 0U);
  EXPECT_GT(first.newton, 0.01);
  const Run second = run(scene_);
  EXPECT_EQ(second.before.all, first.after.all);
  EXPECT_EQ(second.after.computed, 0U);
  EXPECT_EQ(second.newton, first.newton);

  SceneConfig sagging = scene_;  // the columns are those of the undeformed body
  std::get<ElasticMaterial>(sagging.tissues[0].material).gravity_m_per_s2 = {0, 0, -9.81};
  EXPECT_EQ(run(sagging).before.all, first.after.all);
  SceneConfig other = scene_;
  std::get<ElasticMaterial>(other.tissues[0].material).poisson_ratio = 0.3;
  EXPECT_EQ(run(other).before.all, 0U);
  EXPECT_EQ(run(other).after.computed, 0U);

  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    std::filesystem::resize_file(entry.path(), 1000);
  }
  EXPECT_EQ(run(scene_).after.computed, first.after.computed);
  EXPECT_EQ(run(scene_).after.computed, 0U);
}

TEST_F(ElasticScene, WhatIsNearARegionOfTheMeshIsHeldOrAPart) {
  TetrahedralMesh mesh = load_tetrahedral_mesh(std::get<FileGeometry>(scene_.tissues[0].geometry));
  mesh.regions.clear();
  mesh.region_names = {"organ", "vessel"};
  std::vector<Vector3> vessel_m;  // the elements of a corner
  for (const auto& corners : mesh.tetrahedra) {
    Vector3 centroid_m = Vector3::Zero();
    for (const std::uint32_t corner : corners) centroid_m += 0.25 * mesh.nodes_m[corner];
    const bool is_vessel = centroid_m.x() < -0.017 && centroid_m.y() < -0.017;
    mesh.regions.push_back(is_vessel ? 1 : 0);
    if (!is_vessel) continue;
    for (const std::uint32_t corner : corners) vessel_m.push_back(mesh.nodes_m[corner]);
  }
  std::ofstream(file_) << msh_text(mesh);
  auto& material = std::get<ElasticMaterial>(scene_.tissues[0].material);
  const double within_m = 0.02;
  const auto is_near = [&](const Vector3& point_m) {
    return std::any_of(vessel_m.begin(), vessel_m.end(), [&](const Vector3& node_m) {
      return (node_m - point_m).norm() <= within_m;
    });
  };
  material.fixed = {MeshTag{.name = "vessel", .within_m = within_m}};
  material.parts = {{.where = MeshTag{.name = "vessel", .within_m = within_m},
                     .young_pa = 6e4,
                     .density_kg_per_m3 = 1000.0}};

  const auto bodies = elastic_bodies_of(scene_);
  const elastic::BodyDescription& body = bodies.at(0)->body->description();
  std::vector<std::uint32_t> expected;
  for (std::uint32_t node = 0; node < body.mesh.nodes_m.size(); ++node) {
    if (is_near(body.mesh.nodes_m[node])) expected.push_back(node);
  }
  EXPECT_EQ(body.fixed_nodes, expected);
  for (std::size_t e = 0; e < body.mesh.element_count(); ++e) {
    Vector3 centroid_m = Vector3::Zero();
    for (const std::uint32_t corner : body.mesh.element(e)) {
      centroid_m += 0.25 * body.mesh.nodes_m[corner];
    }
    EXPECT_EQ(body.mesh.regions[e] == 1, mesh.regions[e] == 1 || is_near(centroid_m)) << e;
  }

  // what the region itself holds is less
  material.fixed = {MeshTag{.name = "vessel"}};
  const auto held = elastic_bodies_of(scene_);
  EXPECT_LT(held.at(0)->body->description().fixed_nodes.size(), expected.size());
}

TEST_F(ElasticScene, ABodyThatIsNotHeldIsRefused) {
  SceneConfig scene = scene_;
  std::get<ElasticMaterial>(scene.tissues[0].material).fixed = {
      HalfSpaceGeometry{.point_m = {0, 0, -1.0}}};
  try {
    static_cast<void>(elastic_bodies_of(scene));
    FAIL();
  } catch (const SetupError& error) {
    EXPECT_NE(std::string(error.what()).find("no node lies in a fixed place"), std::string::npos);
  }
}

TEST_F(ElasticScene, ASceneWithoutElasticTissueMakesNothing) {
  EXPECT_EQ(ElasticTissues::of({.tip_radius_m = 0.0, .tissues = {}}, 1, ElasticPace::kThread),
            nullptr);
}

}  // namespace
}  // namespace palpate::physics
