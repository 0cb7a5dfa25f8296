// SPDX-License-Identifier: Apache-2.0
// tool_motion.h — a tool led through a scene, and how its force changes from step to step: against
// thin tissue, and over edges. Shared by the tests and the benches of the proxy.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "common/contact/proxy.h"
#include "common/core/random.h"
#include "physics_node/files/ply.h"
#include "physics_node/scene/scene.h"
#include "tests/support/sampled_clouds.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/physics_node/test_meshes.h"

namespace palpate::test {

/// A tool in a scene of one tissue of stiffness k.
class LedTool {
 public:
  LedTool(const physics::Scene& scene, double stiffness_newton_per_m)
      : scene_(scene), k_(stiffness_newton_per_m), memory_(scene.new_memory()) {}

  const physics::SceneForce& go_to(const Vector3& x_m, double dt_s) {
    const physics::SceneForce last = force_;
    time_s_ += dt_s;
    force_ = scene_.step(memory_, x_m, Vector3::Zero(), time_s_);
    if (has_moved_) {
      const double step_newton = (force_.force_on_tool_newton - last.force_on_tool_newton).norm();
      const double bound_newton =
          k_ * (kMostForcePerMotion * (x_m - x_m_).norm() + kCreep_m_per_s * dt_s);
      largest_step_newton_ = std::max(largest_step_newton_, step_newton);
      largest_step_over_bound_ = std::max(largest_step_over_bound_, step_newton / bound_newton);
    }
    has_moved_ = true;
    x_m_ = x_m;
    return force_;
  }
  /// In a straight line at this speed.
  void lead_to(const Vector3& to_m, double speed_m_per_s, double dt_s) {
    const Vector3 from_m = x_m_;
    const int steps =
        std::max(1, static_cast<int>(std::ceil((to_m - from_m).norm() / (speed_m_per_s * dt_s))));
    for (int i = 1; i <= steps; ++i) go_to(from_m + i * (to_m - from_m) / steps, dt_s);
  }

  [[nodiscard]] const physics::SceneForce& force() const { return force_; }
  [[nodiscard]] double largest_step_newton() const { return largest_step_newton_; }
  /// Of common/contact/proxy.h; at most 1.
  [[nodiscard]] double largest_step_over_bound() const { return largest_step_over_bound_; }

