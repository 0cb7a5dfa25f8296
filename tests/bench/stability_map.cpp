// SPDX-License-Identifier: Apache-2.0
// stability_map — which walls can be pressed and held: period, mass, stiffness, damping and delay,
// per controller and use of the interaction. Stable, chattering or unstable, as a table and as a
// figure.
#include <spdlog/fmt/fmt.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/session/session_file.h"
#include "common/telemetry/summary.h"
#include "deploy/lockstep/lockstep.h"
#include "tests/bench/bench_output.h"
#include "tests/bench/controllers/contenders.h"

namespace palpate::bench {
namespace {

struct Way {
  std::string interaction;
  std::string controller;
  Overrides overrides;
};
const std::vector<Way> kModes{{"held", "none", {"mofc.controller=none", "device.monitor=off"}},
                              {"held", "paper", {"mofc.mode=paper", "device.monitor=off"}},
                              {"held", "vector", {"mofc.mode=vector"}},
                              {"held", "guard", {"mofc.mode=guard"}},
                              {"local", "none", {"mofc.controller=none", "device.monitor=off"}},
                              {"local", "paper", {"mofc.mode=paper", "device.monitor=off"}},
                              {"local", "vector", {"mofc.mode=vector"}},
                              {"local", "guard", {"mofc.mode=guard"}}};

/// Every controller, alone.
std::vector<Way> rivals() {
  std::vector<Way> ways;
  for (const char* interaction : {"held", "local"}) {
    for (const Contender& contender : contenders()) {
      if (contender.needs_model && interaction == std::string("held")) continue;
      Way way{interaction, contender.label, contender.overrides};
      way.overrides.emplace_back("device.monitor=off");
      ways.push_back(std::move(way));
    }
  }
  return ways;
}

struct Point {
  double period_ms;
  double mass_kg;
  double stiffness;
  double damping;
  double delay_ms;
};

enum class Verdict { kStable = 0, kChattering = 1, kUnstable = 2 };

struct Outcome {
  Verdict verdict = Verdict::kStable;
  double swing_m = 0.0;  // peak to peak along the normal, last 0.5 s
  double minimum_true_energy_joule = 0.0;
  double force_newton = 0.0;            // mean along the normal, last 0.5 s
  double stiffness_newton_per_m = 0.0;  // rendered: mean force over mean depth, last 0.5 s
};

/// The hand goes 10 mm into the wall within 0.3 s and stays for 2 s (docs/theory.md §7.5). In the
/// last 0.5 s: stable below 0.2 mm peak to peak, unstable from 5 mm or where the hand extracted
/// more than 10 mJ, else chattering.
Outcome press(const Point& point, const Way& way) {
  const std::string text = fmt::format(
      R"(name: "press"
device {{ rate_hz: {} simulated {{ mass_kg: {} }} }}
hand {{ mass_kg: {} }}
physics {{ rate_hz: {} }}
mofc {{ interaction: {} }}
scene {{ tissue {{ half_space {{}} kelvin_voigt {{ stiffness_newton_per_m: {} damping_newton_s_per_m: {} }} }} }}
faults {{ tool_motion {{ delay_ms: {} }} interaction {{ delay_ms: {} }} }}
)",
      1e3 / point.period_ms, 0.15 * point.mass_kg, 0.85 * point.mass_kg, 1e3 / point.period_ms,
      way.interaction, point.stiffness, point.damping, point.delay_ms, point.delay_ms);
  Session session = parse_session(text, "press", way.overrides);
  RecordedPath path;
  path.samples = {{0.0, {0, 0, 0.003}}, {0.1, {0, 0, 0.003}}, {0.4, {0, 0, -0.01}}};
  session.side().hand.path = path;

