// SPDX-License-Identifier: Apache-2.0
// grasp_bench: the force of tissue in the jaws of a gripper, around a needle or a blade, along
// prescribed paths, at the other end of a network, against full solutions with the same constraints
// every millisecond. Open loop, on a virtual clock: the forces are the same on every machine.
#include <spdlog/fmt/fmt.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <functional>
#include <memory>
#include <numbers>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "common/session/session_file.h"
#include "common/telemetry/quantile.h"
#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/bench/bench_output.h"
#include "tests/bench/elastic/delayed_force.h"
#include "tests/bench/elastic/elastic_rows.h"
#include "tests/support/elastic/tetrahedra_of.h"
#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"

namespace {

using namespace palpate;
using bench::BenchOptions;
using bench::Table;
using State = mofc::HeldTissue::State;

constexpr double kTick_s = 1e-3;
constexpr double kClose_s = 0.2;  // the tip rests on the tissue
constexpr double kPull_s = 0.6;
constexpr double kOpen_s = 2.4;
constexpr double kSeconds = 2.6;
constexpr double kLeastTurn = 0.05;  // of the peak: a smaller change of the force is no reversal

struct Path {
  std::string name;
  SceneConfig scene;
  std::function<Vector3(double)> tip_m;
  double seconds = kSeconds;
};

/// Half a period of a cosine from 0 to 1.
double eased(double share) {
  return 0.5 * (1.0 - std::cos(std::numbers::pi * std::clamp(share, 0.0, 1.0)));
}

/// From the surface by `way_m` and back, each way in 0.8 s.
std::function<Vector3(double)> to_and_fro(const Vector3& from_m, const Vector3& way_m) {
  return [=](double time_s) {
    const double there = eased((time_s - kPull_s) / 0.8) - eased((time_s - kPull_s - 1.0) / 0.8);
    return Vector3(from_m + there * way_m);
  };
}

struct Forces {
  std::vector<Vector3> newton;
  double peak = 0.0;
};

Forces reference_of(const Path& path, double step_s) {
  physics::ElasticReference reference(physics::elastic_bodies_of(path.scene),
                                      path.scene.tip_radius_m, step_s, path.scene.holder());
  Forces forces;
  for (int tick = -200; kTick_s * tick < path.seconds; ++tick) {
    const double time_s = kTick_s * tick;
    physics::SceneForce force;
    reference.advance(1.0 + time_s, path.tip_m(std::max(0.0, time_s)), force,
                      time_s >= kClose_s && time_s < kOpen_s);
    if (tick < 0) continue;
    forces.newton.push_back(force.force_on_tool_newton);
    forces.peak = std::max(forces.peak, force.force_on_tool_newton.norm());
  }
  return forces;
}

/// Changes of the direction in which the force along an axis goes, by more than this.
int reversals_of(const std::vector<Vector3>& newton, double least_newton) {
  int reversals = 0;
  for (int axis = 0; axis < 3; ++axis) {
    double turn = newton.front()[axis];  // the last extreme
    int way = 0;
    for (const Vector3& now : newton) {
      const double change = now[axis] - turn;
      if (way * change > 0.0) {
        turn = now[axis];
      } else if (std::abs(change) > least_newton) {
        reversals += way != 0 ? 1 : 0;
        way = change > 0.0 ? 1 : -1;
        turn = now[axis];
      }
    }
  }
  return reversals;
}

double p99_of(std::vector<double> values) { return quantile(values, 0.99); }

/// Processor time of a step of the tool while the body is solved on a thread of its own; NaN for a
/// needle.
double step_p99_us(const Path& path) {
  if (!path.scene.gripper) return kNaN;
  constexpr int kSteps = 5000;
  const auto tissues = physics::ElasticTissues::of(path.scene, 1, physics::ElasticPace::kThread);
  std::vector<double> us;
  for (int tick = 0; us.size() < kSteps; ++tick) {
    physics::SceneForce force;
    const double begin_s = bench::cpu_s();
    tissues->step(0, path.tip_m(0.0), kTick_s * tick, 0.05, force, {.is_closed = tick > 10});
    if (force.listed_count > 0 && force.contacts[0].grip.number != 0) {
      us.push_back(1e6 * (bench::cpu_s() - begin_s));
    }
    std::this_thread::yield();
  }
  return p99_of(std::move(us));
}

/// When the jaws have lost the tissue [s]; < 0: never.
double lost_at_s(const std::vector<State>& grip) {
  const auto lost = std::find_if(grip.begin(), grip.end(), [](State state) {
    return state == State::kTorn || state == State::kSlipped;
  });
  return lost == grip.end() ? -1.0 : kTick_s * static_cast<double>(lost - grip.begin());
}

/// In and out of the block of the session `biopsy` by 25 mm, and again by the same hole.
Path needle_path() {
  constexpr double kSpan_s = 2.5;
  constexpr double kRest_s = 0.3;
  constexpr double kWay_m = 0.029;
  Path path{.name = "needle, 25 mm and again",
            .scene = load_session(test::source_dir() + "/deploy/sessions/tools/biopsy.txtpb").scene,
            .tip_m = {},
            .seconds = 4.0 * (kSpan_s + kRest_s)};
  path.tip_m = [](double time_s) {
    const double part_s = std::fmod(time_s, 2.0 * (kSpan_s + kRest_s));
    const double in = eased(part_s / kSpan_s) - eased((part_s - kSpan_s - kRest_s) / kSpan_s);
    return Vector3(0.003, 0.002, 0.004 - in * kWay_m);
  };
  return path;
}

/// The scene of the session `incision`, its block so many times as fine.
SceneConfig incision(double times, const TempFolder& folder) {
  SceneConfig scene =
      load_session(test::source_dir() + "/deploy/sessions/tools/incision.txtpb").scene;
  if (times == 1.0) return scene;
  const auto cells = [&](int coarse) { return static_cast<int>(std::lround(coarse * times)); };
  const elastic::Mesh box = elastic::box_mesh(elastic::equal_planes(-0.03, 0.03, cells(14)),
                                              elastic::equal_planes(-0.015, 0.015, cells(7)),
                                              elastic::equal_planes(-0.02, 0.0, cells(5)));
  std::get<FileGeometry>(scene.tissues.front().geometry).file =
      folder.write("block.msh", physics::msh_text(test::tetrahedra_of(box)));
  return scene;
}

/// 40 mm into the block of the session `incision` at 20 mm/s, a rest, and back by 15 mm.
Path blade_path(double times, const TempFolder& folder) {
  constexpr double kSpeed_m_per_s = 0.02;
  constexpr double kFrom_m = -0.034;
  constexpr double kWay_m = 0.048;  // the surface is 2 mm away, and gives way
  constexpr double kRest_s = 0.3;
  constexpr double kBack_m = 0.015;
  Path path{.name = "blade, 40 mm",
            .scene = incision(times, folder),
            .tip_m = {},
            .seconds = (kWay_m + kBack_m) / kSpeed_m_per_s + kRest_s};
  path.tip_m = [=](double time_s) {
    const double in_m = std::min(kWay_m, kSpeed_m_per_s * time_s);
    const double back_m = std::max(0.0, kSpeed_m_per_s * (time_s - kRest_s) - kWay_m);
    return Vector3(kFrom_m + in_m - back_m, 0.001, -0.008);
  };
  return path;
}

/// What a change of topology takes, beside a body that is made for the first time.
void report_changes(const SceneConfig& scene) {
  constexpr int kChanges = 4;
  const double begin_s = bench::cpu_s();
  const auto body = physics::elastic_bodies_of(scene).front();
  const auto shared = std::make_shared<physics::BodyCompliance>(body);
  const double made_s = bench::cpu_s() - begin_s;
  physics::Ablation ablation(shared, {}, scene.tip_radius_m, 1, false, true);
  physics::BladeSweep sweep;
  sweep.begin(1,
              {.from_m = {-0.03, 0.001, -0.008},
               .facing = Vector3::UnitX(),
               .along = Vector3::UnitZ(),
               .length_m = scene.blade->length_m},
              *body, ablation.opposite_sides(), 0.0);
  elastic::VectorXd x_m = body->start_m;
  double worst_s = 0.0;
  for (int i = 1; i <= kChanges; ++i) {
    const auto step = sweep.advance({0.01 * i, 0, 0}, *body, ablation.present(), *body->pierced);
    ablation.cut(0, step.sweep, scene.blade->reach_m);
    const double from_s = bench::cpu_s();
    static_cast<void>(ablation.advance(0.02, x_m));  // makes it
    worst_s = std::max(worst_s, bench::cpu_s() - from_s);
    for (int wait = 0; wait < 20; ++wait) {
      if (const auto made = ablation.advance(0.02, x_m)) x_m = made->body()->start_m;
    }
  }
  fmt::print(
      "{} tetrahedra: {:.0f} ms to load, at most {:.0f} ms processor time for a cut by 10 mm more, "
      "with the compliance beside the edge; {} faces, projected {:.0f} mm² of {:.0f} mm² swept\n",
      body->body->mesh().element_count(), 1e3 * made_s, 1e3 * worst_s, ablation.figures().faces_cut,
      1e6 * ablation.figures().separated_m2, 1e6 * ablation.figures().swept_m2);
}

std::vector<Path> paths_of(const SceneConfig& base, double tip_z_m, double times,
                           const TempFolder& folder) {
  const Vector3 from_m(0.003, 0.002, tip_z_m);
  const auto with = [&](double slip_newton, double tear_newton) {
    SceneConfig scene = base;
    scene.gripper->reach_m = 2.0 * base.tip_radius_m;
    scene.gripper->friction_coefficient = 0.5;
    scene.gripper->jaw_newton = 2.0 * slip_newton;
    scene.gripper->tear_newton = tear_newton;
    return scene;
  };
  return {{"hold, 5 mm", with(100, 100), to_and_fro(from_m, {0, 0, 0.005})},
          {"retract 30 mm", with(100, 100), to_and_fro(from_m, {0, 0, 0.030})},
          {"retract aside, 20 mm", with(100, 100), to_and_fro(from_m, {0.015, 0, 0.013})},
          {"slip", with(0.8, 100), to_and_fro(from_m, {0, 0, 0.020})},
          {"tear", with(100, 0.8), to_and_fro(from_m, {0, 0, 0.020})},
          needle_path(),
          blade_path(times, folder)};
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "The force of tissue in the jaws of a gripper, around a needle or a blade, at the other end "
      "of a network, against full "
      "solutions with the same constraints every 1 ms. Open loop, virtual time.",
      "grasp_bench"};
  BenchOptions options;
  std::string only;
  std::string mesh;
  app.add_option("--only", only, "Only the paths whose name contains this text");
  app.add_option("--mesh", mesh,
                 "Another mesh than that of the session `retract`, its top at z = 0, for instance "
                 "of `palpate make-organ --block FILE --cells N`");
  double times = 1.0;
  app.add_option("--times", times, "The blade in a block so many times as fine")
      ->check(CLI::Range(0.5, 4.0));
  double reference_ms = 1e3 * kTick_s;
  app.add_option("--reference-ms", reference_ms, "Between two full solutions of the reference")
      ->check(CLI::Range(0.1, 20.0));
  std::string trace_file;
  app.add_option("--trace", trace_file,
                 "File for the last path: tick, force [N], reference [N], state of the jaws");
  return bench::run_bench(app, options, argc, argv, [&] {
    const TempFolder folder;
    SceneConfig base = load_session(test::source_dir() + "/deploy/sessions/retract.txtpb").scene;
    if (!mesh.empty()) std::get<FileGeometry>(base.tissues.front().geometry).file = mesh;
    if (options.is_quick) std::get<ElasticMaterial>(base.tissues.front().material).is_linear = true;
    Table table({{"path", "path", ""},
                 {"delay_ms", "each way ms", "{:.0f}"},
                 {"loss_ratio", "loss", "{:.1f}"},
                 {"peak_newton", "peak N", "{:.2f}"},
                 {"error_ratio", "rms error/peak", "{:.4f}"},
                 {"excess_reversals", "excess reversals", "{:.0f}"},
                 {"lost_s", "lost at s", "{:.3f}"},
                 {"points", "points", "{:.0f}"},
                 {"physics_step_us", "physics step p99 us", "{:.2f}"},
                 {"mofc_step_us", "mofc step p99 us", "{:.2f}"}});
    for (const Path& path : paths_of(base, base.tip_radius_m - 2e-4, times, folder)) {
      if (path.name.find(only) == std::string::npos) continue;
      const Forces ideal = reference_of(path, 1e-3 * reference_ms);
      for (const bool is_far : {false, true}) {
        const bench::Network network{
            .delay_s = is_far ? 0.05 : 0.0,
            .loss_ratio = is_far ? 0.2 : 0.0,
            .is_closed = [](double t_s) { return t_s >= kClose_s && t_s < kOpen_s; }};
        const bench::DelayedForces found =
            bench::delayed_forces(path.scene, path.tip_m, path.seconds, 300, network);
        if (!trace_file.empty()) {
          std::ofstream out(trace_file);
          for (std::size_t i = 0; i < ideal.newton.size(); ++i) {
            out << i << ' ' << found.newton[i].transpose() << "  " << ideal.newton[i].transpose()
                << "  " << static_cast<int>(found.grip[i]) << '\n';
          }
        }
        double error2 = 0.0;
        for (std::size_t i = 0; i < ideal.newton.size(); ++i) {
          error2 += (found.newton[i] - ideal.newton[i]).squaredNorm();
        }
        table.add({path.name, 1e3 * network.delay_s, network.loss_ratio, ideal.peak,
                   std::sqrt(error2 / static_cast<double>(ideal.newton.size())) / ideal.peak,
                   static_cast<double>(reversals_of(found.newton, kLeastTurn * ideal.peak) -
                                       reversals_of(ideal.newton, kLeastTurn * ideal.peak)),
                   lost_at_s(found.grip), static_cast<double>(found.points_held), step_p99_us(path),
                   p99_of(found.us)});
      }
    }
    table.publish(options);
    if (std::string("blade").find(only) == std::string::npos || only.empty()) return;
    for (const double fine : options.is_quick ? std::vector{times} : std::vector{1.0, 1.6, 2.75}) {
      report_changes(incision(fine, folder));
    }
  });
}
