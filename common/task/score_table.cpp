// SPDX-License-Identifier: Apache-2.0
#include "common/task/score_table.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "common/core/user/utf8.h"
#include "common/telemetry/csv_writer.h"
#include "common/telemetry/summary.h"

namespace palpate {
namespace {

constexpr double kNormal95 = 1.959964;  // two-sided quantile of the normal distribution

/// Of the score interval; `sign` −1 or 1.
double wilson(std::uint64_t hits, std::uint64_t cases, double sign) {
  if (cases == 0) return kNotKnown;
  const auto n = static_cast<double>(cases);
  const double p = static_cast<double>(hits) / n;
  const double z2 = kNormal95 * kNormal95;
  const double middle = p + z2 / (2.0 * n);
  const double half = kNormal95 * std::sqrt(p * (1.0 - p) / n + z2 / (4.0 * n * n));
  return std::clamp((middle + sign * half) / (1.0 + z2 / n), 0.0, 1.0);
}

std::string share_text(const CountedShare& share) {
  if (share.cases == 0) return "no case";
  return fmt::format("{} of {}, {:.0f} % (95 % interval {:.0f} … {:.0f} %)", share.hits,
                     share.cases, 100.0 * share.ratio(), 100.0 * share.low(), 100.0 * share.high());
}

nlohmann::ordered_json share_json(const CountedShare& share) {
  return {{"hits", share.hits},
          {"cases", share.cases},
          {"ratio", number_or_null(share.ratio())},
          {"low", number_or_null(share.low())},
          {"high", number_or_null(share.high())}};
}

/// In CSV; empty where it is not known, as R's NA.
std::string csv_number(double value) {
  return std::isfinite(value) ? fmt::format("{:.9g}", value) : "";
}

/// The last column of a table.
std::string outcome_text(const TaskScore& score) {
  std::string outcome = outcome_of(score);
  if (score.is_cut) return outcome.empty() ? "breaks off" : outcome + ", breaks off";
  if (score.traction) {
    return outcome + fmt::format(", {:.1f} s at the target", score.traction->longest_s);
  }
  if (!score.needle || !(score.needle->overshoot_m > 0.0)) return outcome;
  return outcome + fmt::format(", {:.1f} mm behind", 1e3 * score.needle->overshoot_m);
}

/// Of a needle; empty without.
std::string needle_cells(const std::optional<NeedleScore>& needle) {
  if (!needle) return ",,,,,,";
  std::string cells;
  for (const double value :
       {needle->layers[needle->membrane].punctured_after_s, needle->told_after_s,
        needle->depth_most_m, needle->sideways_m, needle->overshoot_m, needle->end_behind_m}) {
    cells += ',' + csv_number(value);
  }
  return cells;
}

/// Of a traction; empty without.
std::string traction_cells(const std::optional<TractionScore>& traction) {
  if (!traction) return ",,,,,,,,,,,,,";
  std::string cells;
  for (const double value : {traction->held_after_s, traction->reached_after_s,
                             traction->done_after_s, traction->torn_after_s, traction->longest_s,
                             traction->within_ratio(), traction->retraction_m}) {
    cells += ',' + csv_number(value);
  }
  return cells +
         fmt::format(",{},{},{},{},", traction->grips, traction->tears, traction->slips,
                     traction->slipped_out) +
         csv_number(traction->force.p95_newton) + fmt::format(",{}", traction->unknown_ticks);
}

/// The last four columns of a region.
std::string force_cells(const ForceFigures& force) {
  return csv_number(force.median_newton) + ',' + csv_number(force.p95_newton) + ',' +
         csv_number(force.most_newton) + ',' + csv_number(force.touch_s) + '\n';
}

std::string detection_text(const DetectionFigures& detection) {
  if (detection.runs == 0) return "";
  return fmt::format("  {:<20}{}\n  {:<20}{}\n  {:<20}{} in {} runs\n", "sensitivity",
                     share_text(detection.sensitivity), "specificity",
                     share_text(detection.specificity), "false alarms", detection.false_alarms,
                     detection.runs);
}

}  // namespace

double CountedShare::ratio() const {
  return cases > 0 ? static_cast<double>(hits) / static_cast<double>(cases) : kNotKnown;
}
double CountedShare::low() const { return wilson(hits, cases, -1.0); }
double CountedShare::high() const { return wilson(hits, cases, 1.0); }

std::vector<std::string> short_names(const std::vector<NamedScore>& scores) {
  std::set<std::string> paths;
  std::size_t longest = 1;  // components
  for (const NamedScore& one : scores) {
    paths.insert(one.run);
    const std::filesystem::path path(one.run);
    longest = std::max(longest, static_cast<std::size_t>(std::distance(path.begin(), path.end())));
  }
  std::vector<std::string> names;
  for (std::size_t components = 1; components <= longest; ++components) {
    names.clear();
    for (const NamedScore& one : scores) {
      std::filesystem::path rest(one.run);
      std::filesystem::path name;
      for (std::size_t i = 0; i < components && rest.has_filename(); ++i) {
        name = name.empty() ? rest.filename() : rest.filename() / name;
        rest = rest.parent_path();
      }
      names.push_back(name.string());
    }
    if (std::set<std::string>(names.begin(), names.end()).size() == paths.size()) break;
  }
  return names;
}

DetectionFigures detection_of(const std::vector<NamedScore>& scores) {
  DetectionFigures figures;
  for (const NamedScore& one : scores) {
    const TaskScore& score = one.score;
    if (!score.is_search() || score.end == TaskScore::End::kNotStarted || score.is_cut ||
        !score.is_judged()) {
      continue;
    }
    ++figures.runs;
    figures.false_alarms += score.count(MarkScore::Outcome::kFalseAlarm);
    figures.sensitivity.hits += score.count(TargetScore::Outcome::kFound);
    figures.sensitivity.cases += score.targets.size();
    if (!score.targets.empty()) continue;
    ++figures.specificity.cases;
    if (score.marks.empty()) ++figures.specificity.hits;
  }
  return figures;
}

std::string outcome_of(const TaskScore& score) {
  if (!score.is_judged()) return "not_judged";
  if (score.needle) return name(score.needle->outcome());
  return score.traction ? name(score.traction->outcome()) : "";
}

std::string table_text(const std::vector<NamedScore>& scores) {
  std::size_t width = 3;
  const bool has_outcome = std::any_of(scores.begin(), scores.end(), [](const NamedScore& one) {
    return !outcome_text(one.score).empty();
  });
  const std::vector<std::string> names = short_names(scores);
  for (const std::string& name : names) width = std::max(width, name.size());
  std::string text =
      fmt::format("{:<{}}  {:>7} {:>7} {:>7} {:>7} {:>8} {:>7} {:>7} {:>7} {:>7} {:>8} {:>8}{}\n",
                  "run", width, "found", "guessed", "alarms", "time s", "cover %", "F50 N", "F95 N",
                  "Fmax N", "path m", "beyond N", "missing%", has_outcome ? "  outcome" : "");
  for (std::size_t i = 0; i < scores.size(); ++i) {
    const TaskScore& s = scores[i].score;
    const bool has_finds = s.is_search() && s.is_judged();
    const bool has_marks = (s.is_search() || s.needle) && s.is_judged();
    text += fmt::format(
        "{:<{}}  {:>7} {:>7} {:>7} {:>7} {:>8} {:>7} {:>7} {:>7} {:>7} {:>8} {:>8}{}\n", names[i],
        width,
        has_finds ? fmt::format("{}/{}", s.count(TargetScore::Outcome::kFound), s.targets.size())
                  : "–",
        has_finds ? std::to_string(s.count(TargetScore::Outcome::kGuessed)) : "–",
        has_marks ? std::to_string(s.count(MarkScore::Outcome::kFalseAlarm)) : "–",
        figure(s.time_s, "{:.1f}"), figure(100.0 * s.coverage_ratio, "{:.1f}"),
        figure(s.force.median_newton, "{:.2f}"), figure(s.force.p95_newton, "{:.2f}"),
        figure(s.force.most_newton, "{:.2f}"), figure(s.path_m, "{:.3f}"),
        figure(s.overshoot_newton, "{:.2f}"), figure(100.0 * s.missing_ratio(), "{:.2f}"),
        has_outcome ? "  " + outcome_text(s) : "");
  }
  return text + detection_text(detection_of(scores));
}

std::string compared_text(const std::vector<NamedScore>& scores) {
  constexpr std::size_t kGap = 2;
  std::vector<std::string> labels;
  std::vector<std::vector<std::string>> columns;
  for (const NamedScore& one : scores) {
    std::vector<std::string>& column = columns.emplace_back();
    const auto figures = figures_of(one.score);
    for (const auto& [label, value] : figures) {
      if (std::find(labels.begin(), labels.end(), label) == labels.end()) labels.push_back(label);
    }
    for (const std::string& label : labels) {
      const auto figure = std::find_if(figures.begin(), figures.end(),
                                       [&](const auto& each) { return each.first == label; });
      column.push_back(figure == figures.end() ? "–" : figure->second);
    }
  }
  for (std::vector<std::string>& column : columns) column.resize(labels.size(), "–");
  columns.insert(columns.begin(), labels);
  std::vector<std::string> heads = short_names(scores);
  heads.insert(heads.begin(), "");
  std::vector<std::string> lines(1 + labels.size());
  for (std::size_t k = 0; k < columns.size(); ++k) {
    std::size_t width = columns_of(heads[k]);
    for (const std::string& cell : columns[k]) width = std::max(width, columns_of(cell));
    lines[0] += fmt::format("{:<{}}", heads[k], width + kGap);
    for (std::size_t i = 0; i < labels.size(); ++i) {
      lines[i + 1] += fmt::format("{:<{}}", columns[k][i], width + kGap);
    }
  }
  std::string text;
  for (const std::string& line : lines) text += line + '\n';
  return text;
}

std::string table_csv(const std::vector<NamedScore>& scores) {
  std::string csv =
      "run,kind,end,is_cut,targets,found,guessed,missed,false_alarms,time_s,coverage_ratio,force_"
      "median_n,"
      "force_p95_n,force_most_n,touch_s,depth_p95_m,depth_most_m,path_m,smoothness,overshoot_n,"
      "beyond_s,damage_n_s,missing_ratio,outcome,punctured_after_s,told_after_s,insertion_depth_m,"
      "sideways_m,overshoot_m,end_behind_m,held_after_s,reached_after_s,done_after_s,torn_after_s,"
      "longest_s,within_ratio,retraction_m,grips,tears,slips,slipped_out,force_held_p95_n,"
      "unknown_grip_ticks\n";
  for (const NamedScore& one : scores) {
    const TaskScore& s = one.score;
    csv +=
        fmt::format("{},{},{},{},", csv_cell(one.run), name(s.kind), name(s.end), s.is_cut ? 1 : 0);
    csv += s.is_search() && s.is_judged() ? fmt::format("{},{},{},{},", s.targets.size(),
                                                        s.count(TargetScore::Outcome::kFound),
                                                        s.count(TargetScore::Outcome::kGuessed),
                                                        s.count(TargetScore::Outcome::kMissed))
                                          : ",,,,";
    const bool has_marks = s.is_search() || s.needle;
    csv += has_marks && s.is_judged() ? fmt::format("{},", s.count(MarkScore::Outcome::kFalseAlarm))
                                      : ",";
    const auto add = [&](double value, char after) { csv += csv_number(value) + after; };
    for (const double value :
         {s.time_s, s.coverage_ratio, s.force.median_newton, s.force.p95_newton,
          s.force.most_newton, s.force.touch_s, s.depth_p95_m, s.depth_most_m, s.path_m,
          s.smoothness, s.overshoot_newton, s.beyond_s, s.damage_newton_s}) {
      add(value, ',');
    }
    add(s.missing_ratio(), ',');
    csv += outcome_of(s) + needle_cells(s.needle) + traction_cells(s.traction) + '\n';
  }
  return csv;
}

std::string regions_csv(const std::vector<NamedScore>& scores) {
  std::string csv =
      "run,region,outcome,found_after_s,mark_distance_m,palpable_n,contrast_ratio,punctures,"
      "punctured_after_s,puncture_depth_m,puncture_n,beyond_s,damage_n_s,force_median_n,"
      "force_p95_n,force_most_n,touch_s\n";
  for (const NamedScore& one : scores) {
    const std::string run = csv_cell(one.run);
    for (const TargetScore& target : one.score.targets) {
      csv += fmt::format("{},{},{},{},{},{},{},,,,,,,", run, csv_cell(target.name),
                         outcome_of(one.score, target), csv_number(target.found_after_s),
                         csv_number(target.mark_distance_m), csv_number(target.palpable_newton),
                         csv_number(target.contrast_ratio)) +
             force_cells(target.force);
    }
    if (one.score.is_search()) {
      csv += run + ",elsewhere,,,,,,,,,,,," + force_cells(one.score.elsewhere);
    }
    for (const TissueDamage& tissue : one.score.tissues) {
      const char* const outcome = !tissue.is_seen                 ? ""
                                  : tissue.is_damaged()           ? "damaged"
                                  : tissue.overshoot_newton > 0.0 ? "beyond"
                                                                  : "within";
      csv += fmt::format("{},{},{},,,,,,,,,{},{},", run, csv_cell(tissue.name), outcome,
                         csv_number(tissue.beyond_s), csv_number(tissue.damage_newton_s)) +
             force_cells(tissue.force);
    }
    if (!one.score.needle) continue;
    for (const LayerScore& layer : one.score.needle->layers) {
      csv += fmt::format("{},{},{},,,,,{},{},{},{},,,", run, csv_cell(layer.name),
                         layer.is_spared ? "spared" : "", layer.punctures,
                         csv_number(layer.punctured_after_s), csv_number(layer.puncture_depth_m),
                         csv_number(layer.puncture_newton)) +
             force_cells(layer.force);
    }
  }
  return csv;
}

nlohmann::ordered_json table_json(const std::vector<NamedScore>& scores) {
  nlohmann::ordered_json json;
  for (const NamedScore& one : scores) json["runs"][one.run] = score_json(one.score);
  const DetectionFigures detection = detection_of(scores);
  json["detection"] = {{"sensitivity", share_json(detection.sensitivity)},
                       {"specificity", share_json(detection.specificity)},
                       {"runs", detection.runs},
                       {"false_alarms", detection.false_alarms}};
  return json;
}

}  // namespace palpate
