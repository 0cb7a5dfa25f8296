// SPDX-License-Identifier: Apache-2.0
// controllers_bench — every controller on the same hand and tissue, in lockstep: is it safe, is the
// force true, what does a step cost. Exit status 1 if mode guard or a controller behind the safety
// net gives energy to the hand, or if nothing does so without a controller.
#include <spdlog/fmt/fmt.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/session/session_file.h"
#include "deploy/lockstep/loopback.h"
#include "tests/bench/bench_output.h"
#include "tests/bench/controllers/contenders.h"
#include "tests/bench/controllers/step_times.h"
#include "tests/support/machine/places.h"

namespace palpate::bench {
namespace {

/// Below it a run counts as unsafe: more than the rounding of the inner steps.
constexpr double kNegativeJoule = -1e-6;
/// Transparencies that differ by less count as equal.
constexpr double kEqualTransparency = 0.005;
constexpr const char* kSession = "tests/bench/controllers/compare.txtpb";

struct Choice {
  std::string label;
  Overrides overrides;
};

struct Conditions {
  std::vector<Choice> tissues;
  std::vector<Choice> ways;
  std::vector<double> delays_ms;
  std::vector<double> losses;
  std::vector<double> resolutions_m;
  std::uint64_t seeds = 1;       ///< of the hostile hands
  std::uint64_t calm_seeds = 1;  ///< of the calm one, and of runs with the safety net
};

std::string tissue(const char* surface, double stiffness, double damping, bool is_isotropic) {
  return fmt::format(
      "scene={{ tissue {{ name: 'wall' {} kelvin_voigt {{ stiffness_newton_per_m: {} "
      "damping_newton_s_per_m: {} isotropic_damping: {} adhesive: {} }} }} }}",
      surface, stiffness, damping, is_isotropic, is_isotropic);
}

/// Soft where x < 0, rigid where x > 0: one leg of the V each.
constexpr const char* kMixed =
    "scene={ tissue { name: 'soft' box { center_m { x: -0.1 z: -0.1 } size_m { x: 0.2 y: 0.4 z: "
    "0.2 "
    "} } kelvin_voigt { stiffness_newton_per_m: 6 damping_newton_s_per_m: 15 isotropic_damping: "
    "true "
    "adhesive: true } } tissue { name: 'rigid' box { center_m { x: 0.1 z: -0.1 } size_m { x: 0.2 "
    "y: "
    "0.4 z: 0.2 } } kelvin_voigt { stiffness_newton_per_m: 45 damping_newton_s_per_m: 150 "
    "isotropic_damping: true adhesive: true } } }";

Conditions conditions(bool is_quick) {
  Conditions all{
      .tissues = {{"paper soft", {tissue("half_space {}", 6, 15, true)}},
                  {"paper rigid", {tissue("half_space {}", 45, 150, true)}},
                  {"500 N/m", {tissue("half_space {}", 500, 1, false)}},
                  {"2000 N/m", {tissue("half_space {}", 2000, 1, false)}},
                  {"paper mixed", {kMixed}},
                  {"damper", {tissue("half_space {}", 1, 30, true)}},
                  {"sphere",
                   {tissue("sphere { center_m { z: -0.03 } radius_m: 0.03 }", 1000, 1, false)}},
                  {"active",
                   {tissue("half_space {}", 500, 1, false), "adversary.physics=active_tissue"}}},
      .ways = {{"50 Hz held", {"physics.rate_hz=50", "mofc.interaction=held"}},
               {"1 kHz held", {"physics.rate_hz=1000", "mofc.interaction=held"}},
               {"1 kHz local", {"physics.rate_hz=1000", "mofc.interaction=local"}}},
      .delays_ms = {0, 5, 20, 50, 100},
      .losses = {0.0, 0.2},
      .resolutions_m = {0.0, 55e-6},
      .seeds = 5,
      .calm_seeds = 3};
  if (is_quick) {
    all.tissues = {all.tissues[0], all.tissues[1], all.tissues[3]};
    all.delays_ms = {0, 20};
    all.losses = {0.0};
    all.resolutions_m = {55e-6};
    all.seeds = 3;
    all.calm_seeds = 1;
  }
  return all;
}

/// What the hand does: presses and releases, or tries to extract energy.
const Choice kCalm{"calm", {}};

Choice hostile(const char* label, double stiffness, double radius_m, double v_max_m_per_s) {
  return {label,
          {fmt::format("hand={{ stiffness_newton_per_m: {} damping_newton_s_per_m: 40 hostile {{ "
                       "radius_m: {} v_max_m_per_s: {} }} }}",
                       stiffness, radius_m, v_max_m_per_s)}};
}
const Choice kHostile[] = {hostile("hostile", 2000, 0.02, 0.3),
                           hostile("hostile, fast", 2000, 0.02, 0.5),
                           hostile("hostile, loose grip", 500, 0.05, 0.5)};

/// What the tables need of a run.
struct Outcome {
  double least_joule = 0.0;
  double transparency = 0.0, error = 0.0, path_m = 0.0, reversals = 0.0, clamped = 0.0;
};

struct Run {
  const Contender* contender = nullptr;
  std::string tissue, way, hand;
  double delay_ms = 0.0, loss = 0.0, resolution_m = 0.0;
  std::uint64_t seed = 1;
  bool has_net = false;
  Overrides overrides;
  Outcome outcome{};

