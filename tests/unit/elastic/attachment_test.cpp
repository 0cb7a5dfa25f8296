// SPDX-License-Identifier: Apache-2.0
// Bodies that springs hold, such as ligaments, against closed forms.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "physics_node/elastic/dynamics.h"
#include "physics_node/elastic_tissue/elastic_body.h"
#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/elastic_tissue/unloaded.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/property/seeds.h"
#include "tests/support/elastic/tetrahedra_of.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/elastic/random_shape.h"

namespace palpate::bed {

constexpr double kTip_m = 0.006;
constexpr double kTick_s = 1e-3;
constexpr double kArea_m2 = 0.06 * 0.06;
constexpr double kSprings_pa_per_m = 1e5;

}  // namespace palpate::bed

namespace palpate::elastic {
namespace {

/// Springs of k per area on the faces where the predicate holds for all corners.
template <class Predicate>
std::vector<Attachment> springs(const Mesh& mesh, double k_pa_per_m, Predicate is_there) {
  std::vector<Attachment> attachments;
  const std::size_t first = mesh.nodes_per_element == 4 ? 0 : 3;
  for (const Face& face : surface_of(mesh)) {
    const auto corner = [&](std::size_t i) { return mesh.nodes_m[face.nodes[i]]; };
    if (!is_there(corner(0)) || !is_there(corner(1)) || !is_there(corner(2))) continue;
    const double area_m2 = 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
    for (std::size_t i = first; i < first + 3; ++i) {
      attachments.push_back({face.nodes[i], k_pa_per_m * area_m2 / 3.0});
    }
  }
  return attachments;
}

// Central differences: their error is of the order of step² and rounding / step.
TEST(Attachments, ForcesAreTheDerivativeOfTheEnergyAndStiffnessThatOfTheForces) {
  for (const bool is_quadratic : {false, true}) {
    const Mesh linear = beam_mesh(3, 1);
    BodyDescription description{
        .mesh = is_quadratic ? quadratic(linear) : linear,
        .materials = {{.young_modulus_pa = 1e3, .poisson_ratio = 0.4, .stiffness_damping_s = 0.01}},
        .law = Law::kStableNeoHookean,
        .fixed_nodes = {}};
    description.attachments =
        springs(description.mesh, 1e6, [](const Vector3d& at) { return at.x() < 1e-9; });
    const Body body(description);
    EquilibriumSearch search(body);
    const VectorXd before = random_shape(body, 1e-3, 2);
    const VectorXd x = random_shape(body, 1e-3, 1);
    remember(search.batches(), before.data());
    const VectorXd pull = VectorXd::Zero(x.size());
    const Goal goal{.step_s = 0.02,
                    .inertial_m = before.data(),
                    .before_m = before.data(),
                    .stiffening = 0.7,
                    .pull_newton = &pull};
    search.evaluate(goal, x);
    const VectorXd gradient = search.gradient();
    // the elements' tangent is checked in body_test.cpp; here what the springs add to it
    BlockValues with;
    body.stiffness(x, no_rotations(body.node_count()), goal.shift(), false, with);
    for (const Attachment& one : body.description().attachments) {
      const Eigen::Index k = 3 * Eigen::Index{one.node} + 1;
      VectorXd moved = x;
      constexpr double kStep = 1e-7;
      moved[k] = x[k] + kStep;
      const double above = search.evaluate(goal, moved);
      const double ahead = search.gradient()[k];
      moved[k] = x[k] - kStep;
      const double below = search.evaluate(goal, moved);
      const double behind = search.gradient()[k];
      EXPECT_NEAR((above - below) / (2 * kStep), gradient[k], 1e-6 * gradient.norm());
      const auto row = static_cast<std::uint32_t>(body.pattern().row_of[one.node]);
      const double diagonal = with[9 * std::size_t{body.pattern().starts[row]} + 4];
      EXPECT_NEAR((ahead - behind) / (2 * kStep) / diagonal, 1.0, 0.05);
      EXPECT_GT(diagonal, 1.7 * one.stiffness_newton_per_m);
    }
  }
}

// A bar of E A/L on springs of k A: F = way/(L/(E A) + 1/(k A)); under gravity along it the springs
// give way by ρ L g/k.
TEST(Attachments, ABarOnSpringsGivesWayAsBothInARow) {
  constexpr double kLength_m = 0.1;
  constexpr double kArea_m2 = 4e-4;
  constexpr double kYoung_pa = 10e3;
  constexpr double kSprings_pa_per_m = 2e5;
  const std::array<double, 3> along{0.0, 0.05, kLength_m};
  const std::array<double, 2> across{0.0, 0.02};
  for (const bool is_quadratic : {false, true}) {
    const Mesh linear = box_mesh(along, across, across);
    BodyDescription bar{.mesh = is_quadratic ? quadratic(linear) : linear,
                        .materials = {{.young_modulus_pa = kYoung_pa, .poisson_ratio = 0.0}},
                        .law = Law::kCorotational,
                        .fixed_nodes = {},
                        .gravity_m_per_s2 = {0.1, 0.0, 0.0}};
    bar.attachments =
        springs(bar.mesh, kSprings_pa_per_m, [](const Vector3d& at) { return at.x() < 1e-9; });
    double newton_per_m = 0.0;
    for (const Attachment& one : bar.attachments) newton_per_m += one.stiffness_newton_per_m;
    EXPECT_NEAR(newton_per_m, kSprings_pa_per_m * kArea_m2, 1e-9);
    const Body body(bar);
    EquilibriumSearch search(body);
    WarpedFactor factor(body, Precision::kDouble);
    VectorXd x = body.rest_m();
    ASSERT_TRUE(find_rest(search, factor, nullptr, {.tolerance_m = 1e-10}, x).is_converged);
    double root_m = 0.0;
    double end_m = 0.0;
    for (Eigen::Index i = 0; i < x.size(); i += 3) {
      const double way_m = x[i] - body.rest_m()[i];
      if (body.rest_m()[i] < 1e-9) root_m = std::max(root_m, way_m);
      end_m = std::max(end_m, way_m);
    }
    const double weight_newton = 0.1 * 1000.0 * kArea_m2 * kLength_m;
    const double of_springs_m = weight_newton / (kSprings_pa_per_m * kArea_m2);
    const double of_bar_m = 0.5 * weight_newton * kLength_m / (kYoung_pa * kArea_m2);
    EXPECT_NEAR(root_m, of_springs_m, 0.02 * of_springs_m) << is_quadratic;
    EXPECT_NEAR(end_m, of_springs_m + of_bar_m, 0.03 * (of_springs_m + of_bar_m)) << is_quadratic;
  }
}

/// A block of 60 × 60 × 30 mm, its top at z = 0, so stiff that it moves as a whole.
Mesh stiff_block() {
  const std::vector<double> planes_m = equal_planes(-0.03, 0.03, 6);
  return box_mesh(planes_m, planes_m, equal_planes(-0.03, 0.0, 3));
}
// It swings with √(k A/m), without a gain of energy, and relaxes with its branches.
TEST(Attachments, AStiffBlockSwingsOnItsBed) {
  BodyDescription block{.mesh = stiff_block(),
                        .materials = {{.young_modulus_pa = 10e6, .poisson_ratio = 0.3}},
                        .law = Law::kCorotational,
                        .fixed_nodes = {}};
  block.attachments = springs(block.mesh, bed::kSprings_pa_per_m,
                              [](const Vector3d& at) { return at.z() < -0.0299; });
  const Body body(block);
  VectorXd v = VectorXd::Zero(body.rest_m().size());
  for (Eigen::Index i = 2; i < v.size(); i += 3) v[i] = 0.05;
  Dynamics dynamics(body, {.theta = 0.5, .tolerance_m = 1e-9});
  dynamics.set_state(body.rest_m(), v);
  const double rate = std::sqrt(bed::kSprings_pa_per_m * bed::kArea_m2 / body.mass_kg().sum());
  const double period_s = 2.0 * 3.14159265358979 / rate;
  double energy = 0.5 * body.mass_kg().sum() * 0.05 * 0.05;
  const int steps = 400;
  for (int i = 1; i <= steps; ++i) {
    const StepReport report = dynamics.step(2.0 * period_s / steps);
    EXPECT_LE(report.energy_joule(), energy * (1.0 + 1e-6));
    energy = report.energy_joule();
    if (i != steps / 8) continue;
    // a quarter of a period on: all in the springs
    EXPECT_NEAR(dynamics.x_m()[2] - body.rest_m()[2], 0.05 / rate, 0.02 * 0.05 / rate);
    EXPECT_NEAR(report.elastic_joule, energy, 0.02 * energy);
  }
  EXPECT_GT(energy, 0.97 * 0.5 * body.mass_kg().sum() * 0.05 * 0.05);
  EXPECT_NEAR(dynamics.v_m_per_s()[2], 0.05, 0.02 * 0.05);
}

// Springs alone hold it: without its load it stands higher by the weight over k A.
TEST(Attachments, TheShapeOfAScanHangsInItsLigaments) {
  BodyDescription block{
      .mesh = quadratic(
          box_mesh(equal_planes(0, 0.06, 3), equal_planes(0, 0.06, 3), equal_planes(0, 0.03, 2))),
      .materials = {{.young_modulus_pa = 20e3, .poisson_ratio = 0.45}},
      .law = Law::kStableNeoHookean,
      .fixed_nodes = {},
      .gravity_m_per_s2 = {0.0, 0.0, -9.81}};
  block.attachments =
      springs(block.mesh, bed::kSprings_pa_per_m, [](const Vector3d& at) { return at.z() < 1e-9; });

  const UnloadedShape shape = find_unloaded_shape(block);

  ASSERT_TRUE(shape.is_converged);
  EXPECT_LT(shape.away_m, 2e-4);
  double mean_m = 0.0;
  double count = 0.0;
  for (std::size_t i = 0; i < block.mesh.nodes_m.size(); ++i) {
    if (block.mesh.nodes_m[i].z() > 1e-9) continue;
    mean_m += shape.mesh.nodes_m[i].z() - block.mesh.nodes_m[i].z();
    count += 1.0;
  }
  EXPECT_NEAR(mean_m / count, 1000.0 * 0.03 * 9.81 / bed::kSprings_pa_per_m, 2e-4);
}

TEST(Attachments, RefusesSpringsThatCannotBe) {
  for (const Attachment& bad : {Attachment{100'000, 1.0}, {0, 0.0}, {0, -1.0}, {0, std::nan("")}}) {
    EXPECT_THROW(Body({.mesh = beam_mesh(2, 1), .fixed_nodes = {}, .attachments = {bad}}),
                 std::invalid_argument);
  }
}

}  // namespace
}  // namespace palpate::elastic

namespace palpate::physics {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class AttachedScene : public testing::Test {
 protected:
  test::TempFolder folder_;
  SceneConfig scene_ = scene();