  Outcome outcome;
  double low = 1e9;
  double high = -1e9;
  double force_sum = 0.0;
  double depth_sum_m = 0.0;
  std::uint64_t rows = 0;
  Lockstep lockstep(session, {}, [&](const TickRow& row, const IdealState&) {
    outcome.minimum_true_energy_joule = row.device.minimum_true_energy_joule;
    if (to_seconds(row.device.sampled_at.time_since_epoch()) < 1.9) return;
    low = std::min(low, row.device.true_tool_position_world_m.z());
    high = std::max(high, row.device.true_tool_position_world_m.z());
    force_sum += row.device.force_on_hand_newton.z();
    depth_sum_m -= row.device.true_tool_position_world_m.z();
    ++rows;
  });
  lockstep.run_until(from_seconds(2.4));
  outcome.swing_m = high - low;
  outcome.force_newton = force_sum / static_cast<double>(std::max<std::uint64_t>(rows, 1));
  outcome.stiffness_newton_per_m = depth_sum_m > 0.0 ? force_sum / depth_sum_m : 0.0;
  if (outcome.swing_m >= 5e-3 || outcome.minimum_true_energy_joule < -10e-3) {
    outcome.verdict = Verdict::kUnstable;
  } else if (outcome.swing_m >= 0.2e-3) {
    outcome.verdict = Verdict::kChattering;
  }
  return outcome;
}

const char* name(Verdict verdict) {
  if (verdict == Verdict::kStable) return "stable";
  return verdict == Verdict::kChattering ? "chattering" : "unstable";
}

struct Grid {
  std::vector<double> periods_ms{0.25, 0.5, 1, 2, 5, 10, 20};
  std::vector<double> masses_kg{0.1, 0.3, 1.0};
  std::vector<double> stiffnesses{100, 300, 1000, 3000, 10000};
  std::vector<double> dampings{0, 5, 50, 150};
  std::vector<double> delays_ms{0, 5, 20};
};

struct MapOptions {
  BenchOptions bench;
  bool has_rivals = false;
  Shard shard;
};

Grid grid_of(const MapOptions& options) {
  Grid grid;
  if (options.bench.is_quick) {
    grid.masses_kg = {0.3};
    grid.dampings = {0, 50};
    grid.delays_ms = {0, 5};
  }
  if (options.has_rivals) {  // stiffness, damping and delay
    grid.periods_ms = {1};
    grid.masses_kg = {0.3};
  }
  return grid;
}

/// One panel for each variant: period across, stiffness up, at 0.3 kg without damping or delay, and
/// with 5 ms of delay.
void draw(const std::filesystem::path& folder) {
  std::string script = R"(set datafile separator ','
set terminal svg size 1300,620 dynamic background rgb 'white' font 'sans,11'
set output 'stability.svg'
set multiplot layout 2,4 title 'A wall without damping pressed by 0.3 kg, answers 5 ms away each way: green stable, amber chattering, red unstable'
set palette defined (0 '#2e8b57', 1 '#f0a830', 2 '#c0392b')
set cbrange [0:2]
unset colorbox
set logscale xy
set xrange [0.18:28]
set yrange [60:17000]
set xlabel 'period, ms'
set ylabel 'stiffness, N/m'
unset key
)";
  for (const Way& way : kModes) {
    script += fmt::format(
        "set title '{0}, {1}'\nplot 'stability.csv' using (strcol('interaction') eq '{0}' && "
        "strcol('controller') eq '{1}' && column('mass_kg') == 0.3 && "
        "column('damping_n_s_per_m') == 0 && column('delay_ms') == 5 ? column('period_ms') : "
        "NaN):'stiffness_n_per_m':'verdict_number' with points pt 5 ps 2.2 palette\n",
        way.interaction, way.controller);
  }
  draw_figure(folder, "stability", script + "unset multiplot\n");
}

/// Rendered stiffness under the nominal one, of walls without damping; – where it is not stable.
Table rendered_table(const Grid& grid) {
  std::vector<Table::Column> columns{{"interaction", "force", ""},
                                     {"controller", "controller", ""},
                                     {"delay_ms", "delay ms", "{:g}"}};
  for (const double k : grid.stiffnesses) {
    columns.push_back({fmt::format("rendered_at_{:g}", k), fmt::format("{:g} N/m", k), "{:.0f}"});
  }
  return Table(std::move(columns));
}

