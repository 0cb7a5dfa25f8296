// SPDX-License-Identifier: Apache-2.0
// A tip stays on its side of an elastic body: pressed hard, fast, into thin bodies and from inside.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "physics_node/elastic/support.h"
#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/property/seeds.h"
#include "tests/support/elastic/tetrahedra_of.h"
#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"

namespace palpate::physics {
namespace {

constexpr double kBall_m = 0.006;
constexpr double kNear_m = 0.05;

/// The shipped block with its tumour.
SceneConfig block_scene() {
  ElasticMaterial material{.young_pa = 15e3, .viscosity_s = 0.005};
  material.fixed = {HalfSpaceGeometry{.point_m = {0, 0, -0.0499}}};
  material.parts = {{.where = SphereGeometry{.center_m = {0, 0, -0.016}, .radius_m = 0.0095},
                     .young_pa = 150e3,
                     .poisson_ratio = 0.45,
                     .density_kg_per_m3 = 1000.0}};
  return {.tip_radius_m = kBall_m,
          .tissues = {
              {.name = "block",
               .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh,
                                        .file = test::source_dir() + "/deploy/sessions/block.msh"},
               .material = material}}};
}

/// A plate of 60 × 60 mm in the middle of z = 0, held at two edges.
class ElasticPlate : public testing::Test {
 protected:
  test::TempFolder folder_;

  [[nodiscard]] SceneConfig scene(double thickness_m, double viscosity_s = 0.005) const {
    const std::vector<double> along = elastic::equal_planes(-0.03, 0.03, 8);
    const elastic::Mesh plate = elastic::box_mesh(
        along, along, elastic::equal_planes(-0.5 * thickness_m, 0.5 * thickness_m, 2));
    const std::string file = (folder_.path() / "plate.msh").string();
    std::ofstream(file) << msh_text(test::tetrahedra_of(plate));
    ElasticMaterial material{.young_pa = 15e3, .viscosity_s = viscosity_s};
    material.fixed = {HalfSpaceGeometry{.point_m = {-0.0299, 0, 0}, .normal = {1, 0, 0}},
                      HalfSpaceGeometry{.point_m = {0.0299, 0, 0}, .normal = {-1, 0, 0}}};
    return {.tip_radius_m = kBall_m,
            .tissues = {{.name = "plate",
                         .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh,
                                                  .file = file},
                         .material = material}}};
  }
};

/// Full solutions under one tip.
struct FullPress {
  std::shared_ptr<const ElasticBody> body;
  ElasticSimulation simulation;
  TipSide side;
  double time_s = 0.0;

  FullPress(const SceneConfig& scene, double step_s)
      : body(elastic_bodies_of(scene).front()), simulation(*body, 1, kBall_m, step_s) {}

  Vector3 step(const Vector3& tip_m) {
    std::array<std::optional<TipState>, 1> tips;
    if (side.follow(body->shape, body->bounds, kBall_m, kNear_m, tip_m, time_s)) {
      tips[0] = {.tip_m = tip_m, .place_m = side.place_m()};
    }
    time_s += simulation.step_s();
    simulation.step(tips);
    return simulation.touch(0).force_on_tool_newton;
  }
};

// 20 mm/s, full solutions at 50 Hz: pressing deeper never pushes less by more than 5 %, nor pulls.
TEST(ElasticSide, ATipPressedHardOntoTheTumourDoesNotFallThrough) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  FullPress press(block_scene(), 0.02);
  double before = 0.0;
  for (int i = 0; i < 50; ++i) {
    const double depth_m = 0.02 * 0.02 * i - 0.002;
    const double newton = press.step({0.0, 0.001, kBall_m - depth_m}).z();
    ASSERT_GE(newton, 0.95 * before) << depth_m;
    ASSERT_TRUE(press.simulation.report().search.is_converged) << depth_m;
    before = newton;
  }
  EXPECT_GT(before, 4.0);  // 18 mm deep
  EXPECT_EQ(press.simulation.failed_steps(), 0U);
}

