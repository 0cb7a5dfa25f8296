// SPDX-License-Identifier: Apache-2.0
// Whole steps of a scene, for contact_bench.
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "common/core/random.h"
#include "physics_node/display/scene_display.h"
#include "physics_node/files/ply.h"
#include "physics_node/scene/scene.h"
#include "tests/bench/contact_rows.h"
#include "tests/support/sampled_clouds.h"

namespace palpate::bench {
namespace {

using test::Sampling;

constexpr double kRadius_m = 0.05;

/// Steps of 1 ms along x_m(i).
template <class Place>
Times time_steps(const physics::Scene& scene, std::size_t steps, const Place& x_m,
                 const Vector3& shaft = Vector3::UnitZ()) {
  physics::TissueMemory memory = scene.new_memory();
  return time_each(steps, [&](std::size_t i) {
    const double time_s = 1e-3 * static_cast<double>(i);
    sink = scene.step(memory, x_m(i), Vector3::Zero(), time_s, shaft).stored_energy_joule;
  });
}

/// 80 mm/s to and fro at this height.
auto to_and_fro(double height_m) {
  return [height_m](std::size_t i) {
    return Vector3(2e-3 * std::sin(0.04 * static_cast<double>(i)), 0.0, height_m);
  };
}

template <class Message>
struct Nowhere final : Sender<Message> {
  SendResult send(const Message&) noexcept override { return SendResult::kSent; }
};

}  // namespace

void measure_steps(const BenchOptions& options, Table& table) {
  Random random(4);
  const std::string file =
      (std::filesystem::temp_directory_path() / "contact_bench_cloud.ply").string();
  bench::write_file(file, physics::ply_text(test::sampled(test::sphere_shape(kRadius_m), 2e-3, 0.0,
                                                          true, Sampling::kRandom, random)));
  const std::size_t steps = options.is_quick ? 20000 : 100000;
  const auto scene_of = [&](std::size_t tissues, const KelvinVoigtMaterial& material) {
    SceneConfig config;
    config.tip_radius_m = 3e-3;
    for (std::size_t i = 0; i < tissues; ++i) {
      // the first at the origin, the others on a grid of 0.2 m
      const auto x = static_cast<double>(i % 100);
      const auto y = static_cast<double>(i / 100);
      config.tissues.push_back(
          {.name = std::to_string(i),
           .geometry = FileGeometry{.file = file, .position_m = {0.2 * x, 0.2 * y, 0.0}},
           .material = material});
    }
    return physics::Scene(config);
  };
  const KelvinVoigtMaterial firm;
  const KelvinVoigtMaterial relaxing{.relaxing_stiffness_newton_per_m = 100.0,
                                     .relaxation_time_s = 0.2};

  const double touching_m = kRadius_m + 2e-3;
  for (const auto& [kind, material] : {std::pair{"", firm}, {", relaxing", relaxing}}) {
    for (std::size_t tissues = 1; tissues <= 10000; tissues *= 10) {
      const BenchClock::time_point start = BenchClock::now();
      const physics::Scene scene = scene_of(tissues, material);
      const double build_s = seconds_since(start);
      for (const bool is_touched : {true, false}) {
        Row{.group = "idle tissues",
            .name = is_touched ? "one touched" : "tool far away",
            .method = "clouds of one file: " + std::to_string(tissues) + kind,
            .times = time_steps(scene, steps, to_and_fro(is_touched ? touching_m : 1.0)),
            .build_s = is_touched ? build_s : kNaN}
            .add_to(table);
      }
    }
  }

  // the cost of the proxy, the shaft and a viewer
  const auto add = [&](const std::string& name, const std::string& method, const Times& times) {
    Row{.group = "whole step", .name = name, .method = method, .times = times}.add_to(table);
  };
  const std::vector<std::pair<std::string, Geometry>> geometries{
      {"half-space", HalfSpaceGeometry{.point_m = {0, 0, kRadius_m}}},
      {"sphere", SphereGeometry{.radius_m = kRadius_m}},
      {"box", BoxGeometry{.size_m = Vector3::Constant(2 * kRadius_m)}},
      {"capsule",
       CapsuleGeometry{.from_m = {-0.05, 0, 0}, .to_m = {0.05, 0, 0}, .radius_m = kRadius_m}},
      {"cloud of 7800", FileGeometry{.file = file}}};
  for (const auto& [name, geometry] : geometries) {
    SceneConfig config{
        .tip_radius_m = 3e-3,
        .tissues = {{.name = name, .geometry = geometry, .material = KelvinVoigtMaterial{}}}};
    {
      const physics::Scene scene(config);
      const auto place = to_and_fro(touching_m);
      add(name, "tip touches, forgotten each time", time_each(steps, [&](std::size_t i) {
            sink = scene.evaluate(place(i), Vector3::Zero()).stored_energy_joule;
          }));
      add(name, "tip touches, proxy", time_steps(scene, steps, place));
    }
    config.shaft_length_m = 0.1;
    config.shaft_radius_m = 2e-3;
    const physics::Scene scene(config);
    add(name, "shaft touches",
        time_steps(
            scene, steps,
            [&](std::size_t i) {
              return Vector3(to_and_fro(kRadius_m + 1e-3)(i) - Vector3(0.06, 0, 0));
            },
            Vector3::UnitX()));
    add(name, "shaft far away", time_steps(scene, steps, to_and_fro(1.0), Vector3::UnitX()));
  }

  Session session;
  session.scene.tissues = {
      {.name = "cloud", .geometry = FileGeometry{.file = file}, .material = KelvinVoigtMaterial{}}};
  Nowhere<SceneState> scene_out;
  Nowhere<MeshFrame> mesh_out;
  for (const bool is_watched : {false, true}) {
    physics::SceneDisplay display(session, 1, scene_out, mesh_out);
    const std::uint64_t viewers = is_watched ? 1 : 0;
    add("display of the cloud", is_watched ? "a viewer" : "no viewer: no mesh",
        time_each(options.is_quick ? 500 : 2000, [&](std::size_t i) {
          const PhysicsTick tick{.tool_position_world_m = to_and_fro(touching_m)(i)};
          display.publish({.scene_subscriptions = viewers,
                           .mesh_subscriptions = viewers,
                           .has_mesh_watcher = is_watched},
                          {&tick, 1}, TimePoint(std::chrono::milliseconds(100 * (i + 1))));
        }));
  }
  std::filesystem::remove(file);
}

}  // namespace palpate::bench