 private:
  const physics::Scene& scene_;
  double k_;
  physics::TissueMemory memory_;
  physics::SceneForce force_;
  Vector3 x_m_ = Vector3::Zero();
  double time_s_ = 0.0;
  bool has_moved_ = false;
  double largest_step_newton_ = 0.0;
  double largest_step_over_bound_ = 0.0;
};

/// Thin tissue about the plane z = 0, 80 mm wide, with the outside up.
struct ThinThing {
  std::string name;
  Geometry geometry;
  bool has_back = true;    ///< may be poked from below
  double lateral_m = 0.0;  ///< pokes may go so far aside
};

/// The two faces of a slab as points with normals, one per spacing².
inline physics::PointCloud slab_cloud(double half_edge_m, double thickness_m, double spacing_m) {
  physics::PointCloud cloud;
  const int cells = static_cast<int>(2.0 * half_edge_m / spacing_m);
  for (const double side : {1.0, -1.0}) {
    for (int i = 0; i <= cells; ++i) {
      for (int j = 0; j <= cells; ++j) {
        cloud.points_m.push_back(
            {i * spacing_m - half_edge_m, j * spacing_m - half_edge_m, 0.5 * side * thickness_m});
        cloud.normals.push_back({0, 0, side});
      }
    }
  }
  return cloud;
}

inline std::vector<ThinThing> thin_things(const TempFolder& folder) {
  using Kind = FileGeometry::Kind;
  constexpr double kHalf_m = 0.04;
  const double thin_m = 2e-4;
  return {
      {"box, 0.2 mm", BoxGeometry{.size_m = {2 * kHalf_m, 2 * kHalf_m, thin_m}}, true, 0.01},
      {"closed mesh, 0.2 mm",
       FileGeometry{.kind = Kind::kTriangleSurface,
                    .file = folder.write(
                        "plate.obj", physics::obj_text(physics::bar_mesh({{-kHalf_m, -0.5 * thin_m},
                                                                          {-kHalf_m, 0.5 * thin_m},
                                                                          {kHalf_m, 0.5 * thin_m},
                                                                          {kHalf_m, -0.5 * thin_m}},
                                                                         kHalf_m)))},
       true, 0.01},
      {"open mesh",
       FileGeometry{
           .kind = Kind::kTriangleSurface,
           .file = folder.write("sheet.obj", physics::obj_text(physics::sheet_mesh(kHalf_m, 8)))},
       true, 0.01},
      {"cloud, 1 mm",
       FileGeometry{
           .file = folder.write("slab.ply", physics::ply_text(slab_cloud(kHalf_m, 1e-3, 2e-3)))},
       true, 0.01},
      {"capsule, 1 mm",
       CapsuleGeometry{.from_m = {-kHalf_m, 0, 0}, .to_m = {kHalf_m, 0, 0}, .radius_m = 5e-4}, true,
       0.0}};
}

struct PokeFindings {
  std::size_t pokes = 0;
  std::size_t popped_through = 0;
  double largest_step_over_bound = 0.0;
};

/// Straight through the thin tissue, at up to 1 m/s, from 10 mm off one side to 3 … 10 mm behind
/// the other, by tips of 0 … 3 mm at steps of 1 ms (half of them) … 20 ms: it is through unless it
/// is still pressed back to where it came from, as hard as the depth asks.
inline void poke(const ThinThing& thing, const physics::Scene& scene, double tip_radius_m,
                 Random& random, PokeFindings& findings) {
  constexpr double kStiffness = 500.0;
  const double side = thing.has_back && random.chance(0.5) ? -1.0 : 1.0;
  const double dt_s = random.chance(0.5) ? 1e-3 : random.uniform(1e-3, 20e-3);
  const double depth_m = random.uniform(0.003, 0.01);
  const auto aside = [&] {
    return Vector3(random.uniform(-0.01, 0.01),
                   thing.lateral_m > 0.0 ? random.uniform(-thing.lateral_m, thing.lateral_m) : 0.0,
                   0.0);
  };
  LedTool tool(scene, kStiffness);
  tool.go_to(aside() + Vector3(0, 0, side * 0.01), dt_s);
  tool.lead_to(aside() - Vector3(0, 0, side * depth_m), random.uniform(0.02, 1.0), dt_s);
  const double push_newton = side * tool.force().force_on_tool_newton.z();
  ++findings.pokes;
  if (!(push_newton > 0.99 * kStiffness * (depth_m + tip_radius_m))) ++findings.popped_through;
  findings.largest_step_over_bound =
      std::max(findings.largest_step_over_bound, tool.largest_step_over_bound());
}

/// `count` pokes, 100 with each tip.
inline PokeFindings poke(const ThinThing& thing, std::size_t count, Random& random) {
  PokeFindings findings;
  while (findings.pokes < count) {
    const double tip_radius_m = random.chance(0.3) ? 0.0 : random.uniform(0.0, 0.003);
    const physics::Scene scene(
        {.tip_radius_m = tip_radius_m,
         .tissues = {{.name = thing.name,
                      .geometry = thing.geometry,
                      .material = KelvinVoigtMaterial{.stiffness_newton_per_m = 500.0}}}},
        0.05);
    for (int i = 0; i < 100 && findings.pokes < count; ++i) {
      poke(thing, scene, tip_radius_m, random, findings);
    }
  }
  return findings;
}

struct Slide {
  std::string name;
  Geometry geometry;
  std::vector<Vector3> way_m;
};

/// Over the edge of a cube and round a corner, through a groove and over its rims, over the facets
/// of a coarse ball, pressed by 1 … 6 mm.
inline std::vector<Slide> slides(const TempFolder& folder) {
  const FileGeometry groove{
      .kind = FileGeometry::Kind::kTriangleSurface,
      .file = folder.write("groove.obj", physics::obj_text(physics::bar_mesh({{0, -0.01},
                                                                              {0.01, 0},
                                                                              {0.03, 0},
                                                                              {0.03, -0.02},
                                                                              {-0.03, -0.02},
                                                                              {-0.03, 0},
                                                                              {-0.01, 0}},
                                                                             0.03)))};
  std::vector<Slide> result;
  for (const auto& [deep_m, deep] :
       {std::pair{0.001, ", 1 mm deep"}, {0.0025, ", 2.5 mm deep"}, {0.006, ", 6 mm deep"}}) {
    const double z = -deep_m;
    const std::vector<Vector3> over_edge{
        {0, 0.002, 0.01}, {0, 0.002, z},     {0.03, 0.004, z}, {0.03, 0.004, 0.01},
        {0.0, 0.001, z},  {-0.03, -0.03, z}, {0, 0, z}};
    result.push_back({std::string("box") + deep,
                      BoxGeometry{.center_m = {0, 0, -0.02}, .size_m = {0.04, 0.04, 0.04}},
                      over_edge});
    result.push_back(
        {std::string("cube mesh") + deep,
         FileGeometry{.kind = FileGeometry::Kind::kTriangleSurface,
                      .file = folder.write("cube.obj", physics::obj_text(physics::cube_mesh(0.04))),
                      .position_m = {0, 0, -0.02}},
         over_edge});
    result.push_back({std::string("groove") + deep,
                      groove,
                      {{-0.02, 0, 0.01},
                       {-0.02, 0, z},
                       {0.0, 0, z - 0.004},
                       {0.02, 0.001, z},
                       {-0.02, 0.002, z - 0.001},
                       {0.001, 0.01, -0.01 - deep_m},
                       {0.02, 0, 0.01}}});
    result.push_back({std::string("ball mesh") + deep,
                      FileGeometry{.kind = FileGeometry::Kind::kTriangleSurface,
                                   .file = folder.write(
                                       "ball.obj", physics::obj_text(physics::ball_mesh(0.02, 4)))},
                      {{0, 0, 0.03},
                       {0, 0.001, 0.02 - deep_m},
                       {0.015, 0.01, 0.012 - deep_m},
                       {0, -0.012, 0.014 - deep_m},
                       {-0.02, 0.0, 0.03}}});
  }
  return result;
}

}  // namespace palpate::test
