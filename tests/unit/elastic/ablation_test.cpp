// SPDX-License-Identifier: Apache-2.0
// Elastic tissue under an electrode: the law of its dose, the body that is left, and the tools on
// it.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <numbers>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "physics_node/elastic/support.h"
#include "physics_node/elastic_tissue/ablation/heat.h"
#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/property/seeds.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/machine/machine.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/elastic/block_mesh.h"

namespace palpate::physics::ablation {
namespace {

constexpr double kTip_m = 0.006;
constexpr double kReach_m = 0.05;
constexpr double kTick_s = 1e-3;

// --- the law -------------------------------------------------------------------------------------

TEST(Heat, TissueAllAroundTheTipTakesUpThePower) {
  const ElectrodeConfig electrode{.power_watt = 40.0, .reach_m = 0.009};
  double watt = 0.0;
  constexpr int kShells = 20'000;
  const double thickness_m = (electrode.reach_m - kTip_m) / kShells;
  for (int i = 0; i < kShells; ++i) {
    const double r = kTip_m + (i + 0.5) * thickness_m;
    watt += 4.0 * std::numbers::pi * r * r * thickness_m *
            power_density_watt_per_m3(electrode, kTip_m, r);
  }
  EXPECT_NEAR(watt, 40.0, 1e-5);
  EXPECT_EQ(power_density_watt_per_m3(electrode, kTip_m, 0.009), 0.0);
  EXPECT_EQ(power_density_watt_per_m3(electrode, kTip_m, 1.0), 0.0);
  // the largest at the tip, half of it in the middle
  const double most = power_density_watt_per_m3(electrode, kTip_m, kTip_m);
  EXPECT_NEAR(power_density_watt_per_m3(electrode, kTip_m, 0.0075), 0.5 * most, 1e-6 * most);
  EXPECT_EQ(power_density_watt_per_m3(electrode, kTip_m, 0.0), most);
}

TEST(Heat, TissueSoftensInStagesAndVanishes) {
  EXPECT_EQ(heat_stage(0.0), 0);
  EXPECT_EQ(heat_stage(0.2499), 0);
  EXPECT_EQ(heat_stage(0.25), 1);
  EXPECT_EQ(heat_stage(0.999), kHeatStages - 1);
  EXPECT_EQ(heat_stage(1.0), kHeatStages);
  EXPECT_EQ(heat_stage(1e9), kHeatStages);
  EXPECT_EQ(stiffness_ratio(0, 0.2), 1.0);
  EXPECT_NEAR(stiffness_ratio(1, 0.1), 0.7, 1e-12);
  EXPECT_NEAR(stiffness_ratio(kHeatStages - 1, 0.2), 0.2, 1e-12);
}

// --- what is held --------------------------------------------------------------------------------

// Two cells of five tetrahedra each beside each other; the far one is taken apart.
TEST(Support, WhatNothingHoldsIsLoose) {
  elastic::Mesh mesh =
      elastic::box_mesh(elastic::equal_planes(0.0, 0.03, 3), elastic::equal_planes(0.0, 0.01, 1),
                        elastic::equal_planes(0.0, 0.01, 1));
  const auto held = elastic::nodes_where(mesh, [](const Vector3& at) { return at.x() < 1e-6; });
  EXPECT_TRUE(elastic::loose_elements(mesh, held).empty());
  EXPECT_TRUE(elastic::hinged_elements(mesh).empty());

  // without the middle cell the last one hangs in the air
  mesh.elements.erase(mesh.elements.begin() + 20, mesh.elements.begin() + 40);
  EXPECT_EQ(elastic::loose_elements(mesh, held), (std::vector<std::uint32_t>{5, 6, 7, 8, 9}));
}

TEST(Support, ElementsJoinedAlongAnEdgeAreHinged) {
  elastic::Mesh mesh;
  // two tetrahedra on the edge 01, one of them smaller
  mesh.nodes_m = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -0.5, 0}};
  mesh.elements = {0, 2, 3, 1, 0, 4, 5, 1};
  ASSERT_EQ(elastic::quality_of(mesh).inverted, 0U);
  EXPECT_EQ(elastic::hinged_elements(mesh), std::vector<std::uint32_t>{1});
  std::swap(mesh.nodes_m[5], mesh.nodes_m[3]);
  mesh.nodes_m[3] = {0, 0.5, 0};
  mesh.nodes_m[5] = {0, -1, 0};
  EXPECT_EQ(elastic::hinged_elements(mesh), std::vector<std::uint32_t>{0});
}

