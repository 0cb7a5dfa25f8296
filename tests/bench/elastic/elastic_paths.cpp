// SPDX-License-Identifier: Apache-2.0
// elastic_paths: the force of a session's elastic tissue along prescribed paths of the tip, without
// network or device, against full solutions of the same mesh every 0.5 ms. Open loop, on a virtual
// clock: the same on every machine. Presses, slides and circles, thin plates, rims, fixed places,
// viscosity, a tip that appears inside. With a network, what mofc_node makes of them at its other
// end.
#include <spdlog/fmt/fmt.h>

#include <time.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/session/session_file.h"
#include "common/telemetry/physics_telemetry.h"
#include "common/telemetry/quantile.h"
#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/bench/bench_output.h"
#include "tests/bench/elastic/delayed_force.h"
#include "tests/bench/elastic/elastic_rows.h"
#include "tests/support/elastic/tetrahedra_of.h"
#include "tests/support/machine/places.h"

namespace {

using namespace palpate;
using namespace palpate::physics;
using bench::BenchOptions;
using bench::Table;

constexpr double kTick_s = 1e-3;
constexpr double kReach_m = 0.05;
constexpr double kReferenceStep_s = 0.5e-3;
// The tip starts so far above the surface, and waits there until there is a first solution.
constexpr double kAbove_m = 0.004;
constexpr double kFarAbove_m = 0.04;
constexpr int kLeadTicks = 60;
constexpr double kHold_s = 0.15;
// A force below this part of the ideal one, where that is above the limit, is lost.
constexpr double kLostRatio = 0.1;
constexpr double kFelt_newton = 0.1;

/// The depth of a tip after this time: down at a speed, a hold, up again.
double press_m(double time_s, double depth_m, double speed_m_per_s) {
  const double way_s = (depth_m + kAbove_m) / speed_m_per_s;
  if (time_s < way_s) return speed_m_per_s * time_s - kAbove_m;
  return depth_m - speed_m_per_s * std::max(0.0, time_s - way_s - kHold_s);
}

struct Path {
  std::string name;
  SceneConfig scene;
  double seconds = 0.0;
  int lead_ticks = 0;
  std::function<Vector3(double time_s)> tip_m;
};

/// Where the sphere touches the untouched body, coming from `from_m` along the unit `way`.
Vector3 first_touch_m(const ElasticBody& body, double radius_m, const Vector3& from_m,
                      const Vector3& way) {
  SurfaceHint hint;
  Vector3 place_m = from_m;
  for (int i = 0; i < 200; ++i) {
    const double free_m = body.shape.view(place_m, hint).distance_m - radius_m;
    if (free_m < 1e-7) break;
    place_m += free_m * way;
  }
  return place_m;
}

class Paths {
 public:
  /// @param only  the paths whose name contains this text
  Paths(const std::filesystem::path& folder, const std::string& only)
      : folder_(folder), only_(only) {}

