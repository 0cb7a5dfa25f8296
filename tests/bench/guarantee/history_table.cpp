// SPDX-License-Identifier: Apache-2.0
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "common/session/session_file.h"
#include "deploy/lockstep/loopback.h"
#include "tests/bench/guarantee/adverse_rows.h"
#include "tests/bench/guarantee/guarantee_tables.h"
#include "tests/support/machine/places.h"

namespace palpate::bench {
namespace {

/// Time for the V after the free motion, and for the hand to come to rest.
constexpr double kVSeconds = 3.0;

}  // namespace

Table history_table(bool is_quick, const std::vector<std::string>& more_overrides,
                    const Shard& shard) {
  constexpr std::size_t kLongPhases = 4;  // after 600 s
  constexpr std::size_t kPhases = 20;
  constexpr double kPhysicsPeriodSeconds = 0.02;
  struct Tissue {
    const char* label;
    const char* session;
  };
  constexpr Tissue kTissues[] = {
      {"soft", "paper_soft"}, {"rigid", "paper_rigid"}, {"mixed", "paper_mixed"}};
  struct Rates {
    const char* label;
    std::vector<std::string> overrides;
    std::size_t fewer;  // phases
  };
  const std::vector<std::string> fast{"device.rate_hz=1000", "device.lease_us=2000",
                                      "mofc.wait_for_physics_ms=0",
                                      "mofc.velocity_estimator={ kalman_acceleration {} }"};
  std::vector<std::string> fast_local = fast;
  fast_local.emplace_back("mofc.interaction=local");
  const Rates kRates[] = {
      {"1000/50", fast_local, 1}, {"1000/50 held", fast, 1}, {"50/50 held", {}, 4}};
  struct Row {
    const Tissue* tissue;
    const Rates* rates;
    const Mode* mode;
    double free_s;
    std::vector<RunStatistics> runs;
  };
  std::vector<Row> rows;
  std::size_t group = 0;
  for (const Rates& rates : kRates) {
    for (const Tissue& tissue : kTissues) {
      for (const Mode* mode : {&kPaper, &kGuard}) {
        if (!shard.has(group++)) continue;
        for (const double free_s : {0.0, 14.0, 40.0, 600.0}) {
          const bool is_long = free_s > 100.0;
          const std::size_t phases = (is_long ? kLongPhases : kPhases) / rates.fewer;
          const std::size_t quick_phases = is_long ? 1 : 5;
          rows.push_back({&tissue, &rates, mode, free_s,
                          std::vector<RunStatistics>(is_quick ? quick_phases : phases)});
        }
      }
    }
  }
  std::vector<std::pair<Row*, std::size_t>> jobs;
  for (Row& row : rows) {
    for (std::size_t phase = 0; phase < row.runs.size(); ++phase) jobs.emplace_back(&row, phase);
  }
  in_parallel(jobs.size(), [&](std::size_t i) {
    const std::size_t phase = jobs[i].second;
    Row& row = *jobs[i].first;
    const double free_s = row.free_s + kPhysicsPeriodSeconds * static_cast<double>(phase) /
                                           static_cast<double>(row.runs.size());
    const std::filesystem::path sessions =
        std::filesystem::path(test::source_dir()) / "deploy/sessions";
    std::vector<std::string> overrides = row.rates->overrides;
    append(overrides, row.mode->overrides);
    append(overrides, {fmt::format("hand.v.free_motion_s={}", free_s)});
    append(overrides, more_overrides);
    const Session session =
        load_session(sessions / (std::string(row.tissue->session) + ".txtpb"), overrides);
    row.runs[phase] = run_loopback(session, {.seconds = free_s + kVSeconds}).statistics;
  });

  Table table({{"rates_hz", "device/physics Hz", ""},
               {"tissue", "tissue", ""},
               {"mode", "mode", ""},
               {"t_free_s", "t_free s", "{:g}"},
               {"phases", "phases", "{:.0f}"},
               {"transparency_percent", "transp. %", "{:.2f}"},
               {"transparency_sd_percent", "± one run", "{:.2f}"},
               {"change_percent", "change %", "{:+.2f}"},
               {"change_error_percent", "± mean", "{:.2f}"},
               {"largest_change_percent", "one run %", "{:.1f}"},
               {"clamped_percent", "clamped %", "{:.1f}"},
               {"excess_reversals", "excess rev.", "{:.1f}"},
               {"change_excess_reversals", "change", "{:+.1f}"},
               {"most_excess_reversals", "most", "{:.0f}"},
               {"peak_force_n", "peak N", "{:.2f}"},
               {"min_true_energy_uj", "min energy µJ", "{:.1f}"}});
  struct Means {
    double transparency = 0.0;  // %
    double sd = 0.0;            // over the phases
    double phases = 0.0;
    double reversals = 0.0;
  };
  Means first;
  const Row* first_row = nullptr;
  for (const Row& row : rows) {
    Means m{.phases = static_cast<double>(row.runs.size())};
    double sum2 = 0.0;
    double clamped = 0.0;
    double most_reversals = 0.0;
    double peak_newton = 0.0;
    double least_joule = 0.0;
    for (const RunStatistics& s : row.runs) {
      const double transparency = 100.0 * s.vector_transparency();
      const auto excess = static_cast<double>(s.excess_reversals());
      m.transparency += transparency / m.phases;
      sum2 += transparency * transparency / m.phases;
      clamped += 100.0 * s.clamp_ratio() / m.phases;
      m.reversals += excess / m.phases;
      most_reversals = std::max(most_reversals, excess);
      peak_newton = std::max(peak_newton, s.maximum_force_newton());
      least_joule = std::min(least_joule, s.minimum_true_energy_joule());
    }
    m.sd = std::sqrt(std::max(0.0, sum2 - m.transparency * m.transparency));
    if (row.free_s == 0.0) {
      if (first_row != nullptr) table.add_gap();
      first = m;
      first_row = &row;
    }
    // each run against that at the same phase without history
    double largest_change = 0.0;
    const std::size_t stride = first_row->runs.size() / row.runs.size();
    for (std::size_t phase = 0; phase < row.runs.size(); ++phase) {
      const double before = first_row->runs[phase * stride].vector_transparency();
      const double change = row.runs[phase].vector_transparency() / before - 1.0;
      largest_change = std::max(largest_change, 100.0 * std::abs(change));
    }
    const double change_error =
        100.0 / first.transparency *
        std::hypot(first.sd / std::sqrt(first.phases), m.sd / std::sqrt(m.phases));
    table.add({std::string(row.rates->label), std::string(row.tissue->label),
               std::string(row.mode->label), row.free_s, m.phases, m.transparency, m.sd,
               100.0 * (m.transparency / first.transparency - 1.0),
               row.free_s == 0.0 ? kNaN : change_error, row.free_s == 0.0 ? kNaN : largest_change,
               clamped, m.reversals, m.reversals - first.reversals, most_reversals, peak_newton,
               1e6 * least_joule});
  }
  return table;
}

}  // namespace palpate::bench