// Half again as deep as the block: no solution there, and it is counted. It pushes, never pulls,
// and is right again when the tip is back.
TEST(ElasticSide, WhereTheBodyCannotGiveWayItIsCountedAndPushesStill) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  FullPress press(block_scene(), 0.02);
  const auto tip_at = [](double depth_m) { return Vector3(0.0, 0.001, kBall_m - depth_m); };
  double at_4_mm = 0.0;
  for (int i = 0; i <= 20; ++i) at_4_mm = press.step(tip_at(0.0002 * i)).z();
  for (int i = 20; i <= 150; ++i) {
    ASSERT_GT(press.step(tip_at(0.0002 * i)).z(), 0.9 * at_4_mm) << i;
  }
  EXPECT_GT(press.simulation.failed_steps(), 0U);
  const std::uint64_t failed = press.simulation.failed_steps();
  for (int i = 0; i < 10; ++i) press.step(tip_at(0.012 - 0.0008 * i));
  double again = 0.0;
  for (int i = 0; i < 20; ++i) again = press.step(tip_at(0.004)).z();
  EXPECT_NEAR(again, at_4_mm, 0.05 * at_4_mm);
  EXPECT_LE(press.simulation.failed_steps(), failed + 3) << "then the body begins again";
}

// The shipped session's solve rate, −8 mm in 40 ms: the force stays.
TEST(ElasticSide, AFastPressKeepsItsForce) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  const SceneConfig scene = block_scene();
  const auto elastic = ElasticTissues::of(scene, 1, ElasticPace::kVirtual);
  FullPress full(scene, 0.005);
  double settled = 0.0;
  for (int tick = 0; tick < 400; ++tick) {
    const double depth_m = std::min(0.008, 0.2e-3 * tick - 0.002);
    SceneForce force;
    elastic->step(0, {0.0, 0.001, kBall_m - depth_m}, 1e-3 * tick, kNear_m, force);
    if (depth_m > 0.001) {
      ASSERT_GT(force.force_on_tool_newton.z(), 0.05) << tick;
    }
    if (tick % 5 == 0) {
      settled = full.step({0.0, 0.001, kBall_m - depth_m}).z();
    }
    if (tick == 399) {
      EXPECT_NEAR(force.force_on_tool_newton.z(), settled, 0.05 * settled);
    }
  }
  PhysicsCounters counters;
  elastic->count_into(counters);
  EXPECT_EQ(counters.elastic_solves_failed, 0U);
}

// 10 mm within one full solution: it goes there in parts, and ends as after many short ones.
TEST_F(ElasticPlate, AFullSolutionFollowsATipThatMovesMoreThanARadius) {
  const SceneConfig plate = scene(0.02);
  FullPress coarse(plate, 0.02);
  FullPress fine(plate, 0.0025);
  const auto tip_at = [](double depth_m) { return Vector3(0.0, 0.0, 0.01 + kBall_m - depth_m); };
  coarse.step(tip_at(-0.002));
  fine.step(tip_at(-0.002));
  const Vector3 newton = coarse.step(tip_at(0.008));
  Vector3 wanted = Vector3::Zero();
  for (int i = 1; i <= 8; ++i) wanted = fine.step(tip_at(-0.002 + 0.00125 * i));
  EXPECT_EQ(coarse.simulation.touch(0).centre_m, tip_at(0.008));
  EXPECT_EQ(coarse.simulation.failed_steps(), 0U);
  EXPECT_NEAR(newton.z(), wanted.z(), 0.15 * wanted.z());
}

// An edge of the undeformed mesh, passed above or seen from inside, does not bend the contact.
TEST(ElasticSide, ASharpEdgeOfTheUndeformedSurfaceIsNotFelt) {
  SurfaceView view{.distance_m = 1e-4, .trust_radius_m = 1e-3};
  view.curvature_per_m.diagonal() << 1e4, 0.0, 0.0;
  const auto curvature_per_m = [&] {
    return elastic_contact(0, view, kBall_m - view.distance_m, Vector3::UnitZ(), 100.0, kBall_m)
        .curvature_per_m.norm();
  };
  EXPECT_NEAR(curvature_per_m(), 1.0 / kBall_m, 1e-6);
  view.distance_m = -1e-4;
  EXPECT_EQ(curvature_per_m(), 0.0);
  view.distance_m = 1e-4;
  view.curvature_per_m.diagonal() << 20.0, 0.0, 0.0;
  EXPECT_NEAR(curvature_per_m(), 20.0, 1e-9);
}