  /// The stiff block of above; the part of y > 0 is the region "half".
  SceneConfig scene() {
    TetrahedralMesh mesh = test::tetrahedra_of(elastic::stiff_block());
    mesh.region_names = {"rest", "half"};
    for (const auto& corners : mesh.tetrahedra) {
      double y = 0.0;
      for (const std::uint32_t corner : corners) y += mesh.nodes_m[corner].y();
      mesh.regions.push_back(y > 0.0 ? 1 : 0);
    }
    const std::string file = folder_.write("block.msh", msh_text(mesh));
    ElasticMaterial material{.young_pa = 500e3, .poisson_ratio = 0.3, .mass_damping_per_s = 60.0};
    material.attached = {{.where = HalfSpaceGeometry{.point_m = {0, 0, -0.0299}},
                          .stiffness_pa_per_m = bed::kSprings_pa_per_m}};
    return {.tip_radius_m = bed::kTip_m,
            .tissues = {{.name = "block",
                         .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh,
                                                  .file = file},
                         .material = material}}};
  }
  ElasticMaterial& material() { return std::get<ElasticMaterial>(scene_.tissues[0].material); }
};

// On a bed of springs the block gives way by F/(k A), and pressed aside by x, where it turns as
// well, by F/(k A) (1 + 12 x²/a²); what is left of the depth indents it as if it stood on a floor.
TEST_F(AttachedScene, ABlockOnABedOfSpringsPushesWithAreaTimesDepth) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  constexpr double kDepth_m = 0.003;
  constexpr int kTicks = 350;
  const auto tip_at = [](double x_m, double depth_m) {
    return Vector3(x_m, 0.0, bed::kTip_m - depth_m);
  };
  SceneConfig on_floor = scene_;
  auto& floor = std::get<ElasticMaterial>(on_floor.tissues[0].material);
  floor.fixed = {floor.attached[0].where};
  floor.attached.clear();
  for (const double x_m : {0.0, 0.015}) {
    const auto elastic = ElasticTissues::of(scene_, 1, ElasticPace::kVirtual);
    ElasticReference reference(elastic_bodies_of(scene_), bed::kTip_m, bed::kTick_s);
    double error2 = 0.0;
    double force2 = 0.0;
    double full = 0.0;
    double condensed = 0.0;
    for (int tick = 0; tick < kTicks; ++tick) {
      const double time_s = bed::kTick_s * tick;
      const Vector3 tip_m = tip_at(x_m, std::min(kDepth_m, 0.03 * time_s - 0.0005));
      SceneForce force;
      elastic->step(0, tip_m, time_s, 0.05, force);
      SceneForce ideal;
      reference.advance(time_s, tip_m, ideal);
      full = ideal.force_on_tool_newton.z();
      condensed = force.force_on_tool_newton.z();
      error2 += (condensed - full) * (condensed - full);
      force2 += full * full;
    }
    EXPECT_LT(std::sqrt(error2 / force2), 0.1) << x_m;
    EXPECT_NEAR(condensed / full, 1.0, 0.02) << x_m;
    const double given_m =
        full / (bed::kSprings_pa_per_m * bed::kArea_m2) * (1.0 + 12.0 * x_m * x_m / bed::kArea_m2);
    EXPECT_GT(given_m, 0.5 * kDepth_m);
    ElasticReference hard(elastic_bodies_of(on_floor), bed::kTip_m, bed::kTick_s);
    double wanted = 0.0;
    for (int tick = 0; tick < 100; ++tick) {
      SceneForce force;
      hard.advance(bed::kTick_s * tick, tip_at(x_m, kDepth_m - given_m), force);
      wanted = force.force_on_tool_newton.z();
    }
    // by the law of Hertz to the depth at which the floor has the same force
    const double indented_m = (kDepth_m - given_m) * std::pow(full / wanted, 2.0 / 3.0);
    EXPECT_NEAR((kDepth_m - indented_m) / given_m, 1.0, 0.03) << x_m;
  }
}

TEST_F(AttachedScene, SpringsOfARegionAreOnTheFacesOfItsElements) {
  material().attached = {
      {.where = MeshTag{.name = "half"}, .stiffness_pa_per_m = bed::kSprings_pa_per_m}};
  double newton_per_m = 0.0;
  const auto bodies = elastic_bodies_of(scene_);
  for (const elastic::Attachment& one : bodies.at(0)->body->description().attachments) {
    newton_per_m += one.stiffness_newton_per_m;
  }
  // half of the top and the bottom, one side of 60 mm, halves of two others
  const double area_m2 = 2.0 * 0.03 * 0.06 + 0.06 * 0.03 + 2.0 * 0.03 * 0.03;
  EXPECT_NEAR(newton_per_m / (bed::kSprings_pa_per_m * area_m2), 1.0, 1e-6);
  EXPECT_THAT(mesh_report(*bodies.at(0)), HasSubstr("(0 fixed, "));
  EXPECT_THAT(mesh_report(*bodies.at(0)), HasSubstr("attached with 720 N/m)"));
}

TEST_F(AttachedScene, PlacesThatCatchNothingAreNamed) {
  EXPECT_TRUE(elastic_bodies_of(scene_).at(0)->idle_places.empty());
  const HalfSpaceGeometry nowhere{.point_m = {0, 0, -1}};
  const HalfSpaceGeometry bottom{.point_m = {0, 0, -0.0299}};
  material().fixed = {bottom, nowhere};
  material().attached = {
      {.where = bottom, .stiffness_pa_per_m = 1e5},
      {.where = nowhere, .stiffness_pa_per_m = 1e5},
      {.where = BoxGeometry{.size_m = Vector3::Constant(0.07)}, .stiffness_pa_per_m = 1e5}};
  material().parts = {{.where = nowhere, .young_pa = 1e5, .density_kg_per_m3 = 1000.0}};
  EXPECT_THAT(
      elastic_bodies_of(scene_).at(0)->idle_places,
      ElementsAre(HasSubstr("elastic.fixed[1] holds nothing: no node lies there"),
                  HasSubstr("elastic.attached[0] holds nothing that elastic.fixed does not hold"),
                  HasSubstr("elastic.attached[1] holds nothing: no face of the surface lies there"),
                  HasSubstr("elastic.part[0] has no element of the mesh")));
}

TEST_F(AttachedScene, IsRefusedWhereNothingHolds) {
  const auto complaint = [&] {
    try {
      static_cast<void>(elastic_bodies_of(scene_));
    } catch (const SetupError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  material().attached[0].where = HalfSpaceGeometry{.point_m = {0, 0, -1}};
  EXPECT_THAT(complaint(), HasSubstr("no face of the surface in an attached one"));
  material().attached[0].where = MeshTag{.name = "ligament"};
  EXPECT_THAT(complaint(), HasSubstr("tag: \"ligament\": the mesh has only the regions \"rest\""));
}

}  // namespace
}  // namespace palpate::physics