// --- bodies --------------------------------------------------------------------------------------

/// Those of its elements, without nodes that none of them has.
TetrahedralMesh part_of(const TetrahedralMesh& whole, const std::vector<std::uint32_t>& elements) {
  TetrahedralMesh part;
  std::vector<std::int32_t> place(whole.nodes_m.size(), -1);
  for (const std::uint32_t e : elements) {
    auto corners = whole.tetrahedra[e];
    for (auto& corner : corners) {
      if (place[corner] < 0) {
        place[corner] = static_cast<std::int32_t>(part.nodes_m.size());
        part.nodes_m.push_back(whole.nodes_m[corner]);
      }
      corner = static_cast<std::uint32_t>(place[corner]);
    }
    part.tetrahedra.push_back(corners);
  }
  return part;
}

SceneConfig scene_of(const std::string& file, ElasticMaterial material) {
  material.young_pa = 15e3;
  material.fixed = {HalfSpaceGeometry{.point_m = {0, 0, -0.0499}}};
  return {.tip_radius_m = kTip_m,
          .electrode =
              ElectrodeConfig{.power_watt = 100.0, .reach_m = 0.010, .energy_joule_per_kg = 1e4},
          .tissues = {
              {.name = "block",
               .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh, .file = file},
               .material = material}}};
}

class Ablated : public testing::Test {
 protected:
  explicit Ablated(ElasticMaterial material = {.is_linear = true})
      : scene_(scene_of(write(mesh_, "whole"), std::move(material))) {}

  std::string write(const TetrahedralMesh& mesh, const std::string& name) const {
    std::string file = folder_.path() / (name + ".msh");
    std::ofstream(file) << msh_text(mesh);
    return file;
  }
  /// The same scene with these elements only, built from scratch.
  [[nodiscard]] SceneConfig scene_with(const std::vector<std::uint32_t>& elements) const {
    SceneConfig scene = scene_;
    std::get<FileGeometry>(scene.tissues[0].geometry).file =
        write(part_of(mesh_, elements), "part");
    return scene;
  }
  [[nodiscard]] std::shared_ptr<ElasticTissues> tissues(
      std::size_t tools = 1, ElasticPace pace = ElasticPace::kVirtual) const {
    return ElasticTissues::of(scene_, tools, pace);
  }
  static Vector3 force(ElasticTissues& elastic, double time_s, const Vector3& tip_m,
                       bool is_energised = false, const JawInput& jaw = {}, std::size_t tool = 0) {
    SceneForce sum;
    elastic.step(tool, tip_m, time_s, kReach_m, sum, jaw, is_energised);
    return sum.force_on_tool_newton;
  }
  static PhysicsCounters counters(const ElasticTissues& elastic) {
    PhysicsCounters counters;
    elastic.count_into(counters);
    elastic.count_tool_into(0, counters);
    return counters;
  }
  static const AblatedBody& present(const ElasticTissues& elastic) {
    return elastic.tissues()[0]->ablation().present();
  }

  void expect_what_is_left_is_a_new_body();

  TempFolder folder_;
  TetrahedralMesh mesh_ = block_of(5, 4, 5e-3);
  SceneConfig scene_;
};

class AblatedQuadratic : public Ablated {
 protected:
  AblatedQuadratic() : Ablated(ElasticMaterial{}) {}
};