  [[nodiscard]] std::vector<Path> all() {
    const std::string sessions = test::source_dir() + "/deploy/sessions/";
    const std::string block = sessions + "block_with_tumour.txtpb";
    const std::string liver = sessions + "liver_elastic.txtpb";
    const Vector3 on_block(0.003, 0.002, 0.05);
    const Vector3 on_liver(0.012, 0.004, 0.08);
    const Vector3 down(0, 0, -1);
    for (const double mm_per_s : {20.0, 100.0, 250.0, 400.0}) {
      for (const double mm : {2.0, 6.0, 10.0, 15.0}) {
        const std::string name = fmt::format("press {:.0f} mm at {:.0f} mm/s", mm, mm_per_s);
        press("block, " + name, scene_of(block), on_block, down, 1e-3 * mm, 1e-3 * mm_per_s);
        if (mm != 2.0) {
          press("liver, " + name, scene_of(liver), on_liver, down, 1e-3 * mm, 1e-3 * mm_per_s);
        }
      }
    }
    for (const double mm_per_s : {100.0, 250.0, 400.0}) {
      dip(fmt::format("block, 8 mm in and out at {:.0f} mm/s", mm_per_s), scene_of(block),
          {0, 0, 0.05}, down, 8e-3, 1e-3 * mm_per_s);
    }
    for (const double mm_per_s : {50.0, 150.0, 300.0}) {
      for (const double friction : {0.0, 0.4}) {
        const std::string text = fmt::format(" at {:.0f} mm/s, mu {:.1f}", mm_per_s, friction);
        slide("block, slide" + text, with_friction(scene_of(block), friction), {0, 0.004, 0}, 0.02,
              5e-3, 1e-3 * mm_per_s, false);
        slide("block, circle" + text, with_friction(scene_of(block), friction), {0, 0, 0}, 0.01,
              5e-3, 1e-3 * mm_per_s, true);
        slide("liver, slide" + text, with_friction(scene_of(liver), friction), {0.012, 0.004, 0},
              0.015, 4e-3, 1e-3 * mm_per_s, false);
      }
    }
    for (const double thick_mm : {4.0, 8.0}) {
      const SceneConfig plate = plate_scene(1e-3 * thick_mm, true);
      for (const double side : {1.0, -1.0}) {
        press(fmt::format("plate of {:.0f} mm, from {}, 8 mm at 100 mm/s", thick_mm,
                          side > 0 ? "above" : "below"),
              plate, {0.001, 0.002, 0.05 * side}, {0, 0, -side}, 8e-3, 0.1);
      }
      press(fmt::format("plate of {:.0f} mm, its free rim, 6 mm at 100 mm/s", thick_mm), plate,
            {0.001, 0.06, 0.001}, {0, -1, 0}, 6e-3, 0.1);
      press(fmt::format("flap of {:.0f} mm, 8 mm at 100 mm/s", thick_mm),
            plate_scene(1e-3 * thick_mm, false), {0.012, 0.002, 0.05}, down, 8e-3, 0.1);
    }
    press("liver, its rim, 6 mm at 100 mm/s", scene_of(liver), {0.12, 0.004, 0.002}, {-1, 0, 0},
          6e-3, 0.1);
    press("liver, its flank near the support, 4 mm at 50 mm/s", scene_of(liver),
          {0.012, 0.12, -0.010}, {0, -1, 0}, 4e-3, 0.05);
    press("block, its fixed rim, 4 mm at 50 mm/s", scene_of(block), {0.1, 0.003, -0.046},
          {-1, 0, 0}, 4e-3, 0.05);
    press("block, its upper rim, 6 mm at 100 mm/s", scene_of(block), {0.0485, 0.003, 0.05}, down,
          6e-3, 0.1);
    for (const int ms : {0, 5, 20, 100}) {
      SceneConfig scene = scene_of(block);
      std::get<ElasticMaterial>(scene.tissues[0].material).viscosity_s = 1e-3 * ms;
      press(fmt::format("block, viscosity {} ms, 6 mm at 100 mm/s", ms), scene, on_block, down,
            6e-3, 0.1);
    }
    taps("block, two taps of 4 mm at 150 mm/s", scene_of(block), on_block, down, 4e-3, 0.15);
    press("block, 10 mm at 1 m/s", scene_of(block), on_block, down, 10e-3, 1.0);
    appear("block, tip appears 4 mm deep", scene_of(block), on_block, down, 4e-3);
    return std::move(paths_);
  }

 private:
  static SceneConfig scene_of(const std::string& file) { return load_session(file).scene; }
  static SceneConfig with_friction(SceneConfig scene, double friction_coefficient) {
    std::get<ElasticMaterial>(scene.tissues[0].material).friction_coefficient =
        friction_coefficient;
    return scene;
  }

  /// 60 × 60 mm in the middle of z = 0, held at two edges or at one.
  SceneConfig plate_scene(double thickness_m, bool is_held_at_both) {
    const std::vector<double> along = elastic::equal_planes(-0.03, 0.03, 8);
    const elastic::Mesh plate = elastic::box_mesh(
        along, along, elastic::equal_planes(-0.5 * thickness_m, 0.5 * thickness_m, 2));
    const std::string file =
        (folder_ / fmt::format("plate_{:.0f}_mm.msh", 1e3 * thickness_m)).string();
    std::ofstream(file) << msh_text(test::tetrahedra_of(plate));
    ElasticMaterial material{.young_pa = 15e3, .viscosity_s = 0.005};
    material.fixed = {HalfSpaceGeometry{.point_m = {-0.0299, 0, 0}, .normal = {1, 0, 0}}};
    if (is_held_at_both) {
      material.fixed.emplace_back(
          HalfSpaceGeometry{.point_m = {0.0299, 0, 0}, .normal = {-1, 0, 0}});
    }
    return {.tip_radius_m = 0.006,
            .tissues = {{.name = "plate",
                         .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh,
                                                  .file = file},
                         .material = material}}};
  }

  void press(const std::string& name, const SceneConfig& scene, const Vector3& from_m,
             const Vector3& way, double depth_m, double speed_m_per_s) {
    if (!is_wanted(name)) return;
    const Vector3 touch_m =
        first_touch_m(*elastic_bodies_of(scene).front(), scene.tip_radius_m, from_m, way);
    const double seconds = 2.0 * (depth_m + kAbove_m) / speed_m_per_s + kHold_s;
    paths_.push_back({name, scene, seconds, kLeadTicks, [=](double time_s) {
                        return Vector3(touch_m + press_m(time_s, depth_m, speed_m_per_s) * way);
                      }});
  }

