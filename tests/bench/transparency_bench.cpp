// SPDX-License-Identifier: Apache-2.0
// transparency_bench — how much of the tissue is rendered when physics is slow, far and lossy: a
// held force and the contact model, without and with the clamp, run time beside error.
#include <spdlog/fmt/fmt.h>
#include <CLI/CLI.hpp>

#include <cstdio>
#include <exception>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/telemetry/summary.h"
#include "deploy/lockstep/loopback.h"
#include "tests/bench/bench_output.h"
#include "tests/bench/black_box/black_box_rows.h"
#include "tests/bench/disturbed/disturbed.h"
#include "tests/bench/tissue_scenes.h"

namespace palpate::bench {
namespace {

struct Link {
  double physics_hz = 1000.0;
  double delay_ms = 0.0;  ///< one way, on hops 2 and 3 each
  double loss_ratio = 0.0;
  bool is_frozen = false;  ///< from 0.7 s on physics repeats itself
};

struct Way {
  const char* interaction;
  const char* controller;
  std::vector<std::string> overrides;
};
const Way kWays[] = {
    {"held", "none", {"mofc.interaction=held", "mofc.controller=none", "device.monitor=off"}},
    {"held", "paper", {"mofc.interaction=held", "mofc.mode=paper", "device.monitor=off"}},
    {"held", "guard", {"mofc.interaction=held", "mofc.mode=guard"}},
    {"local", "none", {"mofc.interaction=local", "mofc.controller=none", "device.monitor=off"}},
    {"local", "paper", {"mofc.interaction=local", "mofc.mode=paper", "device.monitor=off"}},
    {"local", "guard", {"mofc.interaction=local", "mofc.mode=guard"}},
};

Session session_of(const TissueScene& scene, const Link& link, const Way& way, int seed) {
  std::vector<std::string> overrides = way.overrides;
  overrides.push_back(fmt::format("physics.rate_hz={}", link.physics_hz));
  overrides.push_back(fmt::format("seed={}", seed));
  for (const char* hop : {"tool_motion", "interaction"}) {
    overrides.push_back(fmt::format("faults.{}.delay_ms={}", hop, link.delay_ms));
    overrides.push_back(fmt::format("faults.{}.loss_ratio={}", hop, link.loss_ratio));
  }
  if (link.is_frozen) {
    overrides.emplace_back("faults.interaction.freeze={from_s: 0.7 until_s: 1000}");
  }
  return session_of(scene, overrides);
}

/// Means over seeds; peak, reversals and energy are the worst of them.
struct Figures {
  int runs = 0;
  double transparency = 0.0;
  double gain = 0.0;
  double force_error = 0.0;
  double ideal_run_force_error = 0.0;
  double beyond_jnd = 0.0;
  double path_rms_m = 0.0;
  double path_peak_m = 0.0;
  double clamped = 0.0;
  double most_excess_reversals = 0.0;
  double least_energy_joule = 0.0;
  double us_per_tick = 0.0;