Vector3 tip_at(double depth_m, double x_m = 0.0) { return {x_m, 0.0, kTip_m - depth_m}; }

/// Presses at 25 mm/s to 4 mm and stays there.
Vector3 pressing(double time_s) { return tip_at(std::min(0.004, 0.025 * time_s - 0.001)); }

/// Presses, ablates from 0.3 s to 0.7 s, and waits for what is under way.
double ablate(ElasticTissues& elastic, double until_s = 1.2) {
  double time_s = 0.0;
  for (; time_s < until_s; time_s += kTick_s) {
    SceneForce sum;
    elastic.step(0, pressing(time_s), time_s, kReach_m, sum, {}, time_s > 0.3 && time_s < 0.7);
  }
  return time_s;
}

TEST_F(Ablated, WithoutEnergyNothingChanges) {
  const auto elastic = tissues();
  scene_.electrode.reset();
  const auto plain = tissues();
  for (double time_s = 0.0; time_s < 0.4; time_s += kTick_s) {
    EXPECT_EQ(force(*elastic, time_s, pressing(time_s)),
              force(*plain, time_s, pressing(time_s), true));
  }
  EXPECT_EQ(counters(*elastic).elastic_bodies_remade, 0U);
  EXPECT_EQ(counters(*plain).elastic_energised_steps, 0U);
}

// What a tool far away heats is air.
TEST_F(Ablated, AnElectrodeOutOfReachAblatesNothing) {
  const auto elastic = tissues();
  for (double time_s = 0.0; time_s < 0.3; time_s += kTick_s) {
    static_cast<void>(force(*elastic, time_s, {0.0, 0.0, 0.02}, true));
  }
  const auto& doses = elastic->tissues()[0]->ablation().doses();
  EXPECT_EQ(*std::max_element(doses.begin(), doses.end()), 0.0);
  EXPECT_EQ(counters(*elastic).elastic_energised_steps, 300U);
}

TEST_F(Ablated, TissueUnderTheTipSoftensVanishesAndTheForceFalls) {
  const auto elastic = tissues();
  double before = 0.0;
  double least_later = 1e9;
  double time_s = 0.0;
  std::uint64_t remade_soft = 0;
  for (; time_s < 1.2; time_s += kTick_s) {
    const double newton =
        force(*elastic, time_s, pressing(time_s), time_s > 0.3 && time_s < 0.7).z();
    EXPECT_TRUE(std::isfinite(newton));
    if (time_s < 0.3) before = newton;
    if (time_s > 1.0) least_later = std::min(least_later, newton);
    if (counters(*elastic).elastic_elements_removed == 0) {
      remade_soft = counters(*elastic).elastic_bodies_remade;
    }
  }
  const PhysicsCounters after = counters(*elastic);
  EXPECT_GT(before, 0.1);
  EXPECT_GE(remade_soft, 1U) << "softer before it vanishes";
  EXPECT_GT(after.elastic_elements_removed, 5U);
  EXPECT_EQ(after.elastic_bodies_refused, 0U);
  EXPECT_LT(least_later, 0.7 * before);
  EXPECT_EQ(present(*elastic).elements.size() + after.elastic_elements_removed,
            mesh_.tetrahedra.size());
  EXPECT_EQ(after.elastic_solves_failed, 0U);
}

// The judge knows nothing of ablation: a scene of the elements that are left.
void expect_the_force_of_a_new_body(const std::shared_ptr<ElasticTissues>& elastic,
                                    const std::shared_ptr<ElasticTissues>& scratch, double time_s,
                                    double most_ratio) {
  // away, so that both come from the untouched body, and down to another depth
  double difference = 0.0;
  double largest = 0.0;
  const double begun_s = time_s;
  for (int tick = 0; tick < 1500; ++tick) {
    time_s = begun_s + kTick_s * tick;
    const double depth_m = tick < 500 ? 0.004 - 2e-5 * tick : std::min(0.009, 2e-5 * (tick - 800));
    SceneForce a;
    SceneForce b;
    elastic->step(0, tip_at(depth_m, 0.002), time_s, kReach_m, a);
    scratch->step(0, tip_at(depth_m, 0.002), time_s, kReach_m, b);
    if (tick < 1400) continue;  // both have come to rest
    difference = std::max(difference, (a.force_on_tool_newton - b.force_on_tool_newton).norm());
    largest = std::max(largest, b.force_on_tool_newton.norm());
  }
  EXPECT_GT(largest, 0.1);
  EXPECT_LT(difference, most_ratio * largest);
}

