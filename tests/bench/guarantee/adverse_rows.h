// SPDX-License-Identifier: Apache-2.0
// adverse_rows.h — rows of guarantee_bench: adverse runs over several seeds, and the columns that
// tables of them share.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "tests/bench/bench_output.h"
#include "tests/support/adversity.h"

namespace palpate::bench {

struct Mode {
  const char* label;
  std::vector<std::string> overrides;
};
inline const Mode kNone{"none", {"mofc.controller=none", "device.monitor=off"}};
inline const Mode kPaper{"paper", {"mofc.mode=paper", "device.monitor=off"}};
inline const Mode kPaperIsotropic{
    "paper/√3",
    {"mofc.mode=paper", "mofc.paper_settings.friction=isotropic", "device.monitor=off"}};
inline const Mode kVector{"vector", {"mofc.mode=vector"}};
inline const Mode kGuard{"guard", {"mofc.mode=guard"}};

/// Of the simulated device; the profile agrees with it unless ProfileError says otherwise.
struct Friction {
  const char* label;
  bool is_per_axis;
  std::vector<const Mode*> modes;  // the first one is the run without a controller
};
inline const Friction kFrictions[] = {
    {"isotropic", false, {&kNone, &kPaper, &kPaperIsotropic, &kVector, &kGuard}},
    {"per axis", true, {&kNone, &kPaper, &kVector, &kGuard}}};

/// How the friction profile differs from the device.
struct ProfileError {
  double ratio = 1.0;          // friction of the profile / true friction
  bool is_other_kind = false;  // the profile says isotropic for per axis (the mean), or vice versa
};

/// 0.1 N·s/m and 0.1 N, or a half and twice that on two of the axes.
[[nodiscard]] std::vector<std::string> overrides_of(const Friction& friction,
                                                    const ProfileError& error);

/// The worst and the mean of the seeds of one row.
struct Summary {
  int seeds = 0;
  int negative = 0;
  double least_joule = 0.0;
  double peak_newton = 0.0;
  double largest_jump_newton = 0.0;
  double longest_fallback_s = 0.0;
  double top_speed_m_per_s = 0.0;
  std::uint64_t too_fast_ticks = 0;
  std::uint64_t monitor_reductions = 0;
  std::uint64_t ledger_excesses = 0;
  double transparency_sum = 0.0;
  int transparency_runs = 0;
  double clamped_sum = 0.0;
  int clamped_runs = 0;

  void add(const test::AdverseResult& result);
  [[nodiscard]] double transparency_percent() const;
  [[nodiscard]] double clamped_percent() const;
};

struct AdverseRow {
  std::string label;
  const Friction* friction;
  std::vector<std::string> variant;  ///< what else distinguishes it, one cell each
  test::AdverseRun run;
  Summary summary = {};
};

/// Keeps the rows of `shard` and runs seeds 1 … `seeds` of each.
void run_rows(std::vector<AdverseRow>& rows, int seeds, const Shard& shard);

/// Label, friction, the variant's cells; then seeds, negative runs, least energy and peak; then
/// `more_cells`. A gap before each other label.
[[nodiscard]] Table table_of(
    const std::vector<AdverseRow>& rows, const std::string& label,
    const std::vector<Table::Column>& variant, const std::vector<Table::Column>& more,
    const std::function<std::vector<Table::Cell>(const AdverseRow&)>& more_cells);

/// Runs all jobs on as many threads as there are processors; rethrows an exception of a job.
void in_parallel(std::size_t jobs, const std::function<void(std::size_t)>& job);

/// Appends `more` to `overrides`.
void append(std::vector<std::string>& overrides, const std::vector<std::string>& more);

}  // namespace palpate::bench
