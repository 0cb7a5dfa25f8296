// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/paper/paper_fit.h"

#include <spdlog/fmt/fmt.h>

#include <array>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <sstream>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/core/user/temp_folder.h"
#include "common/session/session_file.h"
#include "deploy/lockstep/loopback.h"
#include "tests/support/machine/places.h"

namespace palpate::bench {
namespace {

using Overrides = std::vector<std::string>;
constexpr const char* kFit = "deploy/sessions/paper_fit.txtpb";
constexpr const char* kWithout = "mofc.controller=none";
constexpr double kRate_hz = 50.0;

/// What a run of one V shows, sample by sample.
struct Contact {
  int first = -1;  // sample
  int last = -1;
  int samples = 0;
  std::array<int, 3> limited{};  // samples in which the controller reduced the axis
  std::array<int, 3> limited_first{-1, -1, -1};
  int at_peak = 0;  // samples with the device's largest force
  RunStatistics statistics{};
};

/// The numbers of a line, by the names of the head.
std::map<std::string, double> row_of(const std::vector<std::string>& head,
                                     const std::string& line) {
  std::map<std::string, double> row;
  std::istringstream cells(line);
  std::string cell;
  for (std::size_t i = 0; i < head.size() && std::getline(cells, cell, ','); ++i) {
    row[head[i]] = std::strtod(cell.c_str(), nullptr);
  }
  return row;
}

/// The samples of a table written by a run.
void read_samples(const std::filesystem::path& file, Contact& contact) {
  std::ifstream in(file);
  std::string line;
  std::getline(in, line);
  std::vector<std::string> head;
  std::istringstream names(line);
  for (std::string name; std::getline(names, name, ',');) head.push_back(name);
  const std::array<std::pair<const char*, const char*>, 3> axes{
      {{"fe_x", "fs_x"}, {"fe_y", "fs_y"}, {"fe_z", "fs_z"}}};
  while (std::getline(in, line)) {
    const auto row = row_of(head, line);
    if (row.at("in_contact") == 0.0) continue;
    const int sample = static_cast<int>(std::lround(kRate_hz * row.at("t_s")));
    if (contact.first < 0) contact.first = sample;
    contact.last = sample;
    ++contact.samples;
    if (row.at("peak_limited") != 0.0) ++contact.at_peak;
    if (row.at("clamped") == 0.0) continue;
    for (std::size_t i = 0; i < axes.size(); ++i) {
      constexpr double kRoundingNewton = 1e-9;
      const double removed = std::abs(row.at(axes[i].first)) - std::abs(row.at(axes[i].second));
      if (removed <= kRoundingNewton) continue;
      if (contact.limited_first[i] < 0) contact.limited_first[i] = sample;
      ++contact.limited[i];
    }
  }
}

/// Names for the tables of runs, in a folder that is removed at the end.
class Scratch {
 public:
  [[nodiscard]] std::filesystem::path next() {
    return folder_.path() / fmt::format("{}.csv", count_.fetch_add(1));
  }

 private:
  TempFolder folder_;
  std::atomic<int> count_{0};
};

struct Trial {
  std::string session = kFit;
  Overrides overrides{};
  Contact contact{};