  [[nodiscard]] bool is_negative() const { return outcome.least_joule < kNegativeJoule; }
  /// Everything but controller, hand and seed.
  [[nodiscard]] auto condition() const {
    return std::tuple(tissue, way, delay_ms, loss, resolution_m);
  }
};

std::vector<Run> all_runs(const std::vector<Contender>& contenders, const Conditions& c) {
  std::vector<Run> runs;
  const auto add = [&](const Contender& contender, const Choice& tissue, const Choice& way,
                       const Choice& hand, double delay_ms, double loss, double resolution_m,
                       std::uint64_t seed, bool has_net) {
    Run run{&contender, tissue.label, way.label, hand.label, delay_ms,
            loss,       resolution_m, seed,      has_net,    {}};
    for (const Overrides* more :
         {&tissue.overrides, &way.overrides, &hand.overrides, &contender.overrides}) {
      run.overrides.insert(run.overrides.end(), more->begin(), more->end());
    }
    for (const char* hop : {"tool_motion", "interaction"}) {
      run.overrides.push_back(fmt::format("faults.{}.delay_ms={}", hop, delay_ms));
      run.overrides.push_back(fmt::format("faults.{}.loss_ratio={}", hop, loss));
    }
    for (const char* path : {"device.profile", "device.simulated"}) {
      run.overrides.push_back(fmt::format("{}.position_resolution_m={}", path, resolution_m));
    }
    run.overrides.push_back(fmt::format("seed={}", seed));
    if (has_net) run.overrides.emplace_back("mofc.safety_net=true");
    runs.push_back(std::move(run));
  };
  for (const Contender& contender : contenders) {
    for (const Choice& tissue : c.tissues) {
      for (const Choice& way : c.ways) {
        if (contender.needs_model && way.label.ends_with("held")) continue;
        for (const double delay : c.delays_ms) {
          for (const double loss : c.losses) {
            for (const double q : c.resolutions_m) {
              for (std::uint64_t seed = 1; seed <= c.seeds; ++seed) {
                const auto with = [&](const Choice& hand, bool has_net) {
                  add(contender, tissue, way, hand, delay, loss, q, seed, has_net);
                };
                if (seed <= c.calm_seeds) with(kCalm, false);
                for (const Choice& hand : kHostile) with(hand, false);
                if (contender.label != "mofc guard" && seed <= c.calm_seeds) {
                  with(kHostile[0], true);
                }
              }
            }
          }
        }
      }
    }
  }
  return runs;
}

void compute(std::vector<Run>& runs) {
  Steps steps(runs.size());
  std::atomic<std::size_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < runs.size(); i = next++) {
        Run& run = runs[i];
        const Session session =
            load_session(std::filesystem::path(test::source_dir()) / kSession, run.overrides);
        LoopbackOptions options;
        // the hostile hand has no ideal path
        options.lockstep.has_ideal = run.hand == kCalm.label;
        const RunStatistics s = run_loopback(session, options).statistics;
        run.outcome = {.least_joule = s.minimum_true_energy_joule(),
                       .transparency = s.ideal_transparency(),
                       .error = s.force_error_rms_ratio(),
                       .path_m = s.path_deviation_rms_m(),
                       .reversals = static_cast<double>(s.excess_reversals()),
                       .clamped = s.clamp_ratio()};
        steps.next();
      }
    } catch (...) {
      const std::lock_guard lock(failure_mutex);
      failure = std::current_exception();
      next = runs.size();
    }
  };
  {
    std::vector<std::jthread> threads;
    for (unsigned i = std::max(1U, std::thread::hardware_concurrency()); i > 0; --i) {
      threads.emplace_back(work);
    }
  }
  if (failure) std::rethrow_exception(failure);
}

