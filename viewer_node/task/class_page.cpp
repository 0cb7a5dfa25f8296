// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/task/class_page.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "common/telemetry/summary.h"
#include "viewer_node/recording/html/html_page.h"

namespace palpate {
namespace {

/// A column of the table.
struct Column {
  const char* title;
  std::function<std::string(const TaskScore&)> cell;
};

std::vector<Column> columns_of(const std::vector<NamedScore>& scores) {
  const auto any = [&](const auto& is) {
    return std::any_of(scores.begin(), scores.end(),
                       [&](const NamedScore& one) { return is(one.score); });
  };
  std::vector<Column> columns{{"task", [](const TaskScore& s) { return name(s.kind); }}};
  if (any([](const TaskScore& s) { return s.is_search(); })) {
    columns.push_back({"found", [](const TaskScore& s) {
                         if (!s.is_search() || !s.is_judged()) return std::string("–");
                         return fmt::format("{} of {}", s.count(TargetScore::Outcome::kFound),
                                            s.targets.size());
                       }});
    columns.push_back({"false alarms", [](const TaskScore& s) {
                         if (!s.is_search() || !s.is_judged()) return std::string("–");
                         return std::to_string(s.count(MarkScore::Outcome::kFalseAlarm));
                       }});
    columns.push_back({"searched, %", [](const TaskScore& s) {
                         return figure(100.0 * s.coverage_ratio, "{:.0f}");
                       }});
  }
  if (any([](const TaskScore& s) { return !outcome_of(s).empty(); })) {
    columns.push_back({"outcome", [](const TaskScore& s) {
                         std::string outcome = outcome_of(s);
                         std::replace(outcome.begin(), outcome.end(), '_', ' ');
                         return outcome.empty() ? std::string("–") : outcome;
                       }});
  }
  if (any([](const TaskScore& s) { return s.is_cut; })) {
    columns.push_back({"complete", [](const TaskScore& s) {
                         return std::string(s.is_cut ? "no: breaks off" : "yes");
                       }});
  }
  columns.push_back({"time, s", [](const TaskScore& s) { return figure(s.time_s, "{:.1f}"); }});
  columns.push_back({"force, median, N",
                     [](const TaskScore& s) { return figure(s.force.median_newton, "{:.2f}"); }});
  columns.push_back(
      {"force, 95 %, N", [](const TaskScore& s) { return figure(s.force.p95_newton, "{:.2f}"); }});
  columns.push_back(
      {"force, most, N", [](const TaskScore& s) { return figure(s.force.most_newton, "{:.2f}"); }});
  columns.push_back({"beyond the limit, N",
                     [](const TaskScore& s) { return figure(s.overshoot_newton, "{:.2f}"); }});
  columns.push_back({"path, m", [](const TaskScore& s) { return figure(s.path_m, "{:.3f}"); }});
  columns.push_back({"telemetry missing, %", [](const TaskScore& s) {
                       return figure(100.0 * s.missing_ratio(), "{:.2f}");
                     }});
  return columns;
}

std::string share_row(const char* what, const CountedShare& share, const char* of) {
  const std::string value =
      share.cases == 0 ? "no case"
                       : fmt::format("{:.0f} %: {} of {} {}; 95 % interval {:.0f} … {:.0f} %",
                                     100.0 * share.ratio(), share.hits, share.cases, of,
                                     100.0 * share.low(), 100.0 * share.high());
  return fmt::format("<tr><th scope=\"row\">{}</th><td>{}</td></tr>\n", what, value);
}

std::string detection_html(const DetectionFigures& detection) {
  if (detection.runs == 0) return "";
  return "<h2>What was found</h2>\n<table>\n" +
         share_row("Sensitivity", detection.sensitivity, "lesions were found") +
         share_row("Specificity", detection.specificity, "runs without a lesion had no mark") +
         fmt::format("<tr><th scope=\"row\">False alarms</th><td>{} in {} {}</td></tr>\n</table>\n",
                     detection.false_alarms, detection.runs,
                     detection.runs == 1 ? "search" : "searches");
}

std::string table_html(const std::vector<NamedScore>& scores,
                       const std::vector<std::string>& names) {
  const std::vector<Column> columns = columns_of(scores);
  // focusable: a keyboard scrolls it
  std::string html =
      "<h2 id=\"runs\">Runs</h2>\n<div class=\"wide\" tabindex=\"0\" role=\"region\" "
      "aria-labelledby=\"runs\"><table>\n<thead><tr><th scope=\"col\">run</th>";
  for (const Column& column : columns) {
    html += fmt::format("<th scope=\"col\">{}</th>", column.title);
  }
  html += "</tr></thead>\n<tbody>\n";
  for (std::size_t i = 0; i < scores.size(); ++i) {
    html += fmt::format("<tr><th scope=\"row\"><a href=\"#run-{}\">{}</a></th>", i,
                        html_escaped(names[i]));
    for (const Column& column : columns) {
      html += "<td>" + html_escaped(column.cell(scores[i].score)) + "</td>";
    }
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

/// Force over the time of the task; the figures below it say the same in words.
std::string trace_html(const TaskScore& score) {
  constexpr double kWidth = 600.0;
  constexpr double kHeight = 80.0;
  const std::vector<float>& newtons = score.trace.most_newton;
  if (newtons.size() < 2) return "";
  double most = std::isfinite(score.most_force_newton) ? 1.1 * score.most_force_newton : 0.5;
  for (const float newton : newtons) most = std::fmax(most, static_cast<double>(newton));
  const double across = kWidth / static_cast<double>(newtons.size());
  const auto height = [&](double newton) { return kHeight * (1.0 - newton / most); };
  std::string path;
  bool is_drawing = false;
  for (std::size_t i = 0; i < newtons.size(); ++i) {
    const double newton = static_cast<double>(newtons[i]);
    if (std::isfinite(newton)) {
      path += fmt::format("{}{:.1f} {:.1f}", is_drawing ? 'L' : 'M',
                          (static_cast<double>(i) + 0.5) * across, height(newton));
    }
    is_drawing = std::isfinite(newton);
  }
  std::string lines;
  const auto add_line = [&](const char* which, double x1, double y1, double x2, double y2) {
    lines += fmt::format(R"(<line class="{}" x1="{:.1f}" y1="{:.1f}" x2="{:.1f}" y2="{:.1f}"/>)",
                         which, x1, y1, x2, y2);
  };
  if (std::isfinite(score.most_force_newton)) {
    add_line("limit", 0.0, height(score.most_force_newton), kWidth,
             height(score.most_force_newton));
  }
  for (const MarkScore& mark : score.marks) {
    const double x = mark.t_s / score.trace.slot_s * across;
    add_line("mark", x, 0.0, x, kHeight);
  }
  return fmt::format(
      "<figure class=\"trace\"><svg viewBox=\"0 0 {:.0f} {:.0f}\" preserveAspectRatio=\"none\" "
      "role=\"img\" aria-label=\"Force over the task, at most {:.2f} N.\">{}<path "
      "d=\"{}\"/></svg>\n"
      "<figcaption>Force, 0 … {:.1f} N, over {:.0f} s{}</figcaption></figure>\n",
      kWidth, kHeight, score.force.most_newton, lines, path, most,
      score.trace.slot_s * static_cast<double>(newtons.size()),
      score.marks.empty() ? "" : "; upright lines: marks");
}

std::string run_html(const NamedScore& one, const std::string& name, std::size_t index) {
  std::string html = fmt::format("<h3 id=\"run-{}\">{}</h3>\n<p class=\"path\">{}</p>\n<ul>\n",
                                 index, html_escaped(name), html_escaped(one.run));
  for (const std::string& finding : findings_of(one.score)) {
    html += "<li>" + html_escaped(finding) + "</li>\n";
  }
  html += "</ul>\n" + trace_html(one.score) + "<details><summary>Figures</summary><table>\n";
  for (const auto& [label, value] : figures_of(one.score)) {
    html += fmt::format("<tr><th scope=\"row\">{}</th><td>{}</td></tr>\n", html_escaped(label),
                        html_escaped(value));
  }
  return html + "</table></details>\n";
}

}  // namespace

std::string class_html(const std::vector<NamedScore>& scores) {
  const std::string title =
      fmt::format("Palpate: {} {}", scores.size(), scores.size() == 1 ? "run" : "runs");
  const std::vector<std::string> names = short_names(scores);
  std::string html = html_head(title, "class=\"pair\"") + "<main>\n<h1>" + title + "</h1>\n" +
                     detection_html(detection_of(scores)) + table_html(scores, names) +
                     "<h2>What was said of each</h2>\n";
  for (std::size_t i = 0; i < scores.size(); ++i) html += run_html(scores[i], names[i], i);
  return html + "</main></body></html>\n";
}

}  // namespace palpate
