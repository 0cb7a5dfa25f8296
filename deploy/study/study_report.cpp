// SPDX-License-Identifier: Apache-2.0
#include "deploy/study/study_report.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numeric>
#include <vector>

#include "common/telemetry/csv_writer.h"
#include "deploy/study/order.h"
#include "deploy/study/staircase.h"

namespace palpate::study {
namespace {

/// Two-sided 97.5 % quantile of Student's t; beyond 30 degrees of freedom that of the normal
/// distribution with the next term of its expansion.
double student_975(std::size_t freedom) {
  constexpr std::array<double, 30> kTable{12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306,
                                          2.262,  2.228, 2.201, 2.179, 2.160, 2.145, 2.131, 2.120,
                                          2.110,  2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064,
                                          2.060,  2.056, 2.052, 2.048, 2.045, 2.042};
  if (freedom >= 1 && freedom <= kTable.size()) return kTable[freedom - 1];
  constexpr double kZ = 1.959964;
  return kZ + (kZ * kZ * kZ + kZ) / (4.0 * static_cast<double>(freedom));
}

struct ConditionFigures {
  std::size_t trials = 0;
  std::size_t participants = 0;
  std::vector<double> log_thresholds{};
  bool has_short_staircase = false;  ///< one has ended with too few reversals for a threshold
  std::size_t beyond_range = 0;      ///< so many have ended at the largest difference
};

/// Of those that have one.
std::string mean_threshold_text(const ConditionFigures& figures) {
  const std::vector<double>& logs = figures.log_thresholds;
  if (logs.empty()) {
    return figures.has_short_staircase ? "not known: too few reversals within most_trials"
                                       : "not known yet";
  }
  double mean = 0.0;
  for (const double one : logs) mean += one / static_cast<double>(logs.size());
  const std::string middle = fmt::format("{:.1f} %", 100.0 * std::exp(mean));
  if (logs.size() == 1) return middle + " (one participant)";
  if (logs.size() == 2) return middle + " (2 participants, too few for an interval)";
  double squares = 0.0;
  for (const double one : logs) squares += (one - mean) * (one - mean);
  const auto n = static_cast<double>(logs.size());
  const double half = student_975(logs.size() - 1) * std::sqrt(squares / (n - 1.0) / n);
  return fmt::format("{} (95 % interval {:.1f} … {:.1f} %, {} participants)", middle,
                     100.0 * std::exp(mean - half), 100.0 * std::exp(mean + half), logs.size());
}

std::string threshold_text(const ConditionFigures& figures, double most_ratio) {
  if (figures.beyond_range == 0) return mean_threshold_text(figures);
  const std::string beyond =
      fmt::format("beyond the range of the staircase ({:.4g} %)", 100.0 * most_ratio);
  const std::string who =
      fmt::format("of {} participant{}", figures.beyond_range, figures.beyond_range > 1 ? "s" : "");
  if (figures.log_thresholds.empty()) return fmt::format("{}, {}", beyond, who);
  return fmt::format("{}; {} it lies {}, so the mean without them is too low",
                     mean_threshold_text(figures), who, beyond);
}

}  // namespace

std::string table_csv(const Plan& plan, const Folder& folder, bool is_open) {
  std::string csv = (is_open ? "condition," : "") + Folder::header();
  const std::vector<std::string>& codes = folder.key().codes;
  std::map<std::string, std::string> names;
  for (std::size_t i = 0; i < codes.size(); ++i) {
    names[codes[i]] = csv_cell(plan.conditions[i].name);
  }
  for (const std::uint64_t participant : folder.participants()) {
    for (const TrialRow& row : folder.rows(participant)) {
      csv += (is_open ? names[row.code] + "," : "") + row.cells;
    }
  }
  return csv;
}

std::string summary_text(const Plan& plan, const Folder& folder, bool is_open) {
  std::vector<ConditionFigures> figures(plan.conditions.size());
  const std::vector<std::uint64_t> participants = folder.participants();
  for (const std::uint64_t participant : participants) {
    Series series(plan, folder.key().square, participant);
    for (const TrialRow& row : folder.rows(participant)) {
      const auto trial = series.next();
      if (!trial) break;
      ConditionFigures& condition = figures[trial->condition];
      ++condition.trials;
      if (trial->in_block == 0) ++condition.participants;
      series.take(row.is_right);
    }
    for (std::size_t i = 0; i < series.staircases().size(); ++i) {
      const Staircase& staircase = series.staircases()[i];
      const double threshold = staircase.threshold_ratio();
      if (!staircase.is_done()) continue;
      ConditionFigures& condition = figures[series.order()[i]];
      if (staircase.is_beyond_range()) {
        ++condition.beyond_range;
      } else if (std::isfinite(threshold)) {
        condition.log_thresholds.push_back(std::log(threshold));
      } else {
        condition.has_short_staircase = true;
      }
    }
  }
  std::string text = fmt::format("{}: {} {}participants\n", plan.name, participants.size(),
                                 folder.is_simulated() ? "simulated " : "");
  const std::vector<std::string>& codes = folder.key().codes;
  std::vector<std::size_t> order(figures.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  // the order of the plan would tell what the codes hide
  if (!is_open) {
    std::sort(order.begin(), order.end(),
              [&](std::size_t a, std::size_t b) { return codes[a] < codes[b]; });
  }
  for (const std::size_t i : order) {
    const ConditionFigures& one = figures[i];
    text += fmt::format("  {:<24} {} trials of {} participants",
                        is_open ? plan.conditions[i].name : codes[i], one.trials, one.participants);
    if (plan.staircase) text += "; threshold " + threshold_text(one, plan.staircase->most_ratio);
    text += '\n';
  }
  return text;
}

}  // namespace palpate::study