/// Runs below −1 µJ, and the least energy.
struct Safety {
  int runs = 0;
  int negative = 0;
  double least_joule = 0.0;
  void add(const Run& run) {
    ++runs;
    if (run.is_negative()) ++negative;
    least_joule = std::min(least_joule, run.outcome.least_joule);
  }
  [[nodiscard]] std::string text() const { return fmt::format("{} of {}", negative, runs); }
};

Table safety_table(const std::vector<Contender>& contenders, const std::vector<Run>& runs) {
  Table table({{"controller", "controller", ""},
               {"calm_negative", "calm hand: below −1 µJ", ""},
               {"calm_least_mj", "least mJ", "{:.3f}"},
               {"hostile_negative", "hostile hands", ""},
               {"hostile_least_mj", "least mJ", "{:.3f}"},
               {"net_negative", "hostile, safety net", ""},
               {"net_least_uj", "least µJ", "{:.3f}"}});
  for (const Contender& contender : contenders) {
    Safety calm, hostile, net;
    for (const Run& run : runs) {
      if (run.contender != &contender) continue;
      (run.has_net ? net : run.hand == kCalm.label ? calm : hostile).add(run);
    }
    table.add({contender.label, calm.text(), 1e3 * calm.least_joule, hostile.text(),
               1e3 * hostile.least_joule, net.runs > 0 ? net.text() : std::string("–"),
               net.runs > 0 ? 1e6 * net.least_joule : kNaN});
  }
  return table;
}

/// Mean over the runs of the calm hand.
struct Truth {
  int runs = 0;
  double transparency = 0.0, error = 0.0, path_m = 0.0, reversals = 0.0, clamped = 0.0;
  void add(const Outcome& outcome) {
    ++runs;
    const auto number = [](double value) { return std::isfinite(value) ? value : 0.0; };
    transparency += number(outcome.transparency);
    error += number(outcome.error);
    path_m += number(outcome.path_m);
    reversals += outcome.reversals;
    clamped += number(outcome.clamped);
  }
  [[nodiscard]] double mean(double sum) const { return runs > 0 ? sum / runs : kNaN; }
};

Table truth_table(const std::vector<Contender>& contenders, const std::vector<Run>& runs,
                  const Conditions& c) {
  Table table({{"way", "physics", ""},
               {"controller", "controller", ""},
               {"transparency_percent", "transp. %", "{:.1f}"},
               {"force_error_percent", "force error %", "{:.1f}"},
               {"path_deviation_mm", "path mm", "{:.3f}"},
               {"excess_reversals", "excess rev.", "{:.1f}"},
               {"changed_percent", "force changed %", "{:.1f}"}});
  for (const Choice& way : c.ways) {
    if (&way != c.ways.data()) table.add_gap();
    for (const Contender& contender : contenders) {
      Truth truth;
      for (const Run& run : runs) {
        const bool counts = run.contender == &contender && run.way == way.label;
        if (counts && run.hand == kCalm.label) truth.add(run.outcome);
      }
      if (truth.runs == 0) continue;
      table.add({way.label, contender.label, 100.0 * truth.mean(truth.transparency),
                 100.0 * truth.mean(truth.error), 1e3 * truth.mean(truth.path_m),
                 truth.mean(truth.reversals), 100.0 * truth.mean(truth.clamped)});
    }
  }
  return table;
}