  void add(const RunReport& report) {
    const RunStatistics& s = report.statistics;
    transparency += s.ideal_transparency();
    gain += s.gain();
    force_error += s.force_error_rms_ratio();
    ideal_run_force_error += s.ideal_run_force_error_rms_ratio();
    beyond_jnd += s.beyond_jnd_ratio();
    path_rms_m += s.path_deviation_rms_m();
    path_peak_m = std::max(path_peak_m, s.path_deviation_peak_m());
    clamped += s.clamp_ratio();
    most_excess_reversals =
        std::max(most_excess_reversals, static_cast<double>(s.excess_reversals()));
    least_energy_joule = std::min(least_energy_joule, s.minimum_true_energy_joule());
    us_per_tick += 1e6 * report.wall_s / static_cast<double>(s.ticks());
    ++runs;
  }
  [[nodiscard]] double mean(double sum) const { return sum / runs; }
};

Table make_table() {
  return Table({{"tissue", "tissue", ""},
                {"physics_hz", "phys Hz", "{:g}"},
                {"delay_ms", "delay ms", "{:g}"},
                {"loss_percent", "loss %", "{:g}"},
                {"interaction", "force", ""},
                {"controller", "MOFC", ""},
                {"capped_transparency", "transp.", "{:.3f}"},
                {"gain", "gain", "{:.3f}"},
                {"force_error_percent", "error %", "{:.1f}"},
                {"ideal_run_force_error_percent", "err. run %", "{:.1f}"},
                {"beyond_jnd_percent", "> JND %", "{:.1f}"},
                {"path_rms_mm", "path mm", "{:.3f}"},
                {"path_peak_mm", "peak mm", "{:.2f}"},
                {"excess_reversals", "exc. rev.", "{:.0f}"},
                {"clamped_percent", "clamped %", "{:.1f}"},
                {"min_true_energy_uj", "min energy µJ", "{:.1f}"},
                {"us_per_tick", "µs/tick", "{:.1f}"}});
}

Figures run(const TissueScene& scene, const Link& link, const Way& way, int seeds) {
  Figures figures;
  // without loss every seed gives the same run
  const int runs = link.loss_ratio > 0.0 ? seeds : 1;
  for (int seed = 1; seed <= runs; ++seed) {
    figures.add(run_loopback(session_of(scene, link, way, seed), {.seconds = scene.seconds}));
  }
  return figures;
}

void add_row(Table& table, const TissueScene& scene, const Link& link, const Way& way,
             const Figures& f) {
  table.add({std::string(scene.name) + (link.is_frozen ? ", frozen" : ""), link.physics_hz,
             link.delay_ms, 100.0 * link.loss_ratio, std::string(way.interaction),
             std::string(way.controller), f.mean(f.transparency), f.mean(f.gain),
             100.0 * f.mean(f.force_error), 100.0 * f.mean(f.ideal_run_force_error),
             100.0 * f.mean(f.beyond_jnd), 1e3 * f.mean(f.path_rms_m), 1e3 * f.path_peak_m,
             f.most_excess_reversals, 100.0 * f.mean(f.clamped), 1e6 * f.least_energy_joule,
             f.mean(f.us_per_tick)});
}

void draw_against_delay(const std::filesystem::path& folder) {
  // curves of the 50 Hz, 20 % loss rows in mode guard
  draw_figure(folder, "transparency_delay", R"(set datafile separator ','
set datafile missing NaN
set terminal svg size 960,520 dynamic background rgb 'white' font 'sans,13'
set output 'transparency_delay.svg'
set title 'Transparency against one-way delay: physics 50 Hz, 20 % loss, mode guard'
set xlabel 'one-way delay, ms'
set ylabel 'capped transparency against the continuous tissue'
set yrange [0:1.02]
set grid
set key outside right
tissues = "'paper soft' 'paper rigid' '500 N/m' '2000 N/m' 'stiffening' 'sphere 50 mm' 'soft/stiff edge'"
plot for [i=1:7] 'transparency_delay.csv' using (strcol('tissue') eq word(tissues, i) && strcol('interaction') eq 'local' ? column('delay_ms') : NaN):'capped_transparency' with linespoints lw 2 pt 7 lc i title word(tissues, i).', local', \
     for [i=1:7] 'transparency_delay.csv' using (strcol('tissue') eq word(tissues, i) && strcol('interaction') eq 'held' ? column('delay_ms') : NaN):'capped_transparency' with linespoints lw 1 dt 2 pt 6 lc i title word(tissues, i).', held'
)");
}

/// Force against time, for a spring and for the paper's damper, at 50 Hz, 50 ms, 20 % loss.
void draw_traces(const std::filesystem::path& folder) {
  const Link link{.physics_hz = 50.0, .delay_ms = 50.0, .loss_ratio = 0.2};
  for (const TissueScene& scene : tissue_scenes()) {
    const std::string tissue = scene.name;
    if (tissue != "500 N/m" && tissue != "paper rigid") continue;
    const std::string name = tissue == "500 N/m" ? "trace_spring" : "trace_rigid";
    for (const Way& way : kWays) {
      if (std::string(way.controller) != "guard") continue;
      static_cast<void>(run_loopback(
          session_of(scene, link, way, 1),
          {.seconds = scene.seconds,
           .csv_file = (folder / fmt::format("{}_{}.csv", name, way.interaction)).string(),
           .may_overwrite = true}));
    }
    draw_figure(folder, name,
                fmt::format(R"(set datafile separator ','
set terminal svg size 900,420 dynamic background rgb 'white' font 'sans,13'
set output '{0}.svg'
set title '{1}: physics 50 Hz, 50 ms away, 20 % loss, mode guard'
set xlabel 'time, s'
set ylabel 'force on the hand along z, N'
set xrange [0.2:1.6]
set grid
set key outside right
plot '{0}_local.csv' using 't_s':'fi_z' with lines lw 4 lc rgb '#c8d6e5' title 'the tissue', \
     '{0}_held.csv' using 't_s':'fs_z' with steps lw 1 lc rgb '#c0392b' title 'held', \
     '{0}_local.csv' using 't_s':'fs_z' with steps lw 1 lc rgb '#1f618d' title 'local model'
)",
                            name, tissue));
  }
}

void run(const BenchOptions& options, const Shard& shard) {
  const int seeds = options.is_quick ? 1 : 5;
  const std::vector<double> rates_hz =
      options.is_quick ? std::vector<double>{50} : std::vector<double>{50, 200, 1000};
  const std::vector<double> delays_ms = options.is_quick
                                            ? std::vector<double>{0, 50, 100}
                                            : std::vector<double>{0, 5, 20, 50, 100, 200};
  Table table = make_table();
  Table against_delay = make_table();
  std::optional<Steps> steps(std::in_place, tissue_scenes().size() * rates_hz.size() *
                                                delays_ms.size() * 2 * std::size(kWays) / shard.of);
  std::size_t row = 0;
  for (const TissueScene& scene : tissue_scenes()) {
    const auto add = [&](const Link& link) {
      for (const Way& way : kWays) {
        if (!shard.has(row++)) continue;
        const Figures figures = run(scene, link, way, seeds);
        steps->next();
        add_row(table, scene, link, way, figures);
        if (link.physics_hz == 50.0 && link.loss_ratio > 0.0 && !link.is_frozen &&
            std::string(way.controller) == "guard") {
          add_row(against_delay, scene, link, way, figures);
        }
      }
    };
    for (const double rate_hz : rates_hz) {
      for (const double delay_ms : delays_ms) {
        for (const double loss_ratio : {0.0, 0.2}) add({rate_hz, delay_ms, loss_ratio, false});
      }
    }
    if (std::string(scene.name) == "moves, relaxes") add({50.0, 0.0, 0.0, true});
    table.add_gap();
  }
  steps.reset();
  table.publish(options);
  std::printf(
      "\nDelay and loss on hops 2 and 3 each. Transparency: projected, capped, of the force acting "
      "against the\ncontinuous tissue at the true position; error: rms of their difference, of its "
      "rms; err. run: against the\nideal run, which includes that the hand is elsewhere. Path: rms "
      "and peak distance to the ideal run.\nMean of %d seeds where there is loss; peak, reversals "
      "and energy are the worst of them. µs/tick: all nodes\nand the ideal, one thread.\n",
      seeds);
  if (!options.plot_folder.empty()) {
    const std::filesystem::path folder = options.plot_folder;
    std::filesystem::create_directories(folder);
    write_file(folder / "transparency_delay.csv", against_delay.csv());
    draw_against_delay(folder);
    draw_traces(folder);
  }
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app("Held force and contact model against rate, delay and loss, in lockstep.");
  palpate::bench::BenchOptions options;
  std::string disturbed;
  app.add_flag("--disturbed{surfaces}", disturbed,
               "instead: disturbed links and ticks, of real and rough surfaces (--disturbed) or of "
               "the shipped sessions (--disturbed=sessions)")
      ->check(CLI::IsMember({"surfaces", "sessions"}));
  std::vector<std::string> meshes;
  app.add_option("--mesh", meshes, "a tetrahedral mesh among those surfaces; repeatable")
      ->type_name("FILE")
      ->needs("--disturbed");
  palpate::bench::DisturbedRows rows;
  app.add_option("--only", rows.only, "of these, scenes whose name contains TEXT")
      ->type_name("TEXT")
      ->needs("--disturbed");
  app.add_flag("--excerpt", rows.is_excerpt, "of these, the rows of the documents")
      ->needs("--disturbed");
  bool is_black_box = false;
  app.add_flag("--black-box", is_black_box,
               "instead: physics of which only the force is known, 100 Hz, 20 ms each way")
      ->excludes("--disturbed");
  palpate::bench::Shard shard;
  palpate::bench::add_shard_option(app, shard);
  app.get_option("--shard")->excludes("--disturbed")->excludes("--black-box");
  return palpate::bench::run_bench(app, options, argc, argv, [&] {
    if (is_black_box) {
      palpate::bench::run_black_box(options);
    } else if (disturbed == "sessions") {
      palpate::bench::run_disturbed_sessions(options);
    } else if (disturbed == "surfaces") {
      palpate::bench::run_disturbed(options, meshes, rows);
    } else {
      palpate::bench::run(options, shard);
    }
  });
}