// With a softest ratio of 1 what is left has the stiffness of before.
void Ablated::expect_what_is_left_is_a_new_body() {
  scene_.electrode->softest_ratio = 1.0;
  const auto elastic = tissues();
  const double time_s = ablate(*elastic);
  ASSERT_GT(counters(*elastic).elastic_elements_removed, 5U);
  const auto scratch =
      ElasticTissues::of(scene_with(present(*elastic).elements), 1, ElasticPace::kVirtual);
  expect_the_force_of_a_new_body(elastic, scratch, time_s, 0.01);
}

TEST_F(Ablated, WhatIsLeftIsTheBodyThatIsBuiltFromScratch) { expect_what_is_left_is_a_new_body(); }

TEST_F(AblatedQuadratic, WhatIsLeftIsTheBodyThatIsBuiltFromScratch) {
  if (test::kIsSanitized) GTEST_SKIP() << "minutes";
  expect_what_is_left_is_a_new_body();
}

// The judge is a scene in which nothing was ever ablated.
TEST_F(Ablated, WhatIsRestoredIsTheBodyOfTheSession) {
  const auto elastic = tissues();
  double time_s = ablate(*elastic);
  ASSERT_LT(present(*elastic).elements.size(), mesh_.tetrahedra.size());
  elastic->restore(1);  // there is none
  elastic->restore(0);
  // the tip is where tissue comes back; longer than a solution lasts
  for (int tick = 0; tick < 25; ++tick, time_s += kTick_s) {
    EXPECT_TRUE(force(*elastic, time_s, pressing(time_s)).allFinite());
  }
  EXPECT_EQ(present(*elastic).elements.size(), mesh_.tetrahedra.size());
  const auto& doses = elastic->tissues()[0]->ablation().doses();
  EXPECT_EQ(*std::max_element(doses.begin(), doses.end()), 0.0);
  EXPECT_EQ(counters(*elastic).elastic_bodies_restored, 1U);
  expect_the_force_of_a_new_body(elastic, tissues(), time_s, 0.01);
}

// And not what was on its way when it was asked for.
TEST_F(Ablated, WhatIsRestoredWhileABodyIsMadeStaysWhole) {
  const auto elastic = tissues();
  double time_s = 0.0;
  for (; counters(*elastic).elastic_bodies_remade < 2; time_s += kTick_s) {
    static_cast<void>(force(*elastic, time_s, pressing(time_s), time_s > 0.3));
    ASSERT_LT(time_s, 2.0);
  }
  elastic->restore(0);
  for (int tick = 0; tick < 500; ++tick, time_s += kTick_s) {
    ASSERT_TRUE(force(*elastic, time_s, pressing(time_s), tick == 0).allFinite());
  }
  EXPECT_EQ(present(*elastic).elements.size(), mesh_.tetrahedra.size());
  EXPECT_EQ(present(*elastic).body(), elastic->tissues()[0]->whole());
}

TEST_F(Ablated, UnderGravityItSagsAsTheBodyThatIsBuiltFromScratch) {
  std::get<ElasticMaterial>(scene_.tissues[0].material).gravity_m_per_s2 = {0.0, 0.0, -9.81};
  scene_.electrode->softest_ratio = 1.0;
  const auto elastic = tissues();
  static_cast<void>(ablate(*elastic));
  const AblatedBody& left = present(*elastic);
  ASSERT_LT(left.elements.size(), mesh_.tetrahedra.size());
  const auto scratch = elastic_bodies_of(scene_with(left.elements));
  EXPECT_NEAR(left.body()->sag_m, scratch[0]->sag_m, 2e-6);
  EXPECT_GT(left.body()->sag_m, 1e-4);
}

