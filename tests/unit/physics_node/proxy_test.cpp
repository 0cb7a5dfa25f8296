// SPDX-License-Identifier: Apache-2.0
// The proxy: it passes through nothing thin and slides over edges and grooves without a step of the
// force. The shaft. Puncture.
#include "common/contact/proxy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "common/contact/contact_model.h"
#include "tests/property/seeds.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/tool_motion.h"
#include "tests/unit/physics_node/random_scene.h"

namespace palpate::physics {
namespace {

using test::LedTool;

constexpr double kStiffness = 500.0;

SceneConfig stiff_tissue(const Geometry& geometry, double tip_radius_m) {
  return physics::one_tissue(geometry, KelvinVoigtMaterial{.stiffness_newton_per_m = kStiffness},
                             tip_radius_m);
}

FileGeometry obj(const test::TempFolder& folder, const TriangleMesh& mesh) {
  return {.kind = FileGeometry::Kind::kTriangleSurface,
          .file = folder.write("mesh.obj", obj_text(mesh))};
}

/// Leads the tool from 30 mm above straight from one random place to the next, and back.
/// @return  what its force did on it, J: between two steps it is the last one's, or what the next
///          begins with
double work_of_wandering(LedTool& tool, int legs, const Vector3& least_m, const Vector3& most_m,
                         Random& random) {
  constexpr int kSteps = 500;
  const Vector3 above_m(0, 0, 0.03);
  Vector3 x_m = above_m;
  tool.go_to(x_m, 1e-5);
  double work_joule = 0.0;
  for (int leg = 1; leg <= legs; ++leg) {
    Vector3 to_m = above_m;
    for (int i = 0; i < 3 && leg < legs; ++i) to_m[i] = random.uniform(least_m[i], most_m[i]);
    const Vector3 step_m = (to_m - x_m) / kSteps;
    for (int i = 0; i < kSteps; ++i) {
      const Vector3 before_newton = tool.force().force_on_tool_newton;
      x_m += step_m;
      const Vector3 after_newton = tool.go_to(x_m, 1e-5).force_on_tool_newton;
      work_joule += 0.5 * (before_newton + after_newton).dot(step_m);
    }
  }
  return work_joule;
}

/// A sheet that fills the plane z = 0, described by view() alone.
class Sheet final : public Surface {
 public:
  [[nodiscard]] SurfaceView view(const Vector3& point_m, SurfaceHint&) const noexcept override {
    return {.distance_m = point_m.z(), .trust_radius_m = 0.01};
  }
  using Surface::view;
  [[nodiscard]] bool is_sheet() const noexcept override { return true; }
};

TEST(Proxy, NeedsOnlyTheViewOfASurface) {
  const Sheet sheet;
  for (const double side : {1.0, -1.0}) {
    Proxy proxy = free_at(sheet, {0, 0, side * 0.01}, {});
    EXPECT_EQ(proxy.side, side);
    for (int i = 1; i <= 20; ++i) move(sheet, 0.002, {0, 0, side * (0.01 - 1e-3 * i)}, 1e-3, proxy);

    // 10 mm on the other side, held at its radius
    EXPECT_TRUE(proxy.is_held());
    EXPECT_LT((proxy.place_m - Vector3(0, 0, side * 0.002)).norm(), 1e-12);
    EXPECT_NEAR(proxy.surface.distance_m, -0.01, 1e-12);
    EXPECT_EQ(proxy.surface.normal, Vector3(0, 0, side));
  }
}

// --- thin tissue --------------------------------------------------------------------------------

TEST(Proxy, LetsNoPokeThroughThinTissue) {
  const test::TempFolder folder;
  Random random(1);
  const auto pokes = static_cast<std::uint64_t>(test::place_count(400));
  for (const test::ThinThing& thing : test::thin_things(folder)) {
    SCOPED_TRACE(thing.name);
    const test::PokeFindings findings = test::poke(thing, pokes, random);
    EXPECT_EQ(findings.pokes, pokes);
    EXPECT_EQ(findings.popped_through, 0U);
    EXPECT_LE(findings.largest_step_over_bound, 1.0 + 1e-6);
  }
}

// A plate of 1 mm; a tip of 2 mm whose centre is 9 mm below its top: 500 · (9 + 2) mm.
TEST(Proxy, HoldsAtAnyDepthAsTheLawSays) {
  const Scene scene(stiff_tissue(BoxGeometry{.size_m = {0.1, 0.1, 0.001}}, 0.002));
  LedTool tool(scene, kStiffness);
  tool.go_to({0, 0, 0.0105}, 1e-3);
  tool.lead_to({0, 0, -0.0085}, 0.5, 1e-3);
  EXPECT_NEAR(tool.force().force_on_tool_newton.z(), 5.5, 1e-9);
  EXPECT_NEAR(tool.force().stored_energy_joule, 0.5 * kStiffness * 0.011 * 0.011, 1e-12);
  ASSERT_EQ(tool.force().listed_count, 1U);
  EXPECT_NEAR(tool.force().contacts[0].penetration_m, 0.011, 1e-12);

  // the way back: free where the top is left
  tool.lead_to({0, 0, 0.0026}, 0.5, 1e-3);
  EXPECT_EQ(tool.force().contact_count, 0U);
}

// The view of the place itself, without memory, is that of the nearest face: the other one.
TEST(Proxy, IsWhatKeepsTheSide) {
  const Scene scene(stiff_tissue(BoxGeometry{.size_m = {0.1, 0.1, 0.001}}, 0.002));
  EXPECT_LT(scene.evaluate({0, 0, -0.0015}, kAtRest).force_on_tool_newton.z(), 0.0);
}

TEST(Proxy, LeavesASheetFreeFromBehind) {
  const test::TempFolder folder;
  const Scene scene(stiff_tissue(obj(folder, sheet_mesh(0.04, 4)), 0.002), 0.05);
  LedTool tool(scene, kStiffness);
  tool.go_to({0, 0, -0.02}, 1e-3);
  tool.lead_to({0, 0, -0.0021}, 0.5, 1e-3);
  EXPECT_EQ(tool.force().contact_count, 0U);
  tool.lead_to({0, 0, 0.004}, 0.5, 1e-3);
  EXPECT_NEAR(tool.force().force_on_tool_newton.z(), -3.0, 1e-9);  // 500 · (4 + 2) mm, down
}

// A jump of more than 0.1 m is no motion.
TEST(Proxy, BeginsAnewAfterATeleport) {
  const Scene scene(stiff_tissue(BoxGeometry{.size_m = {0.1, 0.1, 0.001}}, 0.002));
  LedTool tool(scene, kStiffness);
  tool.go_to({0, 0, 0.06}, 1e-3);
  tool.go_to({0, 0, -0.06}, 1e-3);
  EXPECT_EQ(tool.force().contact_count, 0U);
}

// --- edges --------------------------------------------------------------------------------------

// |ΔF| ≤ k (4 |Δx| + 10 mm/s Δt) in every step, whether the tip's centre is outside the tissue or
// deep in it.
TEST(Proxy, SlidesOverEdgesAndGroovesWithoutAStepOfTheForce) {
  const test::TempFolder folder;
  for (const test::Slide& slide : test::slides(folder)) {
    for (const double tip_radius_m : {0.0, 0.003}) {
      // the slow way has by far the most steps
      std::vector<std::pair<double, double>> speeds{{0.08, 1e-3}, {1.0, 1e-3}, {0.2, 10e-3}};
      if (test::kIsSanitized) {
        speeds.erase(speeds.begin());
      } else {
        speeds.emplace_back(0.01, 1e-3);
      }
      for (const auto& [speed_m_per_s, dt_s] : speeds) {
        SCOPED_TRACE(slide.name);
        SCOPED_TRACE(tip_radius_m);
        SCOPED_TRACE(speed_m_per_s);
        const Scene scene(stiff_tissue(slide.geometry, tip_radius_m));
        LedTool tool(scene, kStiffness);
        tool.go_to(slide.way_m[0], dt_s);
        double largest_newton = 0.0;
        for (const Vector3& place_m : slide.way_m) {
          tool.lead_to(place_m, speed_m_per_s, dt_s);
          largest_newton = std::max(largest_newton, tool.force().force_on_tool_newton.norm());
        }
        EXPECT_GT(largest_newton, 0.4);
        EXPECT_LE(tool.largest_step_over_bound(), 1.0 + 1e-6);
      }
    }
  }
}

// A tip of 3 mm in a 90° groove along y; the tip's proxy lies in it √2 · 3 mm above the bottom.
// 1 mm below that place it is pressed up by 0.5 N, not along one wall's normal; 1 mm aside of that
// by the one it is pushed against too: (−0.5, 0.5) N.
TEST(Proxy, LiesInAGrooveAgainstBothWalls) {
  const test::TempFolder folder;
  const Scene scene(stiff_tissue(
      obj(folder,
          bar_mesh({{0, -0.01}, {0.01, 0}, {0.01, -0.02}, {-0.01, -0.02}, {-0.01, 0}}, 0.03)),
      0.003));
  const double z = -0.01 + std::numbers::sqrt2 * 0.003;
  LedTool tool(scene, kStiffness);
  tool.go_to({0, 0, 0.01}, 1e-3);
  tool.lead_to({0, 0, z - 0.001}, 0.1, 1e-3);
  EXPECT_LT((tool.force().force_on_tool_newton - Vector3(0, 0, 0.5)).norm(), 5e-3);
  tool.lead_to({0.0005, 0, z - 0.001}, 0.1, 1e-3);
  EXPECT_LT((tool.force().force_on_tool_newton - Vector3(-0.25, 0, 0.5)).norm(), 5e-3);

  // and so the model says, from one message to the next; along the groove it slides freely
  const Contact& contact = tool.force().contacts[0];
  const ModelForce model = palpate::evaluate(contact, {4e-5, 8e-5, 4e-5}, kAtRest, 0.0);
  EXPECT_LT((model.force_on_tool_newton - Vector3(-0.27, 0, 0.48)).norm(), 5e-3);
}

// It only ever moves closer to the tool, so whatever the way, round edges, through plates and
// grooves, the tool gets back no more than it gave.
TEST(Proxy, NeverGivesEnergy) {
  const test::TempFolder folder;
  Random random(3);
  double least_joule = 0.0;
  std::vector<Geometry> geometries{BoxGeometry{.size_m = {0.02, 0.02, 0.02}},
                                   BoxGeometry{.size_m = {0.02, 0.02, 0.001}}};
  geometries.emplace_back(obj(
      folder,
      bar_mesh({{0, -0.005}, {0.01, 0.01}, {0.01, -0.01}, {-0.01, -0.01}, {-0.01, 0.01}}, 0.01)));
  for (const Geometry& geometry : geometries) {
    const Scene scene(stiff_tissue(geometry, 0.001));
    for (std::uint64_t path = 0; path < test::seed_count(20); ++path) {
      LedTool tool(scene, kStiffness);
      const double work_joule =
          work_of_wandering(tool, 10, Vector3::Constant(-0.015), Vector3::Constant(0.015), random);
      EXPECT_LT(work_joule + tool.force().stored_energy_joule, 2e-5);
      least_joule = std::min(least_joule, work_joule);
    }
  }
  EXPECT_LT(least_joule, -5e-3);  // what slips off an edge is lost
}

TEST(Proxy, DoesNotAllocate) {
  const test::TempFolder folder;
  SceneConfig config = stiff_tissue(obj(folder, cube_mesh(0.02)), 0.002);
  config.shaft_length_m = 0.1;
  config.shaft_radius_m = 0.001;
  const Scene scene(config);
  TissueMemory memory = scene.new_memory();
  Random random(1);

  const test::AllocGuard guard;
  for (int i = 0; i < 1000; ++i) {
    const Vector3 x = random_in_cube(random, 0.02);
    scene.step(memory, x, kAtRest, 1e-3 * i, random.direction());
    static_cast<void>(scene.evaluate(x, kAtRest, 1e-3 * i, memory));
  }
  EXPECT_EQ(guard.count(), 0U);
}

// --- the shaft ----------------------------------------------------------------------------------

SceneConfig with_shaft(SceneConfig config, double length_m = 0.1, double radius_m = 0.002) {
  config.shaft_length_m = length_m;
  config.shaft_radius_m = radius_m;
  return config;
}

// The shaft lies along +x, 1 mm below the top of what is under its middle; the tip is free.
TEST(Shaft, IsTouchedWhereItIsDeepest) {
  const test::TempFolder folder;
  Random random(1);
  const PointCloud cloud =
      test::sampled(test::sphere_shape(0.02), 1e-3, 0.0, true, test::Sampling::kEven, random);
  const Vector3 under(0.05, 0, -0.02);
  for (const auto& [name, geometry, tolerance] :
       {std::tuple<std::string, Geometry, double>{
            "sphere", SphereGeometry{.center_m = under, .radius_m = 0.02}, 1e-9},
        {"box", BoxGeometry{.center_m = under, .size_m = {0.02, 0.04, 0.04}}, 1e-9},
        {"capsule",
         CapsuleGeometry{.from_m = under - Vector3(0, 0.03, 0),
         .to_m = under + Vector3(0, 0.03, 0),
         .radius_m = 0.02},
         1e-9},
        {"cloud",
         FileGeometry{.file = folder.write("ball.ply", ply_text(cloud)), .position_m = under},
         1e-3},
        {"mesh",
         FileGeometry{.kind = FileGeometry::Kind::kTriangleSurface,
         .file = folder.write("cube.obj", obj_text(cube_mesh(0.04))),
         .position_m = under},
         1e-9}}) {
    SCOPED_TRACE(name);
    const Scene scene(with_shaft(stiff_tissue(geometry, 0.001)));
    TissueMemory memory = scene.new_memory();
    const Vector3 tip(0, 0, 0.001);  // the shaft's lower side at −1 mm
    scene.step(memory, tip + Vector3(0, 0, 0.01), kAtRest, 0.0, Vector3::UnitX());
    const SceneForce force = scene.step(memory, tip, kAtRest, 0.01, Vector3::UnitX());
    ASSERT_EQ(force.contact_count, 1U);
    EXPECT_LT((force.force_on_tool_newton - Vector3(0, 0, 0.5)).norm(), tolerance + 1e-3);
    EXPECT_NEAR(force.stored_energy_joule, 0.5 * kStiffness * 1e-6, 1e-6 * (tolerance + 1e-1));
    EXPECT_EQ(scene.evaluate(tip, kAtRest, 0.01, memory).contact_count, 0U);  // upright
  }
}

TEST(Shaft, AddsToTheTip) {
  SceneConfig config = with_shaft(
      stiff_tissue(BoxGeometry{.center_m = {0, 0, -0.01}, .size_m = {0.02, 0.02, 0.02}}, 0.003));
  config.tissues.push_back(config.tissues[0]);
  config.tissues[1].geometry = SphereGeometry{.center_m = {0.05, 0, -0.02}, .radius_m = 0.02};
  const Scene scene(config);
  // tip 1 mm deep in the box: 0.5 N; the shaft is free of it, and touches the ball by nothing: its
  // lower side is at 0
  const SceneForce flat =
      scene.evaluate({0, 0, 0.002}, kAtRest, 0.0, TissueMemory{}, Vector3::UnitX());
  EXPECT_NEAR(flat.force_on_tool_newton.z(), 0.5, 1e-9);
  // 2 mm lower: 3 mm, and the shaft 2 mm in each
  const SceneForce pressed =
      scene.evaluate({0, 0, 0.0}, kAtRest, 0.0, TissueMemory{}, Vector3::UnitX());
  EXPECT_EQ(pressed.contact_count, 3U);
  EXPECT_NEAR(pressed.force_on_tool_newton.z(), 1.5 + 1.0 + 1.0, 1e-9);
}

// On a floor the handle's end of a shaft that dips by 0.1 rad is deepest: 10 cm · sin 0.1 below the
// tip.
TEST(Shaft, ReachesToItsEnd) {
  const Scene scene(with_shaft(stiff_tissue(HalfSpaceGeometry{}, 0.002)));
  const Vector3 shaft(std::cos(0.1), 0, -std::sin(0.1));
  const double dip_m = 0.1 * std::sin(0.1);
  const SceneForce force =
      scene.evaluate({0, 0, 0.005 + dip_m - 0.004}, kAtRest, 0.0, TissueMemory{}, shaft);
  ASSERT_EQ(force.contact_count, 1U);
  EXPECT_NEAR(force.force_on_tool_newton.z(), 500 * 0.001, 1e-9);
}

// Sideways through a plate of 0.2 mm, 80 mm wide, at 1 m/s: the shaft is held where the tip is far
// from it.
TEST(Shaft, IsNotPulledThroughThinTissue) {
  const test::TempFolder folder;
  for (const test::ThinThing& thing : test::thin_things(folder)) {
    SCOPED_TRACE(thing.name);
    const Scene scene(with_shaft(stiff_tissue(thing.geometry, 0.001), 0.15));
    TissueMemory memory = scene.new_memory();
    const Vector3 shaft = Vector3(0.02, 1, 0.03).normalized();
    SceneForce force;
    for (int i = 0; i <= 16; ++i) {
      const Vector3 tip(0.003, -0.075, 0.008 - 1e-3 * i);
      force = scene.step(memory, tip, kAtRest, 1e-3 * i, shaft);
    }
    EXPECT_GT(force.force_on_tool_newton.z(), 500 * 0.005);
  }
}

// A step of the tool within the shaft's contact: what the model says and what the scene says.
TEST(Shaft, IsDescribedForTheNextMessage) {
  const Scene scene(with_shaft(stiff_tissue(
      CapsuleGeometry{
          .from_m = {0.05, -0.05, -0.02}, .to_m = {0.05, 0.05, -0.02}, .radius_m = 0.02},
      0.001)));
  const Vector3 shaft = Vector3::UnitX();
  const Vector3 x(0, 0, 0.001);
  const SceneForce here = scene.evaluate(x, kAtRest, 0.0, TissueMemory{}, shaft);
  ASSERT_EQ(here.listed_count, 1U);
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    const Vector3 d = random.uniform(0, 0.001) * random.direction();
    const SceneForce there = scene.evaluate(x + d, kAtRest, 0.0, TissueMemory{}, shaft);
    const ModelForce model = palpate::evaluate(here.contacts[0], d, kAtRest, 0.0);
    EXPECT_LT((model.force_on_tool_newton - there.force_on_tool_newton).norm(), 1e-6);
  }
}

// --- tissue that breaks -------------------------------------------------------------------------

constexpr KelvinVoigtMaterial skin() {
  KelvinVoigtMaterial material;
  material.stiffness_newton_per_m = kStiffness;
  material.friction_stiffness_newton_per_m = kStiffness;
  material.puncture_newton = 2.0;
  material.cutting_newton = 0.5;
  return material;
}

// 500 N/m break at 2 N, 4 mm deep; then the needle is dragged by 0.5 N at most, either way.
TEST(Puncture, BreaksAtItsThresholdAndThenDrags) {
  const Scene scene(physics::one_tissue(HalfSpaceGeometry{}, skin(), 0.0));
  LedTool tool(scene, kStiffness);
  tool.go_to({0, 0, 0.01}, 1e-3);
  tool.lead_to({0, 0, -0.0039}, 0.1, 1e-3);
  EXPECT_NEAR(tool.force().force_on_tool_newton.z(), 1.95, 1e-9);
  tool.lead_to({0, 0, -0.0042}, 0.1, 1e-3);
  EXPECT_LT(tool.force().force_on_tool_newton.z(), 0.11);  // 0.2 mm on, and let go in between
  tool.lead_to({0, 0, -0.02}, 0.1, 1e-3);
  EXPECT_NEAR(tool.force().force_on_tool_newton.z(), 0.5, 1e-9);
  EXPECT_NEAR(tool.force().stored_energy_joule, 0.5 * 0.5 * 0.5 / kStiffness, 1e-12);
  tool.lead_to({0, 0, -0.015}, 0.1, 1e-3);
  EXPECT_NEAR(tool.force().force_on_tool_newton.z(), -0.5, 1e-9);
  // the model of hop 3 holds it as long
  const Contact& contact = tool.force().contacts[0];
  EXPECT_NEAR(palpate::evaluate(contact, {0, 0, -5e-5}, kAtRest, 0.0).force_on_tool_newton.z(),
              -0.475, 1e-9);
}

TEST(Puncture, HealsWhenTheToolHasLeft) {
  const Scene scene(physics::one_tissue(HalfSpaceGeometry{}, skin(), 0.001));
  LedTool tool(scene, kStiffness);
  tool.go_to({0, 0, 0.01}, 1e-3);
  tool.lead_to({0, 0, -0.01}, 0.1, 1e-3);
  tool.go_to({0, 0, 0.0011}, 1e-3);
  EXPECT_EQ(tool.force().force_on_tool_newton, Vector3(0, 0, 0));
  tool.go_to({0, 0, 0.0012}, 1e-3);
  EXPECT_EQ(tool.force().force_on_tool_newton, Vector3(0, 0, 0));
  tool.lead_to({0, 0, -0.0029}, 0.1, 1e-3);
  EXPECT_NEAR(tool.force().force_on_tool_newton.z(), 1.95, 1e-9);
}

// Through a plate of 1 mm: the tip is out on the other side, but the shaft is in the hole.
TEST(Puncture, StaysOpenRoundTheShaft) {
  const Scene scene(with_shaft(
      physics::one_tissue(BoxGeometry{.size_m = {0.1, 0.1, 0.001}}, skin(), 0.0), 0.1, 0.0005));
  LedTool tool(scene, kStiffness);
  tool.go_to({0, 0, 0.01}, 1e-3);
  tool.lead_to({0, 0, -0.02}, 0.1, 1e-3);
  EXPECT_NEAR(tool.force().force_on_tool_newton.z(), 0.5, 1e-9);
  tool.lead_to({0.0, 0, 0.02}, 0.1, 1e-3);
  EXPECT_EQ(tool.force().contact_count, 0U);
}

// In and out along random ways: the tissue only takes.
TEST(Puncture, TakesEnergyAndGivesNone) {
  Random random(5);
  for (const Geometry& geometry :
       {Geometry(HalfSpaceGeometry{}), Geometry(BoxGeometry{.size_m = {0.02, 0.02, 0.004}}),
        Geometry(SphereGeometry{.radius_m = 0.01})}) {
    const Scene scene(with_shaft(physics::one_tissue(geometry, skin(), 0.001), 0.05, 0.0005));
    for (int path = 0; path < 20; ++path) {
      LedTool tool(scene, kStiffness);
      const double work_joule =
          work_of_wandering(tool, 8, {-0.004, -0.004, -0.012}, {0.004, 0.004, 0.02}, random);
      EXPECT_LT(work_joule, 2e-5);
    }
  }
}

// 20 mm over a sphere in one step: some 30 views
TEST(ProxyViews, AProxyWithFewViewsGoesOnInTheNextStep) {
  const Shape sphere(SphereGeometry{.radius_m = 0.05});
  constexpr double kTip = 0.003;
  const auto under = [](double angle) {
    return Vector3(0.048 * std::sin(angle), 0.0, 0.048 * std::cos(angle));
  };
  Proxy free = begun_at(sphere, kTip, under(0.0), {});
  Proxy capped = free;
  move(sphere, kTip, under(0.4), 1e-3, free);
  move(sphere, kTip, under(0.4), 1e-3, capped, 8);
  EXPECT_GT(free.hint.views, 28u);
  EXPECT_LE(capped.hint.views, 28u);
  EXPECT_GT((capped.place_m - free.place_m).norm(), 1e-3);
  EXPECT_GE(sphere.view(capped.place_m).distance_m, kTip - 1e-5);
  for (int i = 0; i < 400; ++i) {
    capped.hint.views = 0;
    move(sphere, kTip, under(0.4 + (i % 2 == 0 ? 1e-3 : 0.0)), 1e-3, capped, 8);
    ASSERT_LE(capped.hint.views, 28u);
  }
  EXPECT_LT((capped.place_m - free.place_m).norm(), 1e-5);
}

}  // namespace
}  // namespace palpate::physics