  /// Down from kFarAbove_m and up again, without a hold.
  void dip(const std::string& name, const SceneConfig& scene, const Vector3& from_m,
           const Vector3& way, double depth_m, double speed_m_per_s) {
    if (!is_wanted(name)) return;
    const Vector3 touch_m =
        first_touch_m(*elastic_bodies_of(scene).front(), scene.tip_radius_m, from_m, way);
    const double down_s = (kFarAbove_m + depth_m) / speed_m_per_s;
    paths_.push_back({name, scene, down_s + (depth_m + kAbove_m) / speed_m_per_s, kLeadTicks,
                      [=](double time_s) {
                        const double down_m = depth_m - speed_m_per_s * std::abs(down_s - time_s);
                        return Vector3(touch_m + down_m * way);
                      }});
  }

  /// Down and up twice, to kAbove_m above the surface.
  void taps(const std::string& name, const SceneConfig& scene, const Vector3& from_m,
            const Vector3& way, double depth_m, double speed_m_per_s) {
    if (!is_wanted(name)) return;
    const Vector3 touch_m =
        first_touch_m(*elastic_bodies_of(scene).front(), scene.tip_radius_m, from_m, way);
    const double way_m = depth_m + kAbove_m;
    const double tap_s = 2.0 * way_m / speed_m_per_s;
    paths_.push_back({name, scene, 2.0 * tap_s + 0.05, kLeadTicks, [=](double time_s) {
                        const double in_s = time_s < 2.0 * tap_s ? std::fmod(time_s, tap_s) : 0.0;
                        const double down_m = speed_m_per_s * std::min(in_s, tap_s - in_s);
                        return Vector3(touch_m + (down_m - kAbove_m) * way);
                      }});
  }

  /// To and fro along x, or in a circle, at this depth below the untouched surface.
  void slide(const std::string& name, const SceneConfig& scene, const Vector3& middle_m,
             double half_m, double depth_m, double speed_m_per_s, bool is_circle) {
    if (!is_wanted(name)) return;
    const std::shared_ptr<const ElasticBody> body = elastic_bodies_of(scene).front();
    constexpr double kDown_s = 0.15;
    const double turn_s = 2.0 * std::numbers::pi * half_m / speed_m_per_s;  // top speed
    const double radius_m = scene.tip_radius_m;
    paths_.push_back({name, scene, kDown_s + 0.05 + turn_s + 0.05, kLeadTicks, [=](double time_s) {
                        const double phase =
                            2.0 * std::numbers::pi *
                            std::clamp((time_s - kDown_s - 0.05) / turn_s, 0.0, 1.0);
                        Vector3 place_m = middle_m;
                        place_m.x() += half_m * std::cos(phase);
                        if (is_circle) place_m.y() += half_m * std::sin(phase);
                        place_m.z() = 0.08;
                        Vector3 tip_m = first_touch_m(*body, radius_m, place_m, {0, 0, -1});
                        const double share = std::min(1.0, time_s / kDown_s);
                        tip_m.z() -= share * depth_m - (1.0 - share) * kAbove_m;
                        return tip_m;
                      }});
  }

  void appear(const std::string& name, const SceneConfig& scene, const Vector3& from_m,
              const Vector3& way, double depth_m) {
    if (!is_wanted(name)) return;
    const Vector3 touch_m =
        first_touch_m(*elastic_bodies_of(scene).front(), scene.tip_radius_m, from_m, way);
    paths_.push_back(
        {name, scene, 0.3, 0, [=](double /*time_s*/) { return Vector3(touch_m + depth_m * way); }});
  }

  [[nodiscard]] bool is_wanted(const std::string& name) const {
    return name.find(only_) != std::string::npos;
  }

  std::filesystem::path folder_;
  std::string only_;
  std::vector<Path> paths_;
};

/// The force on the tool at every tick [N].
using Forces = std::vector<Vector3>;

Forces reference_of(const Path& path) {
  ElasticReference reference(elastic_bodies_of(path.scene), path.scene.tip_radius_m,
                             kReferenceStep_s);
  Forces forces;
  const auto parts = static_cast<int>(std::lround(kTick_s / kReferenceStep_s));
  for (int tick = 0; kTick_s * tick < path.seconds; ++tick) {
    SceneForce force;
    // the last part ends at the tick
    for (int part = tick == 0 ? parts : 1; part <= parts; ++part) {
      const double time_s = kTick_s * tick - kReferenceStep_s * (parts - part);
      force = {};
      reference.advance(time_s, path.tip_m(time_s), force);
    }
    forces.push_back(force.force_on_tool_newton);
  }
  return forces;
}