// Nothing jumps: what is left is where it was, whatever has vanished beside it.
TEST_F(Ablated, TheRestStaysWhereItIsWhenABodyIsReplaced) {
  const auto elastic = tissues();
  ElasticTissue& tissue = *elastic->tissues()[0];
  std::vector<float> vertices;
  std::vector<float> strain;
  std::vector<std::uint32_t> nodes;  // of the session's body
  std::vector<float> before;
  std::uint64_t remade = 0;
  double farthest_m = 0.0;
  for (double time_s = 0.0; time_s < 1.0; time_s += kTick_s) {
    static_cast<void>(force(*elastic, time_s, pressing(time_s), time_s > 0.3 && time_s < 0.7));
    const auto body = tissue.read_surface(vertices, strain);
    ASSERT_EQ(vertices.size(), 3 * body->shown_nodes.size());
    ASSERT_TRUE(
        std::all_of(vertices.begin(), vertices.end(), [](float x) { return std::isfinite(x); }));
    std::vector<std::uint32_t> shown;
    for (const std::uint32_t node : body->shown_nodes)
      shown.push_back(present(*elastic).nodes[node]);
    if (counters(*elastic).elastic_bodies_remade > remade) {
      remade = counters(*elastic).elastic_bodies_remade;
      for (std::size_t i = 0; i < shown.size(); ++i) {
        const auto old = std::find(nodes.begin(), nodes.end(), shown[i]);
        if (old == nodes.end()) continue;
        const auto j = static_cast<std::size_t>(old - nodes.begin());
        double way2 = 0.0;
        for (std::size_t k = 0; k < 3; ++k) {
          way2 += std::pow(static_cast<double>(vertices[3 * i + k] - before[3 * j + k]), 2);
        }
        farthest_m = std::max(farthest_m, std::sqrt(way2));
      }
    }
    before = vertices;
    nodes = shown;
  }
  EXPECT_GE(remade, 2U);
  EXPECT_LT(farthest_m, 0.003) << "in a solution of 20 ms, under a tip 4 mm deep";
}

TEST_F(Ablated, TheReferenceIsAblatedAlike) {
  const auto elastic = tissues();
  ElasticReference reference(elastic_bodies_of(scene_), kTip_m, kTick_s, {}, scene_.electrode);
  double error2 = 0.0;
  double force2 = 0.0;
  const double until_s = test::kIsSanitized ? 0.5 : 1.2;
  for (double time_s = 0.0; time_s < until_s; time_s += kTick_s) {
    const bool is_energised = time_s > 0.3 && time_s < 0.7;
    const double newton = force(*elastic, time_s, pressing(time_s), is_energised).z();
    SceneForce ideal;
    reference.advance(time_s, pressing(time_s), ideal, false, is_energised);
    error2 += std::pow(newton - ideal.force_on_tool_newton.z(), 2);
    force2 += std::pow(ideal.force_on_tool_newton.z(), 2);
  }
  EXPECT_LT(std::sqrt(error2 / force2), 0.12);
}

