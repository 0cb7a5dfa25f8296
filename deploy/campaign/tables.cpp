// SPDX-License-Identifier: Apache-2.0
#include "deploy/campaign/tables.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "common/telemetry/csv_writer.h"

namespace palpate::campaign {
namespace {

/// A number as a number, so that programs need not convert it.
nlohmann::ordered_json json_value(const std::string& label) {
  double number = 0.0;
  const char* const last = label.data() + label.size();
  const auto [stop, error] = std::from_chars(label.data(), last, number);
  if (error == std::errc() && stop == last && std::isfinite(number)) return number;
  return label;
}

bool is_set(const Bounds& bounds, double value) {
  return !std::isnan(value) && (bounds.at_least || bounds.at_most);
}

/// How far inside the bounds; negative outside.
double margin(const Bounds& bounds, double value) {
  double margin = std::numeric_limits<double>::infinity();
  if (bounds.at_least) margin = std::min(margin, value - *bounds.at_least);
  if (bounds.at_most) margin = std::min(margin, *bounds.at_most - value);
  return margin;
}

/// Calls `take` with each run and its figures.
template <class Take>
void for_each_run(const Results& results, Take take) {
  for (std::uint64_t run = 0; run < results.needed(); ++run) {
    if (results.has(run)) take(run, results.figures(run));
  }
}

std::string statistics_line(const Campaign& campaign, const Results& results, std::size_t index) {
  struct Extreme {
    double value = kNaN;
    std::uint64_t run = 0;
  } least, greatest;
  double sum = 0.0;
  std::uint64_t count = 0;
  for_each_run(results, [&](std::uint64_t run, std::span<const double> figures) {
    const double value = figures[index];
    if (std::isnan(value)) return;
    if (count == 0 || value < least.value) least = {value, run};
    if (count == 0 || value > greatest.value) greatest = {value, run};
    sum += value;
    ++count;
  });
  const char* const name = campaign.quantities[index]->name;
  if (count == 0) return fmt::format("  {:<24}not known in any run\n", name);
  return fmt::format("  {:<24}{:.6g} (run {}) … {:.6g} (run {}), mean {:.6g}\n", name, least.value,
                     least.run, greatest.value, greatest.run, sum / static_cast<double>(count));
}

std::string limit_text(const Campaign& campaign, const Results& results, const Limit& limit) {
  std::uint64_t judged = 0;
  std::uint64_t violating = 0;
  double least = std::numeric_limits<double>::infinity();
  std::uint64_t worst = 0;
  for_each_run(results, [&](std::uint64_t run, std::span<const double> figures) {
    const double value = figures[limit.bounds.quantity];
    if (!limit.applies(figures) || !is_set(limit.bounds, value)) return;
    ++judged;
    if (limit.is_violated(figures)) ++violating;
    if (margin(limit.bounds, value) < least) {
      least = margin(limit.bounds, value);
      worst = run;
    }
  });
  std::string text = fmt::format("  {}: {} of {} runs violate it",
                                 limit.bounds.text(campaign.quantities), violating, judged);
  for (std::size_t i = 0; i < limit.where.size(); ++i) {
    text += (i == 0 ? "; judged where " : ", ") + limit.where[i].text(campaign.quantities);
  }
  if (judged == 0) return text + "\n";
  const Plan plan = plan_of(campaign, worst);
  return text + fmt::format("; worst {:.6g}: run {}, seed {}\n    {}\n",
                            results.figures(worst)[limit.bounds.quantity], worst, plan.seed,
                            command_line(campaign, plan));
}

}  // namespace

std::string csv_text(const Campaign& campaign, const Results& results) {
  std::string text = "run,seed";
  for (const Dimension& dimension : campaign.dimensions)
    text += fmt::format(",{}", csv_cell(dimension.name));
  for (const Quantity* quantity : campaign.quantities) text += fmt::format(",{}", quantity->name);
  text += ",violates\n";
  for_each_run(results, [&](std::uint64_t run, std::span<const double> figures) {
    const Plan plan = plan_of(campaign, run);
    text += fmt::format("{},{}", run, plan.seed);
    for (const std::string& label : plan.labels) text += fmt::format(",{}", csv_cell(label));
    for (const double figure : figures) {
      text += std::isfinite(figure) ? fmt::format(",{}", figure) : std::string(",");
    }
    text += campaign.is_violated(figures) ? ",1\n" : ",0\n";
  });
  return text;
}

std::string json_lines(const Campaign& campaign, const Results& results) {
  std::string text;
  for_each_run(results, [&](std::uint64_t run, std::span<const double> figures) {
    const Plan plan = plan_of(campaign, run);
    nlohmann::ordered_json row{{"run", run}, {"seed", plan.seed}};
    for (std::size_t i = 0; i < plan.labels.size(); ++i) {
      row[campaign.dimensions[i].name] = json_value(plan.labels[i]);
    }
    for (std::size_t i = 0; i < figures.size(); ++i) {
      row[campaign.quantities[i]->name] = number_or_null(figures[i]);
    }
    row["violates"] = campaign.is_violated(figures);
    text += row.dump() + "\n";
  });
  return text;
}

std::string summary_text(const Campaign& campaign, const Results& results) {
  std::string text =
      fmt::format("{}: {} runs of {:g} s, {} cell{}\n", campaign.name, results.known(),
                  campaign.seconds, campaign.cells(), campaign.cells() == 1 ? "" : "s");
  if (results.needed() < campaign.run_count()) {
    text +=
        fmt::format("  ended at run {}, the first that violates a limit\n", results.needed() - 1);
  }
  for (std::size_t i = 0; i < campaign.reported; ++i) {
    text += statistics_line(campaign, results, i);
  }
  for (const Limit& limit : campaign.limits) text += limit_text(campaign, results, limit);
  return text;
}

std::uint64_t violations(const Campaign& campaign, const Results& results) {
  std::uint64_t count = 0;
  for_each_run(results, [&](std::uint64_t, std::span<const double> figures) {
    if (campaign.is_violated(figures)) ++count;
  });
  return count;
}

std::vector<std::uint64_t> worst_runs(const Campaign& campaign, const Results& results,
                                      std::size_t count) {
  if (campaign.limits.empty()) return {};
  const Limit& limit = campaign.limits.front();
  std::vector<std::pair<double, std::uint64_t>> order;
  for_each_run(results, [&](std::uint64_t run, std::span<const double> figures) {
    const double value = figures[limit.bounds.quantity];
    if (!limit.applies(figures) || std::isnan(value)) return;
    order.emplace_back(margin(limit.bounds, value), run);
  });
  const std::size_t kept = std::min(count, order.size());
  std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(kept), order.end());
  std::vector<std::uint64_t> runs;
  for (std::size_t i = 0; i < kept; ++i) runs.push_back(order[i].second);
  return runs;
}

}  // namespace palpate::campaign