/// Of one controller under one condition.
struct Point {
  bool is_safe = true;  // with all hands and seeds
  double transparency = 0.0;
  double error = 0.0;
  int seeds = 0;
};

/// In how many conditions a controller is safe; and no safe one is truer, by transparency alone or
/// by transparency and force error together.
Table front_table(const std::vector<Contender>& contenders, const std::vector<Run>& runs) {
  using Condition = decltype(std::declval<Run>().condition());
  std::map<Condition, std::map<const Contender*, Point>> points;
  for (const Run& run : runs) {
    if (run.has_net) continue;
    Point& point = points[run.condition()][run.contender];
    point.is_safe = point.is_safe && !run.is_negative();
    if (run.hand != kCalm.label) continue;
    point.transparency += run.outcome.transparency;
    point.error += run.outcome.error;
    ++point.seeds;
  }
  struct Count {
    int rows = 0, safe = 0, truest = 0, undominated = 0, local = 0, local_truest = 0;
  };
  std::map<const Contender*, Count> counts;
  for (auto& [condition, row] : points) {
    for (auto& [contender, point] : row) {
      point.transparency /= std::max(1, point.seeds);
      point.error /= std::max(1, point.seeds);
    }
    const bool is_local = std::get<1>(condition).ends_with("local");
    for (const auto& [contender, point] : row) {
      Count& count = counts[contender];
      ++count.rows;
      if (is_local) ++count.local;
      if (!point.is_safe) continue;
      ++count.safe;
      bool is_truest = true;
      bool is_dominated = false;
      for (const auto& [other, rival] : row) {
        if (!rival.is_safe) continue;
        const bool is_truer = rival.transparency >= point.transparency + kEqualTransparency;
        is_truest = is_truest && !is_truer;
        is_dominated =
            is_dominated || (is_truer && rival.error <= point.error - kEqualTransparency);
      }
      if (is_truest) ++count.truest;
      if (is_truest && is_local) ++count.local_truest;
      if (!is_dominated) ++count.undominated;
    }
  }
  Table table({{"controller", "controller", ""},
               {"conditions", "conditions", "{:.0f}"},
               {"safe", "safe", "{:.0f}"},
               {"truest", "none truer", "{:.0f}"},
               {"undominated", "none truer with less error", "{:.0f}"},
               {"local", "local", "{:.0f}"},
               {"local_truest", "none truer", "{:.0f}"}});
  for (const Contender& contender : contenders) {
    const Count& count = counts[&contender];
    table.add({contender.label, static_cast<double>(count.rows), static_cast<double>(count.safe),
               static_cast<double>(count.truest), static_cast<double>(count.undominated),
               static_cast<double>(count.local), static_cast<double>(count.local_truest)});
  }
  return table;
}

Table row_table(const std::vector<Run>& runs) {
  Table table({{"controller", "", ""},
               {"safety_net", "", "{:.0f}"},
               {"tissue", "", ""},
               {"physics", "", ""},
               {"delay_ms", "", "{:g}"},
               {"loss", "", "{:g}"},
               {"resolution_m", "", "{:g}"},
               {"hand", "", ""},
               {"seed", "", "{:.0f}"},
               {"least_true_energy_joule", "", "{:g}"},
               {"transparency", "", "{:g}"},
               {"force_error", "", "{:g}"},
               {"path_deviation_m", "", "{:g}"},
               {"excess_reversals", "", "{:.0f}"},
               {"changed", "", "{:g}"},
               {"command", "", ""}});
  for (const Run& run : runs) {
    const Outcome& o = run.outcome;
    std::string command = std::string("palpate loopback ") + kSession;
    for (const std::string& override : run.overrides) {
      command += fmt::format(" --set \"{}\"", override);
    }
    table.add({run.contender->label, run.has_net ? 1.0 : 0.0, run.tissue, run.way, run.delay_ms,
               run.loss, run.resolution_m, run.hand, static_cast<double>(run.seed), o.least_joule,
               o.transparency, o.error, o.path_m, o.reversals, o.clamped, command});
  }
  return table;
}