// At a rim the force leans away from the normal of the undeformed surface: all of it is felt.
TEST(ElasticSide, AForceAsideOfTheUndeformedNormalIsFeltWhole) {
  const Vector3 normal = Vector3::UnitZ();
  const Vector3 aside = Vector3(std::sin(1.2), 0.0, std::cos(1.2));
  EXPECT_TRUE(contact_normal(0.5 * aside, normal).isApprox(aside));
  EXPECT_EQ(contact_normal(-0.5 * aside, normal), normal);
}

TEST(ElasticSide, TheDepthOfALawIsThatOfItsForce) {
  const double k = elastic_stiffness(0.3, 0.0004);
  EXPECT_NEAR(elastic_depth_m(0.3, k), 0.0004, 1e-9);
  EXPECT_EQ(elastic_depth_m(0.3, 0.0), 0.0);
}

// Nearly through an 8 mm plate from either side: the same force, mirrored, in session and ideal.
TEST_F(ElasticPlate, IsFeltFromBothSidesPastItsThickness) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  const SceneConfig plate = scene(0.008);
  const auto press = [&](double side) {
    const auto elastic = ElasticTissues::of(plate, 1, ElasticPace::kVirtual);
    ElasticReference ideal(elastic_bodies_of(plate), kBall_m, 0.005);
    std::vector<double> newton;
    double error2 = 0.0;
    double ideal2 = 0.0;
    for (int tick = 0; tick < 650; ++tick) {
      const double depth_m = std::min(0.010, 0.02e-3 * tick - 0.001);
      const Vector3 tip_m(0.0, 0.0, side * (0.004 + kBall_m - depth_m));
      SceneForce force;
      elastic->step(0, tip_m, 1e-3 * tick, kNear_m, force);
      SceneForce wanted;
      ideal.advance(1e-3 * tick, tip_m, wanted);
      newton.push_back(side * force.force_on_tool_newton.z());
      error2 += (force.force_on_tool_newton - wanted.force_on_tool_newton).squaredNorm();
      ideal2 += wanted.force_on_tool_newton.squaredNorm();
      EXPECT_GE(newton.back(), 0.0) << tick;
    }
    EXPECT_GT(newton.back(), 0.1);
    EXPECT_LT(std::sqrt(error2 / ideal2), 0.1);
    return newton;
  };
  const std::vector<double> above = press(1.0);
  const std::vector<double> below = press(-1.0);
  // the cut of the mesh into tetrahedra is not symmetric
  for (const std::size_t tick : {200U, 400U, 600U}) {
    EXPECT_NEAR(above[tick], below[tick], 0.1 * above[tick]) << tick;
  }
}

// So slowly that no motion is left, the work of the tip is what the body stores.
TEST_F(ElasticPlate, TheWorkOfASlowPressIsTheStoredEnergy) {
  FullPress press(scene(0.008, 0.0), 0.02);
  double work_joule = 0.0;
  double before_newton = 0.0;
  double before_m = 0.0;
  for (int i = 0; i <= 300; ++i) {
    const double depth_m = 2e-5 * i;
    const double newton = press.step({0.0, 0.0, 0.004 + kBall_m - depth_m}).z();
    work_joule += 0.5 * (newton + before_newton) * (depth_m - before_m);
    before_newton = newton;
    before_m = depth_m;
  }
  const double stored_joule = press.simulation.report().elastic_joule;
  EXPECT_GT(stored_joule, 1e-4);
  EXPECT_NEAR(work_joule, stored_joule, 0.03 * stored_joule);
}

TEST_F(ElasticPlate, ATipThatAppearsInsideComesOutWhereItIsShallow) {
  const SceneConfig plate = scene(0.008);
  for (const double side : {1.0, -1.0}) {
    const auto elastic = ElasticTissues::of(plate, 1, ElasticPace::kVirtual);
    double largest = 0.0;
    for (int tick = 0; tick < (test::kIsSanitized ? 80 : 400); ++tick) {
      SceneForce force;
      elastic->step(0, {0.003, 0.002, side * 0.0015}, 1e-3 * tick, kNear_m, force);
      ASSERT_GE(side * force.force_on_tool_newton.z(), 0.0) << tick;
      largest = std::max(largest, side * force.force_on_tool_newton.z());
    }
    EXPECT_GT(largest, 0.1);
  }
}