  [[nodiscard]] std::string command() const {
    std::string text = "palpate loopback " + session;
    for (const std::string& override : overrides) text += fmt::format(" --set \"{}\"", override);
    return text;
  }
};

void compute(std::vector<Trial*>& trials) {
  Scratch scratch;
  Steps steps(trials.size());
  std::atomic<std::size_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < trials.size(); i = next++) {
        Trial& trial = *trials[i];
        const auto table = scratch.next();
        const Session session = load_session(
            std::filesystem::path(test::source_dir()) / trial.session, trial.overrides);
        trial.contact.statistics = run_loopback(session, {.csv_file = table.string()}).statistics;
        read_samples(table, trial.contact);
        std::filesystem::remove(table);
        steps.next();
      }
    } catch (...) {
      const std::lock_guard lock(failure_mutex);
      failure = std::current_exception();
      next = trials.size();
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

// --- the statements ---------------------------------------------------------------------------

struct Experiment {
  const char* label;
  const char* printed;
  Trial trial;
};

std::vector<Experiment> experiments() {
  const Overrides soft{
      "scene={ tissue { name: 'soft' half_space {} kelvin_voigt { stiffness_newton_per_m: 6 "
      "damping_newton_s_per_m: 15 isotropic_damping: true adhesive: true } } }"};
  const Overrides mixed{
      "hand.mass_kg=1",
      "hand.v={ free_amplitude_m: 0.027 free_frequency_hz: 0.47 speed_m_per_s: 0.0419 apex_m { z: "
      "-0.00157 } height_m: 0.01157 half_width_m: 0.0193 tangent { x: 1 y: 1.383 } "
      "free_motion_s: 17.762 }",
      "duration_s=19.2"};
  const auto without = [](Overrides overrides) {
    overrides.emplace_back(kWithout);
    return overrides;
  };
  constexpr const char* kMixed = "deploy/sessions/paper_mixed.txtpb";
  return {{"soft, without", "V-like path", {.overrides = without(soft)}},
          {"soft, with", "100 / 100 / 100 %, not changed", {.overrides = soft}},
          {"rigid, without", "path disturbed", {.overrides = without({})}},
          {"rigid, with", "71.59 / 79.21 / 73.4 %, samples 649 to 659, path not disturbed", {}},
          {"mixed, without", "not shown", {.session = kMixed, .overrides = without(mixed)}},
          {"mixed, with",
           "samples 910 to 918 not changed, 918 to 928 limited",
           {.session = kMixed, .overrides = mixed}}};
}

Table statements_table(const std::vector<Experiment>& rows) {
  Table table({{"experiment", "experiment", ""},
               {"printed", "the paper", ""},
               {"transparency_x_percent", "x %", "{:.1f}"},
               {"transparency_y_percent", "y %", "{:.1f}"},
               {"transparency_z_percent", "z %", "{:.1f}"},
               {"first_sample", "samples from", "{:.0f}"},
               {"last_sample", "to", "{:.0f}"},
               {"limited_x", "x limited", "{:.0f}"},
               {"limited_y", "y", "{:.0f}"},
               {"limited_z", "z", "{:.0f}"},
               {"first_limited_sample", "first limited", "{:.0f}"},
               {"at_peak", "at 3.3 N", "{:.0f}"},
               {"excess_reversals", "excess rev.", "{:.0f}"},
               {"path_deviation_mm", "path mm", "{:.2f}"},
               {"min_true_energy_uj", "min energy µJ", "{:.1f}"}});
  for (const Experiment& row : rows) {
    const Contact& c = row.trial.contact;
    const RunStatistics& s = c.statistics;
    const Vector3 transparency = 100.0 * s.transparency();
    int first_limited = -1;
    for (const int sample : c.limited_first) {
      if (sample >= 0 && (first_limited < 0 || sample < first_limited)) first_limited = sample;
    }
    table.add({std::string(row.label), std::string(row.printed), transparency.x(), transparency.y(),
               transparency.z(), 1.0 * c.first, 1.0 * c.last, 1.0 * c.limited[0],
               1.0 * c.limited[1], 1.0 * c.limited[2],
               first_limited < 0 ? std::nan("") : 1.0 * first_limited, 1.0 * c.at_peak,
               static_cast<double>(s.excess_reversals()), 1e3 * s.path_deviation_rms_m(),
               1e6 * s.minimum_true_energy_joule()});
  }
  return table;
}

// --- how much each parameter matters ----------------------------------------------------------

struct Change {
  const char* label;
  Overrides overrides;
  double free_motion_s = 12.582;
};

Overrides friction(double viscous, double coulomb) {
  Overrides overrides;
  for (const char* part : {"profile", "simulated"}) {
    overrides.push_back(fmt::format("device.{}.viscous_newton_s_per_m={}", part, viscous));
    overrides.push_back(fmt::format("device.{}.coulomb_newton={}", part, coulomb));
  }
  return overrides;
}

std::vector<Change> changes() {
  const auto rigid = [](bool is_isotropic, bool is_adhesive) {
    return fmt::format(
        "scene.tissue[0].kelvin_voigt={{ stiffness_newton_per_m: 45 "
        "damping_newton_s_per_m: 150 isotropic_damping: {} adhesive: {} }}",
        is_isotropic, is_adhesive);
  };
  return {{"the fit", {}},
          {"mass 0.3 kg", {"hand.mass_kg=0.255"}},
          {"mass 0.75 kg", {"hand.mass_kg=0.705"}},
          {"mass 1.4 kg", {"hand.mass_kg=1.355"}},
          {"hand 20 N·s/m", {"hand.damping_newton_s_per_m=20"}},
          {"hand 500 N/m", {"hand.stiffness_newton_per_m=500"}},
          {"f_d 0.05 N·s/m", friction(0.05, 0.1)},
          {"f_d 0.2 N·s/m", friction(0.2, 0.1)},
          {"f_co 0.05 N", friction(0.1, 0.05)},
          {"f_co 0.2 N", friction(0.1, 0.2)},
          {"speed 35 mm/s", {"hand.v.speed_m_per_s=0.035"}},
          {"speed 61 mm/s", {"hand.v.speed_m_per_s=0.061"}},
          {"depth 1 mm", {"hand.v.apex_m={ z: -0.001 }"}},
          {"depth 5 mm", {"hand.v.apex_m={ z: -0.005 }", "hand.v.height_m=0.015"}},
          {"damper that only pushes", {rigid(true, false)}},
          {"damping along the normal only", {rigid(false, true)}},
          {"physics one period late", {"mofc.wait_for_physics_ms=0"}},
          {"free motion 2 s", {}, 2.0},
          {"free motion 5 s", {}, 5.0},
          {"free motion 18 s", {}, 18.0},
          {"free motion 40 s", {}, 40.0}};
}

/// Means over starting times spread over one period.
struct Phases {
  Change change;
  std::vector<Trial> with, without;
};

std::vector<Phases> phases_of_all(int count) {
  std::vector<Phases> all;
  for (const Change& change : changes()) {
    Phases phases{change, {}, {}};
    for (int i = 0; i < count; ++i) {
      const double free_s = change.free_motion_s + (1.0 * i / count - 0.5) / kRate_hz;
      Overrides overrides = change.overrides;
      overrides.push_back(fmt::format("hand.v.free_motion_s={:.5f}", free_s));
      overrides.push_back(fmt::format("duration_s={:.2f}", free_s + 1.5));
      phases.with.push_back({.overrides = overrides});
      overrides.emplace_back(kWithout);
      phases.without.push_back({.overrides = overrides});
    }
    all.push_back(std::move(phases));
  }
  return all;
}

Table sensitivity_table(const std::vector<Phases>& all) {
  Table table({{"change", "changed", ""},
               {"x_percent", "with: x %", "{:.0f}"},
               {"y_percent", "y %", "{:.0f}"},
               {"z_percent", "z %", "{:.0f}"},
               {"spread_percent", "sd", "{:.0f}"},
               {"excess_reversals", "excess rev.", "{:.1f}"},
               {"samples", "contact samples", "{:.1f}"},
               {"without_x_percent", "without: x %", "{:.0f}"},
               {"without_y_percent", "y %", "{:.0f}"},
               {"without_z_percent", "z %", "{:.0f}"},
               {"without_excess_reversals", "excess rev.", "{:.1f}"}});
  const auto mean = [](const std::vector<Trial>& trials, const auto& value) {
    auto sum = value(trials.front());
    for (std::size_t i = 1; i < trials.size(); ++i) sum += value(trials[i]);
    return decltype(sum)(sum / static_cast<double>(trials.size()));
  };
  const auto transparency = [](const Trial& t) {
    return Vector3(100.0 * t.contact.statistics.transparency());
  };
  const auto reversals = [](const Trial& t) {
    return static_cast<double>(t.contact.statistics.excess_reversals());
  };
  for (const Phases& phases : all) {
    const Vector3 with = mean(phases.with, transparency);
    const Vector3 without = mean(phases.without, transparency);
    const double variance = mean(
        phases.with, [&](const Trial& t) { return (transparency(t) - with).squaredNorm() / 3.0; });
    table.add({std::string(phases.change.label), with.x(), with.y(), with.z(), std::sqrt(variance),
               mean(phases.with, reversals),
               mean(phases.with, [](const Trial& t) { return 1.0 * t.contact.samples; }),
               without.x(), without.y(), without.z(), mean(phases.without, reversals)});
  }
  return table;
}

}  // namespace

void run_paper_fit(const BenchOptions& options) {
  std::vector<Experiment> statements = experiments();
  constexpr int kPhases = 20;
  std::vector<Phases> sensitivity;
  if (!options.is_quick) sensitivity = phases_of_all(kPhases);
  std::vector<Trial*> trials;
  trials.reserve(trials.size() + statements.size());
  for (Experiment& row : statements) trials.push_back(&row.trial);
  for (Phases& phases : sensitivity) {
    for (Trial& trial : phases.with) trials.push_back(&trial);
    for (Trial& trial : phases.without) trials.push_back(&trial);
  }
  compute(trials);

  const Table rows = statements_table(statements);
  std::printf("The statements of the paper, and the fit (samples at 50 Hz from the start):\n%s\n",
              rows.text().c_str());
  nlohmann::ordered_json json;
  json["statements"] = rows.json();
  for (const Experiment& row : statements) {
    std::printf("%s:\n  %s\n", row.label, row.trial.command().c_str());
    json["commands"][row.label] = row.trial.command();
  }
  if (!sensitivity.empty()) {
    const Table table = sensitivity_table(sensitivity);
    std::printf(
        "Rigid tissue, one parameter changed; means of 20 starting times within 20 ms:\n%s\n",
        table.text().c_str());
    json["sensitivity"] = table.json();
  }
  write_table(options, rows.csv());
  write_json(options, json);
}

}  // namespace palpate::bench