Forces kept_reference_of(const Path& path, const std::filesystem::path& folder) {
  if (folder.empty()) return reference_of(path);
  std::string name = path.name;
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  const std::filesystem::path file = folder / (name + ".csv");
  Forces forces;
  if (std::ifstream in(file); in) {
    Vector3 force;
    while (in >> force.x() >> force.y() >> force.z()) forces.push_back(force);
    return forces;
  }
  forces = reference_of(path);
  std::ofstream out(file);
  out.precision(9);
  for (const Vector3& force : forces) out << force.transpose() << '\n';
  return forces;
}

struct Figures {
  double peak_newton = 0.0;  // of the ideal
  double gain = 0.0;
  double rms = 0.0;
  double worst_newton = 0.0;  // mean error over 20 ms
  double overshoot = 0.0;     // in the first 100 ms
  int lost_ticks = 0;
  double most_over_newton = 0.0;
  double jump_newton = 0.0;
  double failed = 0.0;
  double step_us = 0.0;   // median; most steps make no full solution
  double solve_ms = 0.0;  // mean
  double p99_us = 0.0;
  double kilobytes_per_s = 0.0;
};

Figures compare(const Forces& force, const Forces& ideal) {
  Figures figures;
  double along = 0.0;
  double ideal2 = 0.0;
  double error2 = 0.0;
  std::size_t begin = ideal.size();
  Vector3 window = Vector3::Zero();
  double first = 0.0;
  double first_ideal = 0.0;
  for (std::size_t i = 0; i < ideal.size(); ++i) {
    const Vector3 error = force[i] - ideal[i];
    const double newton = ideal[i].norm();
    along += force[i].dot(ideal[i]);
    ideal2 += newton * newton;
    error2 += error.squaredNorm();
    figures.peak_newton = std::max(figures.peak_newton, newton);
    figures.most_over_newton = std::max(figures.most_over_newton, force[i].norm() - newton);
    if (newton > kFelt_newton && force[i].dot(ideal[i]) < kLostRatio * newton * newton) {
      ++figures.lost_ticks;
    }
    if (i > 0)
      figures.jump_newton = std::max(figures.jump_newton, (force[i] - force[i - 1]).norm());
    window += error;
    if (i >= 20) window -= force[i - 20] - ideal[i - 20];
    figures.worst_newton = std::max(figures.worst_newton, window.norm() / 20.0);
    if (newton > 0.0 && begin == ideal.size()) begin = i;
    if (i < begin + 100) {
      first = std::max(first, force[i].norm());
      first_ideal = std::max(first_ideal, newton);
    }
  }
  figures.gain = along / ideal2;
  figures.rms = std::sqrt(error2 / ideal2);
  figures.overshoot = first / first_ideal;
  return figures;
}

void trace(const Path& path, const Forces& forces, const Forces& ideal,
           const std::vector<double>& us, const std::string& file) {
  if (file.empty()) return;
  std::ofstream out(file);
  for (std::size_t i = 0; i < forces.size(); ++i) {
    const Vector3 tip_m = path.tip_m(kTick_s * static_cast<double>(i));
    out << i << ' ' << tip_m.transpose() << "  " << forces[i].transpose() << "  "
        << ideal[i].transpose() << ' ' << us[i] << '\n';
  }
}

double quantile_of(std::vector<double> values, double share) { return quantile(values, share); }

/// At the other end of hop 3.
Figures run_delayed(const Path& path, const Forces& ideal, const bench::Network& network,
                    const std::string& trace_file) {
  const int lead_ticks =
      path.lead_ticks == 0 ? 0 : path.lead_ticks + static_cast<int>(2e3 * network.delay_s) + 200;
  const bench::DelayedForces found =
      bench::delayed_forces(path.scene, path.tip_m, path.seconds, lead_ticks, network);
  trace(path, found.newton, ideal, found.us, trace_file);
  Figures figures = compare(found.newton, ideal);
  figures.step_us = quantile_of(found.us, 0.5);
  figures.p99_us = quantile_of(found.us, 0.99);
  figures.kilobytes_per_s = 1e-3 * found.bytes_per_s;
  return figures;
}