// It did not move there, so that the body has no inertia against it: at once the force of rest.
TEST(ElasticSide, ATipThatAppearsInsideMeetsTheForceOfRestAtOnce) {
  FullPress press(block_scene(), 0.0005);
  const Vector3 tip_m(0.003, 0.002, kBall_m - 0.004);
  double largest = 0.0;
  double last = 0.0;
  for (int i = 0; i < 200; ++i) {
    last = press.step(tip_m).z();
    ASSERT_GT(last, 0.0) << i;
    largest = std::max(largest, last);
  }
  EXPECT_GT(last, 0.5);
  EXPECT_LT(largest, 1.3 * last);
  EXPECT_EQ(press.simulation.appeared(), 1U);
  EXPECT_EQ(press.simulation.failed_steps(), 0U);
}

// Down onto the free rim of a thin plate, which bends aside, and back: an edge that leans on the
// sphere is not one that it has passed through.
TEST_F(ElasticPlate, AFreeRimIsLeftWithoutAFailure) {
  FullPress press(scene(0.004), 0.0005);
  double largest = 0.0;
  for (int i = 0; i < 700; ++i) {
    const double time_s = 0.0005 * i;
    const double depth_m =
        std::min(0.1 * time_s - 0.004, 0.006 - 0.1 * std::max(0.0, time_s - 0.25));
    const Vector3 force = press.step({0.001, 0.03 + kBall_m - depth_m, 0.001});
    ASSERT_GE(force.y(), -1e-3) << i;
    largest = std::max(largest, force.norm());
  }
  EXPECT_EQ(press.simulation.failed_steps(), 0U);
  EXPECT_LT(largest, 0.15);
}

// A tip against the held rim of a block: the force does not depend on how often the body is solved,
// and the condensed contact has it.
TEST(ElasticSide, AFixedRimHasOneForce) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  const auto tip_at = [](double depth_m) {
    return Vector3(0.056 - std::clamp(depth_m, -0.002, 0.003), 0.003, -0.046);
  };
  const SceneConfig scene = block_scene();
  const auto full = [&](double step_s) {
    FullPress press(scene, step_s);
    double newton = 0.0;
    for (double time_s = 0.0; time_s < 0.4; time_s += step_s) {
      newton = press.step(tip_at(0.05 * time_s - 0.002)).x();
    }
    return newton;
  };
  const double often = full(0.002);
  EXPECT_GT(often, 1.0);
  EXPECT_NEAR(full(0.02), often, 0.1 * often);
  const auto elastic = ElasticTissues::of(scene, 1, ElasticPace::kVirtual);
  SceneForce force;
  for (int tick = 0; tick < 400; ++tick) {
    force = {};
    elastic->step(0, tip_at(5e-5 * tick - 0.002), 1e-3 * tick, kNear_m, force);
  }
  EXPECT_NEAR(force.force_on_tool_newton.x(), often, 0.15 * often);
}

// The held edge of the plate is rigid: a finite force that does not grow while the tip rests.
TEST_F(ElasticPlate, AFixedEdgeIsRigidAndItsForceDoesNotGrow) {
  const SceneConfig plate = scene(0.008);
  FullPress press(plate, 0.02);
  const auto elastic = ElasticTissues::of(plate, 1, ElasticPace::kVirtual);
  const auto tip_at = [](double depth_m) {
    return Vector3(0.0295, 0.0, 0.004 + kBall_m - depth_m);
  };
  for (int i = 0; i <= 50; ++i) press.step(tip_at(2e-5 * i));
  const double newton = press.step(tip_at(1e-3)).z();
  double later = 0.0;
  for (int i = 0; i < 200; ++i) later = press.step(tip_at(1e-3)).z();
  EXPECT_GT(newton, 0.2);
  EXPECT_LT(later, 1.15 * newton);
  SceneForce force;
  for (int tick = 0; tick < 300; ++tick) {
    force = {};
    elastic->step(0, tip_at(std::min(1e-3, 1e-5 * tick)), 1e-3 * tick, kNear_m, force);
    ASSERT_TRUE(force.force_on_tool_newton.allFinite());
  }
  EXPECT_GT(force.force_on_tool_newton.z(), 0.5 * later);
  EXPECT_LT(force.force_on_tool_newton.z(), 2.0 * later);
}