/// The rows that --json of earlier calls wrote, of parts of the conditions or all.
std::vector<Run> read_runs(const std::vector<std::string>& files,
                           const std::vector<Contender>& contenders) {
  std::vector<Run> runs;
  for (const std::string& file : files) {
    try {
      std::ifstream in(file);
      const nlohmann::json written = nlohmann::json::parse(in);
      for (const auto& row : written.at("rows").at("rows")) {
        const auto label = row.at("controller").get<std::string>();
        const auto contender = std::find_if(contenders.begin(), contenders.end(),
                                            [&](const Contender& c) { return c.label == label; });
        if (contender == contenders.end()) throw std::runtime_error("no controller " + label);
        const auto number = [&](const char* key) {  // null: not finite
          return row.at(key).is_null() ? kNaN : row.at(key).get<double>();
        };
        runs.push_back({.contender = &*contender,
                        .tissue = row.at("tissue"),
                        .way = row.at("physics"),
                        .hand = row.at("hand"),
                        .delay_ms = number("delay_ms"),
                        .loss = number("loss"),
                        .resolution_m = number("resolution_m"),
                        .seed = row.at("seed").get<std::uint64_t>(),
                        .has_net = number("safety_net") != 0.0,
                        .overrides = {},
                        .outcome = {.least_joule = number("least_true_energy_joule"),
                                    .transparency = number("transparency"),
                                    .error = number("force_error"),
                                    .path_m = number("path_deviation_m"),
                                    .reversals = number("excess_reversals"),
                                    .clamped = number("changed")}});
      }
    } catch (const std::exception& error) {
      throw SetupError(file + ": " + error.what() +
                       "; give files that --json of this program wrote");
    }
  }
  return runs;
}

/// Whether the claims hold; each that does not is printed.
bool holds(const std::vector<Run>& runs) {
  bool bites = false;
  bool is_safe = true;
  for (const Run& run : runs) {
    bites = bites || (run.contender->label == "none" && !run.has_net && run.is_negative());
    const bool is_protected = run.has_net || run.contender->label == "mofc guard";
    if (!is_protected || !run.is_negative()) continue;
    is_safe = false;
    std::printf("FAILED: %s%s draws energy: %s, %s, %g ms, seed %llu\n",
                run.contender->label.c_str(), run.has_net ? " behind guard" : "",
                run.tissue.c_str(), run.way.c_str(), run.delay_ms,
                static_cast<unsigned long long>(run.seed));
  }
  if (!bites)
    std::printf("FAILED: no run without a controller is negative: the bench shows nothing\n");
  return bites && is_safe;
}

struct ControllersOptions {
  BenchOptions bench;
  Shard shard;
  std::uint64_t seeds = 0;  ///< of each hostile hand; 0: as many as the conditions say
  std::vector<std::string> merged_files;  ///< not empty: no runs, but the rows of these
};

/// Whole conditions, so that a part has its own front.
std::vector<Run> shard_of(std::vector<Run> runs, const Shard& shard) {
  std::map<decltype(std::declval<Run>().condition()), std::size_t> numbers;
  std::vector<Run> part;
  for (Run& run : runs) {
    const std::size_t number = numbers.try_emplace(run.condition(), numbers.size()).first->second;
    if (shard.has(number)) part.push_back(std::move(run));
  }
  return part;
}