TEST_F(Ablated, IsTheSameToTheBitAndMayBeContinued) {
  const auto first = tissues();
  const auto second = tissues();
  for (double time_s = 0.0; time_s < 0.55; time_s += kTick_s) {
    const bool is_energised = time_s > 0.3;
    ASSERT_EQ(force(*first, time_s, pressing(time_s), is_energised),
              force(*second, time_s, pressing(time_s), is_energised))
        << time_s;
  }
  ASSERT_GT(counters(*first).elastic_bodies_remade, 0U);
  // of the same bodies
  std::vector<std::shared_ptr<BodyCompliance>> shared;
  shared.push_back(std::make_shared<BodyCompliance>(first->tissues()[0]->whole()));
  ElasticTissues copy(shared, 1, kTip_m, ElasticPace::kVirtual, {}, scene_.electrode);
  copy.continue_as(*first);
  for (double time_s = 0.55; time_s < 1.0; time_s += kTick_s) {
    const bool is_energised = time_s < 0.7;
    ASSERT_EQ(force(*first, time_s, pressing(time_s), is_energised),
              force(copy, time_s, pressing(time_s), is_energised))
        << time_s;
  }
}

/// Elements whose centroid is there.
std::vector<std::uint8_t> vanished_where(const TetrahedralMesh& mesh, auto is_there) {
  std::vector<std::uint8_t> stages(mesh.tetrahedra.size(), 0);
  for (std::size_t e = 0; e < stages.size(); ++e) {
    Vector3 centroid_m = Vector3::Zero();
    for (const auto corner : mesh.tetrahedra[e]) centroid_m += 0.25 * mesh.nodes_m[corner];
    if (is_there(centroid_m)) stages[e] = kHeatStages;
  }
  return stages;
}

// A trench around the middle of the top, and the layer below it.
TEST_F(Ablated, AnIslandGoesWithWhatHeldIt) {
  const auto bodies = elastic_bodies_of(scene_);
  const AblatedBody whole = whole_body(std::make_shared<BodyCompliance>(bodies[0]));
  const auto stages = vanished_where(mesh_, [](const Vector3& at) {
    const double from_middle = std::max(std::abs(at.x()), std::abs(at.y()));
    return at.z() > -0.013 && from_middle < 0.02 && (from_middle > 0.0055 || at.z() < -0.0055);
  });
  const auto left = ablated_body(*bodies[0], whole, stages, 0.2, {});
  EXPECT_GT(left->loose, 5U);
  const auto vanished =
      static_cast<std::size_t>(std::count(stages.begin(), stages.end(), kHeatStages));
  EXPECT_EQ(left->elements.size() + vanished + left->loose, mesh_.tetrahedra.size());
  // nothing is left of the island
  for (const std::uint32_t e : left->elements) {
    Vector3 centroid_m = Vector3::Zero();
    for (const auto corner : mesh_.tetrahedra[e]) centroid_m += 0.25 * mesh_.nodes_m[corner];
    EXPECT_FALSE(centroid_m.z() > -0.0055 && std::abs(centroid_m.x()) < 0.0055 &&
                 std::abs(centroid_m.y()) < 0.0055);
  }
  EXPECT_TRUE(elastic::loose_elements(left->body()->body->mesh(),
                                      left->body()->body->description().fixed_nodes)
                  .empty());
}

// Along its support: half of the bottom may go, all of it may not.
TEST_F(Ablated, ABodyThatNothingHoldsAnyMoreIsRefused) {
  const auto bodies = elastic_bodies_of(scene_);
  const AblatedBody whole = whole_body(std::make_shared<BodyCompliance>(bodies[0]));
  const auto half =
      vanished_where(mesh_, [](const Vector3& at) { return at.z() < -0.03 && at.x() > 0.0; });
  EXPECT_LT(ablated_body(*bodies[0], whole, half, 0.2, {})->elements.size(),
            mesh_.tetrahedra.size());
  const auto all = vanished_where(mesh_, [](const Vector3& at) { return at.z() < -0.03; });
  EXPECT_THROW(static_cast<void>(ablated_body(*bodies[0], whole, all, 0.2, {})), SetupError);
}