void run(const MapOptions& map) {
  const BenchOptions& options = map.bench;
  const Grid grid = grid_of(map);
  const std::vector<Way> ways = map.has_rivals ? rivals() : kModes;
  Table all({{"interaction", "force", ""},
             {"controller", "MOFC", ""},
             {"period_ms", "T ms", "{:g}"},
             {"mass_kg", "m kg", "{:g}"},
             {"stiffness_n_per_m", "k N/m", "{:g}"},
             {"damping_n_s_per_m", "b N·s/m", "{:g}"},
             {"delay_ms", "delay ms", "{:g}"},
             {"verdict", "", ""},
             {"verdict_number", "", "{:.0f}"},
             {"swing_mm", "swing mm", "{:.3f}"},
             {"force_n", "force N", "{:.2f}"},
             {"rendered_n_per_m", "rendered N/m", "{:.1f}"},
             {"min_true_energy_uj", "min energy µJ", "{:.1f}"}});
  Table counts({{"interaction", "force", ""},
                {"controller", "MOFC", ""},
                {"delay_ms", "delay ms", "{:g}"},
                {"stable", "stable", "{:.0f}"},
                {"chattering", "chattering", "{:.0f}"},
                {"unstable", "unstable", "{:.0f}"},
                {"largest_swing_mm", "largest swing mm", "{:.1f}"},
                {"mean_force_n", "mean force N", "{:.2f}"},
                {"rendered_ratio", "rendered / nominal k", "{:.2f}"},
                {"min_true_energy_uj", "min energy µJ", "{:.1f}"}});
  Table rendered = rendered_table(grid);
  std::optional<Steps> steps(std::in_place, ways.size() * grid.delays_ms.size() *
                                                grid.periods_ms.size() * grid.masses_kg.size() *
                                                grid.stiffnesses.size() * grid.dampings.size());
  std::size_t index = 0;
  for (const Way& way : ways) {
    for (const double delay_ms : grid.delays_ms) {
      double count[3] = {0, 0, 0};
      double largest_m = 0.0;
      double force = 0.0;
      double least_joule = 0.0;
      double rendered_ratio = 0.0;
      std::vector<Table::Cell> rendered_row{way.interaction, way.controller, delay_ms};
      for (const double period_ms : grid.periods_ms) {
        for (const double mass_kg : grid.masses_kg) {
          for (const double k : grid.stiffnesses) {
            for (const double b : grid.dampings) {
              steps->next();
              if (!map.shard.has(index++)) continue;
              const Point point{period_ms, mass_kg, k, b, delay_ms};
              const Outcome outcome = press(point, way);
              const auto verdict = static_cast<std::size_t>(outcome.verdict);
              ++count[verdict];
              largest_m = std::max(largest_m, outcome.swing_m);
              force += outcome.force_newton;
              rendered_ratio += outcome.stiffness_newton_per_m / k;
              if (b == 0.0) {
                const bool is_stable = outcome.verdict == Verdict::kStable;
                rendered_row.emplace_back(is_stable ? outcome.stiffness_newton_per_m : kNaN);
              }
              least_joule = std::min(least_joule, outcome.minimum_true_energy_joule);
              all.add({way.interaction, way.controller, period_ms, mass_kg, k, b, delay_ms,
                       std::string(name(outcome.verdict)), static_cast<double>(verdict),
                       1e3 * outcome.swing_m, outcome.force_newton, outcome.stiffness_newton_per_m,
                       1e6 * outcome.minimum_true_energy_joule});
            }
          }
        }
      }
      const double points = count[0] + count[1] + count[2];
      counts.add({way.interaction, way.controller, delay_ms, count[0], count[1], count[2],
                  1e3 * largest_m, force / points, rendered_ratio / points, 1e6 * least_joule});
      if (map.has_rivals) rendered.add(std::move(rendered_row));
    }
    counts.add_gap();
  }
  steps.reset();
  std::printf("%s", counts.text().c_str());
  if (map.has_rivals) {
    std::printf("\nRendered stiffness of walls without damping, N/m; – where it is not stable:\n%s",
                rendered.text().c_str());
  }
  std::printf(
      "\nA hand of 150 N/m and 6 N·s/m goes 10 mm into the wall and stays: device and physics with "
      "period T, delay each way.\nPeak to peak in the last 0.5 s: stable below 0.2 mm, unstable "
      "from 5 mm or where the hand extracted more than 10 mJ.\nMean force: the force held; zero "
      "force is stable, too. Rendered: mean force over mean depth. --csv has every point.\n");
  write_table(options, all.csv());
  write_json(options, all.json());
  if (options.plot_folder.empty() || map.has_rivals) return;
  const std::filesystem::path folder = options.plot_folder;
  std::filesystem::create_directories(folder);
  write_file(folder / "stability.csv", all.csv());
  draw(folder);
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app("Which walls can be pressed and held, in lockstep.");
  palpate::bench::MapOptions options;
  app.add_flag("--rivals", options.has_rivals,
               "every controller of controllers_bench, at 1 kHz and 0.3 kg");
  palpate::bench::add_shard_option(app, options.shard);
  return palpate::bench::run_bench(app, options.bench, argc, argv,
                                   [&] { palpate::bench::run(options); });
}