/// Safety against truth: a point per controller and kind of physics, the least energy of all runs
/// against the mean transparency of the calm hand.
void draw_pareto(const std::filesystem::path& folder, const std::vector<Contender>& contenders,
                 const std::vector<Run>& runs, const Conditions& c) {
  std::filesystem::create_directories(folder);
  Table table({{"way", "", ""},
               {"controller", "", ""},
               {"lost_mj", "", "{:g}"},
               {"transparency_percent", "", "{:g}"}});
  for (const Choice& way : c.ways) {
    for (const Contender& contender : contenders) {
      Safety safety;
      Truth truth;
      for (const Run& run : runs) {
        if (run.contender != &contender || run.way != way.label || run.has_net) continue;
        safety.add(run);
        if (run.hand == kCalm.label) truth.add(run.outcome);
      }
      if (truth.runs == 0) continue;
      // on a logarithmic axis; what counts as safe is drawn at its limit
      table.add({way.label, contender.label, 1e3 * std::max(-kNegativeJoule, -safety.least_joule),
                 100.0 * truth.mean(truth.transparency)});
    }
  }
  write_file(folder / "pareto.csv", table.csv());
  std::string script = R"(set datafile separator ','
set terminal svg size 1300,620 dynamic background rgb 'white' font 'sans,11'
set output 'pareto.svg'
set multiplot layout 1,3 title 'Safety against truth: up and to the left is better; at the left edge the hand never gains energy'
set logscale x
set xrange [6e-4:2e3]
set yrange [0:105]
set grid
unset key
set xlabel 'most energy that the hand gained, mJ'
set ylabel 'transparency of the calm hand, %'
)";
  for (const Choice& way : c.ways) {
    script += fmt::format(
        "set title '{0}'\nplot 'pareto.csv' using (strcol('way') eq '{0}' ? column('lost_mj') : "
        "NaN):'transparency_percent' with points pt 7 ps 0.7 lc rgb '#1f618d', '' using "
        "(strcol('way') eq '{0}' ? column('lost_mj') : NaN):'transparency_percent':'controller' "
        "with labels left offset 0.6,0.2 font 'sans,8'\n",
        way.label);
  }
  draw_figure(folder, "pareto", script + "unset multiplot\n");
}

bool run(const ControllersOptions& options) {
  const std::vector<Contender> all = contenders();
  Conditions c = conditions(options.bench.is_quick);
  if (options.seeds > 0) c.seeds = options.seeds;
  const bool is_merge = !options.merged_files.empty();
  if (is_merge && (options.bench.is_quick || !options.bench.csv_file.empty())) {
    throw SetupError("--merge: makes no runs and no rows of them: leave out --quick and --csv");
  }
  std::vector<Run> runs =
      is_merge ? read_runs(options.merged_files, all) : shard_of(all_runs(all, c), options.shard);
  if (!is_merge) compute(runs);
  nlohmann::ordered_json json;
  const auto show = [&](const char* key, const char* title, const Table& table) {
    std::printf("%s\n%s\n", title, table.text().c_str());
    json[key] = table.json();
  };
  std::printf("%zu runs of 2 s, device at 1 kHz; delay each way.\n\n", runs.size());
  show("safety", "Is it safe? Least true energy of the device's port.", safety_table(all, runs));
  show("truth", "Is it true? Calm hand, means over tissues, delays and losses; against the ideal.",
       truth_table(all, runs, c));
  show("front",
       "Both? Conditions in which it is safe with every hand, and none of the safe is truer.",
       front_table(all, runs));
  show("step", "What does a step cost? Processor time of one step.", step_time_table());
  if (!is_merge) {
    const Table rows = row_table(runs);
    write_table(options.bench, rows.csv());
    json["rows"] = rows.json();
  }
  write_json(options.bench, json);
  if (!options.bench.plot_folder.empty()) draw_pareto(options.bench.plot_folder, all, runs, c);
  return holds(runs);
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app("Every controller side by side: safety, truth, cost.");
  palpate::bench::ControllersOptions options;
  palpate::bench::add_shard_option(app, options.shard);
  app.add_option("--seeds", options.seeds, "runs of each hostile hand under each condition");
  app.add_option(
         "--merge", options.merged_files,
         "make no runs: the tables and the picture of all rows in these files, which --json "
         "wrote")
      ->type_name("FILE ...")
      ->excludes("--shard")
      ->excludes("--seeds");
  bool is_good = true;
  const int status = palpate::bench::run_bench(app, options.bench, argc, argv,
                                               [&] { is_good = palpate::bench::run(options); });
  return status != 0 ? status : (is_good ? 0 : 1);
}