TEST_F(Ablated, JawsKeepWhatIsLeftBetweenThem) {
  scene_.gripper = GripperConfig{.button = 1, .reach_m = 0.009};
  const auto elastic = tissues(2);
  // one tool holds the top beside the other, which ablates
  double held_newton = 0.0;
  for (double time_s = 0.0; time_s < 1.2; time_s += kTick_s) {
    const Vector3 lifted(0.012, 0.0, 0.005 + std::clamp(0.02 * (time_s - 0.3), 0.0, 0.004));
    held_newton = force(*elastic, time_s, lifted, false, {.is_closed = time_s > 0.1}, 0).z();
    static_cast<void>(
        force(*elastic, time_s, {-0.004, 0.0, 0.002}, time_s > 0.4 && time_s < 0.8, {}, 1));
    ASSERT_TRUE(std::isfinite(held_newton));
  }
  EXPECT_GT(counters(*elastic).elastic_elements_removed, 0U);
  EXPECT_GT(counters(*elastic).elastic_points_held, 0U);
  EXPECT_LT(held_newton, -0.02) << "it pulls back";
}

// --- everything at once --------------------------------------------------------------------------

// Random ways, energised at random: finite, not inverted when a body is replaced, and each body is
// one that a session might have.
TEST_F(Ablated, RandomWaysLeaveUsableBodies) {
  mesh_ = block_of(3, 3, 9e-3);
  scene_ = scene_of(write(mesh_, "coarse"), {.is_linear = true});
  scene_.electrode->reach_m = 0.012;
  std::uint64_t removed = 0;
  for (const std::uint64_t seed : test::seeds(12)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    scene_.electrode->power_watt = std::pow(10.0, 2.5 + 0.7 * uniform(random));
    std::get<ElasticMaterial>(scene_.tissues[0].material).viscosity_s =
        uniform(random) > 0.0 ? 0.005 : 0.0;
    const auto elastic = tissues();
    Vector3 tip_m(0.0, 0.0, 0.008);
    Vector3 velocity = Vector3::Zero();
    std::uint64_t remade = 0;
    bool is_energised = false;
    for (double time_s = 0.0; time_s < 0.6; time_s += kTick_s) {
      velocity += 0.02 * Vector3(uniform(random), uniform(random), uniform(random)) -
                  0.5 * kTick_s / 0.01 * (tip_m - Vector3(0.0, 0.0, -0.004));
      velocity *= std::min(1.0, 0.3 / std::max(velocity.norm(), 1e-9));
      tip_m += kTick_s * velocity;
      if (std::abs(uniform(random)) < 0.02) is_energised = !is_energised;
      ASSERT_TRUE(force(*elastic, time_s, tip_m, is_energised).allFinite()) << time_s;
      if (counters(*elastic).elastic_bodies_remade == remade) continue;
      remade = counters(*elastic).elastic_bodies_remade;
      const elastic::Body& body = *present(*elastic).body()->body;
      ASSERT_TRUE(elastic::quality_of(body.mesh()).is_usable());
      ASSERT_EQ(elastic::complaint_about_support(body.mesh(), body.description().fixed_nodes), "");
    }
    removed += counters(*elastic).elastic_elements_removed;
  }
  EXPECT_GT(removed, 10U) << "this says nothing";
}

// In real time a body is made on a thread of its own, and the step of the tool does not allocate.
TEST_F(Ablated, InRealTimeTheStepsGoOn) {
  const auto elastic = tissues(1, ElasticPace::kThread);
  double newton = 0.0;
  const auto begin = std::chrono::steady_clock::now();
  while (counters(*elastic).elastic_elements_removed == 0) {
    const double time_s =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    ASSERT_LT(time_s, 60.0) << "no element has vanished";
    SceneForce sum;
    {
      const test::AllocGuard guard;
      elastic->step(0, pressing(time_s), time_s, kReach_m, sum, {}, time_s > 0.2);
      ASSERT_EQ(guard.count(), 0U);
    }
    newton = sum.force_on_tool_newton.z();
    ASSERT_TRUE(std::isfinite(newton));
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_GE(counters(*elastic).elastic_bodies_remade, 1U);
}

}  // namespace
}  // namespace palpate::physics::ablation