class ElasticSupport : public testing::Test {
 protected:
  /// Two cubes of 10 mm beside one another; `shared` nodes of the face between them are common.
  static elastic::Mesh two_cubes(std::size_t shared) {
    const std::vector<double> edge = {0.0, 0.01};
    const elastic::Mesh one = elastic::box_mesh(edge, edge, edge);
    elastic::Mesh both = one;
    for (const std::uint32_t node : one.elements) {
      both.elements.push_back(node + static_cast<std::uint32_t>(one.nodes_m.size()));
    }
    for (const Vector3& node_m : one.nodes_m)
      both.nodes_m.emplace_back(node_m + Vector3(0.01, 0, 0));
    std::size_t joined = 0;
    for (std::uint32_t a = 0; a < one.nodes_m.size() && joined < shared; ++a) {
      for (std::uint32_t b = 0; b < one.nodes_m.size(); ++b) {
        const auto other = static_cast<std::uint32_t>(one.nodes_m.size()) + b;
        if ((both.nodes_m[a] - both.nodes_m[other]).norm() > 1e-9) continue;
        std::replace(both.elements.begin(), both.elements.end(), other, a);
        ++joined;
      }
    }
    EXPECT_EQ(joined, shared);
    return both;
  }
  static std::string complaint(const elastic::Mesh& mesh) {
    return elastic::complaint_about_support(
        mesh, elastic::nodes_where(mesh, [](const Vector3& at) { return at.x() < 1e-9; }));
  }
};

TEST_F(ElasticSupport, PartsThatNothingHoldsAreNamed) {
  EXPECT_NE(complaint(two_cubes(0)).find("is not held anywhere"), std::string::npos);
  EXPECT_NE(complaint(two_cubes(1)).find("held at one point only"), std::string::npos);
  EXPECT_NE(complaint(two_cubes(2)).find("along a line only"), std::string::npos);
  EXPECT_EQ(complaint(two_cubes(4)), "");
  elastic::Mesh cube =
      elastic::box_mesh(std::vector{0.0, 0.01}, std::vector{0.0, 0.01}, std::vector{0.0, 0.01});
  EXPECT_EQ(elastic::complaint_about_support(cube, {0, 1, 2}), "");
  EXPECT_NE(elastic::complaint_about_support(cube, {0, 1}).find("along a line"), std::string::npos);
}

TEST_F(ElasticSupport, ElementsGivenTwiceAreNamed) {
  elastic::Mesh cube =
      elastic::box_mesh(std::vector{0.0, 0.01}, std::vector{0.0, 0.01}, std::vector{0.0, 0.01});
  cube.elements.insert(cube.elements.end(), cube.elements.begin(), cube.elements.begin() + 4);
  EXPECT_NE(complaint(cube).find("elements 1 and 6 are the same"), std::string::npos);
}

TEST_F(ElasticPlate, ABodyHeldAlongALineIsRefusedWithTheRemedy) {
  SceneConfig hinged = scene(0.008);
  std::get<ElasticMaterial>(hinged.tissues[0].material).fixed = {
      BoxGeometry{.center_m = {-0.03, 0, 0.004}, .size_m = {0.001, 0.1, 0.001}}};
  try {
    static_cast<void>(elastic_bodies_of(hinged));
    FAIL();
  } catch (const SetupError& error) {
    const std::string what = error.what();
    SCOPED_TRACE(what);
    EXPECT_NE(what.find("plate.msh"), std::string::npos);
    EXPECT_NE(what.find("turns about it"), std::string::npos);
    EXPECT_NE(what.find("elastic.fixed"), std::string::npos);
  }
}

}  // namespace
}  // namespace palpate::physics