Figures run(const Path& path, const Forces& ideal, const std::filesystem::path& columns_folder,
            const std::string& trace_file) {
  const auto tissues = ElasticTissues::of(path.scene, 1, ElasticPace::kVirtual, columns_folder);
  Forces forces;
  std::vector<double> us;
  for (int tick = -path.lead_ticks; kTick_s * tick < path.seconds; ++tick) {
    const Vector3 tip_m = path.tip_m(std::max(0.0, kTick_s * tick));
    SceneForce force;
    const double begin_s = bench::cpu_s();
    tissues->step(0, tip_m, kTick_s * (tick + path.lead_ticks), kReach_m, force);
    if (tick < 0) continue;
    us.push_back(1e6 * (bench::cpu_s() - begin_s));
    forces.push_back(force.force_on_tool_newton);
  }
  trace(path, forces, ideal, us, trace_file);
  Figures figures = compare(forces, ideal);
  PhysicsCounters counters;
  tissues->count_into(counters);
  figures.failed = static_cast<double>(counters.elastic_solves_failed);
  figures.p99_us = quantile_of(us, 0.99);
  double sum_us = 0.0;
  for (const double one : us) sum_us += one;
  figures.step_us = quantile_of(us, 0.5);
  figures.solve_ms = 1e-3 * sum_us / std::max(1.0, static_cast<double>(counters.elastic_solves));
  return figures;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "The force of elastic tissue along prescribed paths of the tip, against full solutions every "
      "0.5 ms. Open loop, virtual time.",
      "elastic_paths"};
  BenchOptions options;
  std::string only;
  std::string kept;
  std::string trace_file;
  bench::Network network;
  double delay_ms = 0.0;
  double stall_ms = 0.0;
  app.add_option("--only", only, "Only the paths whose name contains this text");
  app.add_option("--keep", kept,
                 "Folder in which the references are kept for the next run: only while neither "
                 "paths nor full solutions change");
  app.add_option("--trace", trace_file,
                 "File for the last path: tick, tip [m], force [N], reference [N], time [us]");
  const CLI::Option* const delay =
      app.add_option(
             "--delay-ms", delay_ms,
             "Through hop 3, with so much delay each way [ms]: the force is that of mofc_node")
          ->check(CLI::Range(0.0, 1e3));
  app.add_option("--loss", network.loss_ratio, "Share of the messages lost each way")
      ->needs("--delay-ms")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--physics-hz", network.physics_hz, "Steps of physics per second")
      ->needs("--delay-ms")
      ->check(CLI::Range(1.0, 1e3));
  app.add_option("--stall-ms", stall_ms, "Physics stands still so long, every half second [ms]")
      ->needs("--delay-ms")
      ->check(CLI::Range(0.0, 500.0));
  app.add_flag("!--no-rate", network.has_rate,
               "As for a mofc_node that takes the viscous part of a force for elastic")
      ->needs("--delay-ms");
  return bench::run_bench(app, options, argc, argv, [&] {
    network.delay_s = 1e-3 * delay_ms;
    network.stall_s = 1e-3 * stall_ms;
    const std::filesystem::path folder =
        std::filesystem::temp_directory_path() / fmt::format("elastic_paths_{}", ::getpid());
    std::filesystem::create_directories(folder);
    Table table({{"path", "path", "{}"},
                 {"peak_newton", "peak N", "{:.2f}"},
                 {"gain", "gain", "{:.3f}"},
                 {"rms_ratio", "rms", "{:.3f}"},
                 {"worst_20_ms_newton", "20 ms N", "{:.2f}"},
                 {"overshoot", "first 100 ms", "{:.2f}"},
                 {"lost_ticks", "lost ms", "{:.0f}"},
                 {"most_over_newton", "over N", "{:.2f}"},
                 {"jump_newton", "jump N", "{:.2f}"},
                 {"failed", "failed", "{:.0f}"},
                 {"step_us", "step us", "{:.0f}"},
                 {"solve_ms", "solve ms", "{:.1f}"},
                 {"p99_us", "p99 us", "{:.0f}"},
                 {"kilobytes_per_s", "kB/s", "{:.0f}"}});
    for (const Path& path : Paths(folder, only).all()) {
      const Forces ideal = kept_reference_of(path, kept);
      const Figures at = delay->count() > 0 ? run_delayed(path, ideal, network, trace_file)
                                            : run(path, ideal, folder, trace_file);
      table.add({path.name, at.peak_newton, at.gain, at.rms, at.worst_newton, at.overshoot,
                 static_cast<double>(at.lost_ticks), at.most_over_newton, at.jump_newton, at.failed,
                 at.step_us, at.solve_ms, at.p99_us, at.kilobytes_per_s});
    }
    std::filesystem::remove_all(folder);
    table.publish(options);
  });
}
