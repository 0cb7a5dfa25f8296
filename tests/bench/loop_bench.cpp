// SPDX-License-Identifier: Apache-2.0
// loop_bench — run time against error of the loop itself: inner step, device rate, physics rate,
// velocity estimator and order of the contact model, one changed at a time.
#include <spdlog/fmt/fmt.h>
#include <CLI/CLI.hpp>

#include <cstdio>
#include <exception>
#include <functional>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/telemetry/summary.h"
#include "deploy/lockstep/loopback.h"
#include "tests/bench/bench_output.h"
#include "tests/bench/tissue_scenes.h"

namespace palpate::bench {
namespace {

/// Physics at 50 Hz, 20 ms away, everything else at its default, unless a variant overrides it.
const std::vector<std::string> kBase{"physics.rate_hz=50", "faults.tool_motion.delay_ms=20",
                                     "faults.interaction.delay_ms=20"};

/// Contact models only: no tissue is described.
void as_quadric(Interaction& interaction) { interaction.surface.store_id = 0; }

/// A contact model of lower order: terms that are left out are not extrapolated.
void as_plane(Interaction& interaction) {
  as_quadric(interaction);
  for (std::uint32_t i = 0; i < interaction.listed_count; ++i) {
    Contact& contact = interaction.contacts[i];
    contact.curvature_per_m.setZero();
    contact.stiffening_newton_per_m2 = 0.0;
    contact.stiffening_newton_per_m3 = 0.0;
  }
}

struct Variant {
  const char* series;
  std::string label;
  std::vector<std::string> overrides{};
  std::function<void(Interaction&)> tamper{};
};

std::vector<Variant> variants() {
  std::vector<Variant> all;
  for (const double us : {1.0, 5.0, 10.0, 20.0, 50.0}) {
    all.push_back({"inner step",
                   fmt::format("{:g} µs", us),
                   {fmt::format("device.simulated.inner_step_us={}", us)}});
  }
  for (const double hz : {250.0, 500.0, 1000.0, 2000.0, 4000.0}) {
    all.push_back(
        {"device rate", fmt::format("{:g} Hz", hz), {fmt::format("device.rate_hz={}", hz)}});
  }
  for (const double hz : {20.0, 50.0, 200.0, 1000.0}) {
    all.push_back(
        {"physics rate", fmt::format("{:g} Hz", hz), {fmt::format("physics.rate_hz={}", hz)}});
  }
  const auto estimator = [&](const char* label, const char* text) {
    all.push_back({"estimator", label, {fmt::format("mofc.velocity_estimator={{ {} }}", text)}});
  };
  estimator("difference", "difference {}");
  estimator("difference, 5 ms", "difference { time_constant_ms: 5 }");
  estimator("adaptive window", "adaptive_window {}");
  estimator("Kalman, order 2", "kalman_velocity {}");
  estimator("Kalman, order 3", "kalman_acceleration {}");
  all.push_back({"model order", "held force", {"mofc.interaction=held"}});
  all.push_back({"model order", "plane", {}, as_plane});
  all.push_back({"model order", "quadric", {}, as_quadric});
  all.push_back({"model order", "described", {}});
  return all;
}

Table make_table() {
  return Table({{"tissue", "tissue", ""},
                {"series", "changed", ""},
                {"value", "to", ""},
                {"force_error_percent", "error %", "{:.2f}"},
                {"ideal_run_force_error_percent", "err. run %", "{:.2f}"},
                {"path_rms_mm", "path mm", "{:.4f}"},
                {"clamped_percent", "clamped %", "{:.1f}"},
                {"us_per_tick", "µs/tick", "{:.2f}"},
                {"us_per_second", "µs/s simulated", "{:.0f}"}});
}

void draw(const std::filesystem::path& folder, const std::vector<TissueScene>& scenes) {
  std::string script = R"(set datafile separator ','
set datafile missing NaN
set terminal svg size 1100,420 dynamic background rgb 'white' font 'sans,12'
set output 'loop.svg'
set multiplot layout 1,3 title 'Run time against error: physics 50 Hz, 20 ms away, guard, one thing changed at a time'
set logscale xy
set grid
set xlabel 'ms of run time per simulated second'
set ylabel 'rms force error, %'
set key top right
)";
  for (const TissueScene& scene : scenes) {
    script += fmt::format("set title '{}'\nplot ", scene.name);
    int color = 1;
    for (const char* series :
         {"inner step", "device rate", "physics rate", "estimator", "model order"}) {
      script += fmt::format(
          "{}'loop.csv' using (strcol('tissue') eq '{}' && strcol('series') eq '{}' ? "
          "column('us_per_second')/1000 : NaN):'force_error_percent' with linespoints lw 1 pt 7 lc "
          "{} title '{}'",
          color > 1 ? ", " : "", scene.name, series, color, series);
      ++color;
    }
    script += "\n";
  }
  draw_figure(folder, "loop", script + "unset multiplot\n");
}

void run(const BenchOptions& options) {
  const int repeats = options.is_quick ? 1 : 5;
  std::vector<TissueScene> scenes;
  for (const TissueScene& scene : tissue_scenes()) {
    const std::string name = scene.name;
    if (name == "paper rigid" || name == "stiffening" || name == "sphere 50 mm") {
      scenes.push_back(scene);
    }
  }
  Table table = make_table();
  for (const TissueScene& scene : scenes) {
    const char* series = nullptr;
    for (const Variant& variant : variants()) {
      std::vector<std::string> overrides = kBase;
      overrides.insert(overrides.end(), variant.overrides.begin(), variant.overrides.end());
      const Session session = session_of(scene, overrides);
      LockstepOptions judged{.has_ideal = true, .tamper_with_interaction = variant.tamper};
      const RunReport report =
          run_loopback(session, {.seconds = scene.seconds, .lockstep = judged});
      // timed without the ideal; the shortest of the repeats, since other load only adds time
      double wall_s = kNaN;
      for (int i = 0; i < repeats; ++i) {
        const RunReport timed = run_loopback(
            session,
            {.seconds = scene.seconds, .lockstep = {.tamper_with_interaction = variant.tamper}});
        wall_s = std::fmin(wall_s, timed.wall_s);
      }
      const RunStatistics& s = report.statistics;
      if (series != nullptr && series != variant.series) table.add_gap();
      series = variant.series;
      table.add({std::string(scene.name), std::string(variant.series), variant.label,
                 100.0 * s.force_error_rms_ratio(), 100.0 * s.ideal_run_force_error_rms_ratio(),
                 1e3 * s.path_deviation_rms_m(), 100.0 * s.clamp_ratio(),
                 1e6 * wall_s / static_cast<double>(s.ticks()), 1e6 * wall_s / scene.seconds});
    }
    table.add_gap();
  }
  table.publish(options);
  std::printf(
      "\nBase: device 1 kHz, inner step 50 µs, physics 50 Hz and 20 ms away each way, Kalman "
      "filter "
      "of order 3,\nquadric, mode guard. Error: rms of the difference to the continuous tissue at "
      "the true position, of its rms;\nerr. run: to the ideal run. Time: all nodes and the "
      "simulated device, one thread, without the ideal.\n");
  if (options.plot_folder.empty()) return;
  const std::filesystem::path folder = options.plot_folder;
  std::filesystem::create_directories(folder);
  write_file(folder / "loop.csv", table.csv());
  draw(folder, scenes);
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app("Run time against error of the loop, in lockstep.");
  palpate::bench::BenchOptions options;
  return palpate::bench::run_bench(app, options, argc, argv, [&] { palpate::bench::run(options); });
}
