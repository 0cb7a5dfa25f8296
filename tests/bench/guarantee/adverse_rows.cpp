// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/guarantee/adverse_rows.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

namespace palpate::bench {
namespace {

/// A run fails below this true energy: more than the rounding of the inner steps.
constexpr double kNegativeJoule = -1e-6;

void add_mean(double value, double& sum, int& runs) {
  if (std::isnan(value)) return;
  sum += value;
  ++runs;
}

double mean_percent(double sum, int runs) { return runs > 0 ? 100.0 * sum / runs : kNaN; }

}  // namespace

void append(std::vector<std::string>& overrides, const std::vector<std::string>& more) {
  overrides.insert(overrides.end(), more.begin(), more.end());
}

std::vector<std::string> overrides_of(const Friction& friction, const ProfileError& error) {
  const double ratio = error.ratio;
  const auto isotropic = [](const std::string& path, double scale) {
    return std::vector<std::string>{fmt::format("{}.viscous_newton_s_per_m={}", path, 0.1 * scale),
                                    fmt::format("{}.coulomb_newton={}", path, 0.1 * scale)};
  };
  const auto per_axis = [](const std::string& path, double x, double y, double z) {
    const std::string axes = fmt::format("{{ x: {} y: {} z: {} }}", x, y, z);
    return std::vector<std::string>{
        fmt::format("{}.viscous_per_axis_newton_s_per_m={}", path, axes),
        fmt::format("{}.coulomb_per_axis_newton={}", path, axes)};
  };
  std::vector<std::string> overrides;
  const auto add = [&](const std::vector<std::string>& more) { append(overrides, more); };
  if (friction.is_per_axis) {
    add(per_axis("device.simulated", 0.05, 0.1, 0.2));
    add(error.is_other_kind ? isotropic("device.profile", 0.35 / 3.0 / 0.1)
                            : per_axis("device.profile", 0.05 * ratio, 0.1 * ratio, 0.2 * ratio));
  } else {
    add(isotropic("device.simulated", 1.0));
    add(error.is_other_kind ? per_axis("device.profile", 0.1, 0.1, 0.1)
                            : isotropic("device.profile", ratio));
  }
  return overrides;
}

void Summary::add(const test::AdverseResult& result) {
  const RunStatistics& s = result.statistics;
  ++seeds;
  if (s.minimum_true_energy_joule() < kNegativeJoule) ++negative;
  least_joule = std::min(least_joule, s.minimum_true_energy_joule());
  peak_newton = std::max(peak_newton, s.maximum_force_newton());
  largest_jump_newton = std::max(largest_jump_newton, result.device.largest_jump_newton);
  longest_fallback_s = std::max(longest_fallback_s, s.longest_fallback_s());
  top_speed_m_per_s = std::max(top_speed_m_per_s, result.top_speed_m_per_s);
  too_fast_ticks += result.mofc.too_fast_ticks;
  monitor_reductions += result.device.monitor_reductions;
  ledger_excesses += result.device.ledger_excesses;
  add_mean(s.vector_transparency(), transparency_sum, transparency_runs);
  add_mean(s.clamp_ratio(), clamped_sum, clamped_runs);
}

double Summary::transparency_percent() const {
  return mean_percent(transparency_sum, transparency_runs);
}

double Summary::clamped_percent() const { return mean_percent(clamped_sum, clamped_runs); }

void run_rows(std::vector<AdverseRow>& rows, int seeds, const Shard& shard) {
  std::size_t row = 0;
  std::erase_if(rows, [&](const AdverseRow&) { return !shard.has(row++); });
  in_parallel(rows.size(), [&](std::size_t i) {
    for (int seed = 1; seed <= seeds; ++seed) {
      rows[i].summary.add(test::run_adverse(rows[i].run, static_cast<std::uint64_t>(seed)));
    }
  });
}

Table table_of(const std::vector<AdverseRow>& rows, const std::string& label,
               const std::vector<Table::Column>& variant, const std::vector<Table::Column>& more,
               const std::function<std::vector<Table::Cell>(const AdverseRow&)>& more_cells) {
  std::vector<Table::Column> columns{{label, label, ""}, {"friction", "friction", ""}};
  columns.insert(columns.end(), variant.begin(), variant.end());
  columns.insert(columns.end(), {{"seeds", "seeds", "{:.0f}"},
                                 {"negative_runs", "below −1 µJ", "{:.0f}"},
                                 {"min_true_energy_uj", "min energy µJ", "{:.1f}"},
                                 {"peak_force_n", "peak N", "{:.2f}"}});
  columns.insert(columns.end(), more.begin(), more.end());
  Table table(std::move(columns));
  const AdverseRow* last = nullptr;
  for (const AdverseRow& row : rows) {
    if (last != nullptr && row.label != last->label) table.add_gap();
    last = &row;
    const Summary& s = row.summary;
    std::vector<Table::Cell> cells{row.label, std::string(row.friction->label)};
    cells.insert(cells.end(), row.variant.begin(), row.variant.end());
    cells.insert(cells.end(), {static_cast<double>(s.seeds), static_cast<double>(s.negative),
                               1e6 * s.least_joule, s.peak_newton});
    const std::vector<Table::Cell> others = more_cells(row);
    cells.insert(cells.end(), others.begin(), others.end());
    table.add(std::move(cells));
  }
  return table;
}

void in_parallel(std::size_t jobs, const std::function<void(std::size_t)>& job) {
  Steps steps(jobs);
  std::atomic<std::size_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < jobs; i = next++) {
        job(i);
        steps.next();
      }
    } catch (...) {
      const std::lock_guard lock(failure_mutex);
      failure = std::current_exception();
      next = jobs;
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

}  // namespace palpate::bench
