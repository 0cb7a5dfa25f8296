// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/report.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <list>
#include <nlohmann/json.hpp>
#include <string_view>

#include "common/core/user/utf8.h"
#include "common/telemetry/summary.h"
#include "common/telemetry/verdict/verdict.h"
#include "viewer_node/recording/html/html_page.h"
#include "viewer_node/recording/report_data.h"

// the files of report_assets.S
extern "C" const char palpate_report_js[], palpate_report_js_end[];

namespace palpate {
namespace {

const std::string_view kScript(palpate_report_js,
                               static_cast<std::size_t>(palpate_report_js_end - palpate_report_js));

struct Run {
  explicit Run(RecordingFile& its_recording) : recording(its_recording) {}
  RecordingFile& recording;
  ReportRun report;
};

std::string table(const Run& run) {
  const RecordingFile& recording = run.recording;
  const RunStatistics& s = run.report.run.figures.statistics;
  std::string html = "<table>\n";
  const auto line = [&](const std::string& what, const std::string& value) {
    html += fmt::format("<tr><th>{}</th><td>{}</td></tr>\n", what, html_escaped(value));
  };
  const auto reversals = s.reversals();
  line("file", recording.mcap().path());
  line("session", recording.name() + ", seed " + recording.about("seed"));
  line("controller", recording.about("controller"));
  line("recorded by", recording.about("recorded_by") + ", version " + recording.about("version"));
  line("length", fmt::format("{:.3f} s, {} ticks", recording.length_s(), s.ticks()));
  for (const auto& [label, value] :
       figure_lines(recording.about("controller"), run.report.run.mirror, run.report.run.figures)) {
    line(label, value);
  }
  line("transparency, ticks received",
       figure(s.vector_transparency(), "{:.3f}") + " (rendered / requested, projected)");
  line("ideal force",
       std::isfinite(s.ideal_transparency())
           ? figure(s.ideal_transparency(), "{:.3f}") +
                 " (rendered / ideal, projected, capped), gain " + figure(s.gain(), "{:.3f}") +
                 ", error " + figure(100.0 * s.force_error_rms_ratio(), "{:.1f} %") + " rms, " +
                 figure(s.largest_force_error_newton(), "{:.3f} N") + " over 20 ms; " +
                 figure(100.0 * s.beyond_jnd_ratio(), "{:.1f} %") +
                 " of the time beyond the force JND"
           : "not recorded; palpate loopback SESSION --hand RECORDING --record NEW records one");
  if (std::isfinite(s.maximum_torque_newton_m())) {
    line("torque", "largest " + figure(s.maximum_torque_newton_m(), "{:.4f} N·m") +
                       (std::isfinite(s.torque_transparency())
                            ? ", rendered / ideal " + figure(s.torque_transparency(), "{:.3f}")
                            : ""));
  }
  line("velocity reversals",
       fmt::format("{}, {}, {} (x, y, z)", reversals[0], reversals[1], reversals[2]) +
           (std::isfinite(s.path_deviation_rms_m())
                ? fmt::format(", {} more than the ideal run", s.excess_reversals())
                : ""));
  return html + "</table>\n";
}

std::string verdict_of(const Run& run) {
  std::string html = "<table>\n";
  for (const RunFinding& finding : judge(facts_of(run.recording, run.report.run))) {
    html += fmt::format("<tr class=\"{}\"><th>{}</th><td>{}{}</td></tr>\n",
                        finding.grade == Grade::kBad    ? "error"
                        : finding.grade == Grade::kFair ? "warn"
                                                        : "info",
                        name(finding.grade), html_escaped(finding.text),
                        finding.remedy.empty() ? "" : ": " + html_escaped(finding.remedy));
  }
  return html + "</table>\n";
}

std::string html_of(const ReportSection& section) {
  std::string html = "<div>\n";
  for (const std::string& sentence : section.sentences) {
    html += "<p>" + html_escaped(sentence) + "</p>\n";
  }
  html += "<table>\n";
  for (const auto& [label, value] : section.figures) {
    html +=
        fmt::format("<tr><th>{}</th><td>{}</td></tr>\n", html_escaped(label), html_escaped(value));
  }
  return html + "</table></div>\n";
}

std::string events_of(const Run& run) {
  if (run.report.events.empty()) return "<p>None.</p>\n";
  std::string html = "<div class=\"scroll\"><table>\n";
  for (const ReportEvent& event : run.report.events) {
    html +=
        fmt::format("<tr class=\"{}\"><td>{:.3f} s</td><td>{}</td><td>{}</td></tr>\n", event.level,
                    event.t_s, html_escaped(event.source), html_escaped(event.text));
  }
  return html + "</table></div>\n";
}

/// For a script element: "</script>" cannot end it.
std::string data_of(const std::list<Run>& runs) {
  nlohmann::json json = {{"runs", nlohmann::json::array()}};
  for (const Run& run : runs) {
    nlohmann::json events = nlohmann::json::array();
    for (const ReportEvent& event : run.report.events) {
      events.push_back({{"t_s", event.t_s}, {"level", event.level}, {"text", event.text}});
    }
    json["runs"].push_back({{"name", run.recording.name()},
                            {"figures", run.report.figures},
                            {"events", std::move(events)}});
  }
  std::string text = json_text(json);
  for (std::size_t at = 0; (at = text.find('<', at)) != std::string::npos;) {
    text.replace(at, 1, "\\u003c");
  }
  return text;
}

}  // namespace

std::string report_html(const std::vector<std::unique_ptr<RecordingFile>>& recordings,
                        const std::function<void(double)>& on_progress,
                        const std::vector<ReportSection>& sections) {
  std::list<Run> runs;
  for (const auto& recording : recordings) {
    Run& run = runs.emplace_back(*recording);
    read_report(*recording, run.report, [&](double ratio) {
      if (!on_progress) return;
      on_progress((static_cast<double>(runs.size() - 1) + ratio) /
                  static_cast<double>(recordings.size()));
    });
  }
  std::string title = "Palpate: ";
  for (const Run& run : runs) {
    title += (&run == &runs.front() ? "" : " | ") + run.recording.name() + ", " +
             run.recording.about("controller");
  }
  std::string html = html_head(title, fmt::format("class=\"{}\" style=\"--runs: {}\"",
                                                  runs.size() > 1 ? "pair" : "", runs.size())) +
                     "<h1>" + html_escaped(title) + "</h1>\n";
  const auto row = [&](const auto& cell_of) {
    html += "<div class=\"row\">\n";
    for (const Run& run : runs) html += "<div>" + cell_of(run) + "</div>\n";
    html += "</div>\n";
  };
  for (const Run& run : runs) {
    const std::string damage = run.recording.damage();
    if (damage.empty()) continue;
    html += "<p class=\"damage\" role=\"alert\">" + html_escaped(run.recording.mcap().path()) +
            " is damaged; missing: " + html_escaped(damage) + "</p>\n";
  }
  row(table);
  html += "<h2>Verdict</h2>\n";
  row(verdict_of);
  const auto titled = std::find_if(sections.begin(), sections.end(),
                                   [](const auto& one) { return !one.title.empty(); });
  if (titled != sections.end()) {
    html += "<h2>" + html_escaped(titled->title) + "</h2>\n<div class=\"row\">\n";
    for (const ReportSection& section : sections) html += html_of(section);
    html += "</div>\n";
  }
  html += "<h2>Events</h2>\n";
  row(events_of);
  if (kScript.empty()) {
    html += "<p>This program was built without npm, so the report has no figures.</p>\n";
  } else {
    html += "<p>Drag over a figure to zoom in, double-click to zoom out.</p>\n";
    for (std::size_t i = 0; i < report_titles().size(); ++i) {
      const bool is_empty = std::all_of(runs.begin(), runs.end(), [&](const Run& run) {
        return run.report.figures[i]["series"].empty();
      });
      if (is_empty) continue;
      html += fmt::format("<section data-figure=\"{}\"><h2>{}</h2>\n", i,
                          html_escaped(report_titles()[i]));
      row([](const Run&) { return std::string("<div class=\"plot\"></div>"); });
      html += "</section>\n";
    }
  }
  html += "<h2>Session</h2>\n";
  row([](const Run& run) {
    return "<pre>" + html_escaped(run.recording.about("session")) + "</pre>";
  });
  if (!kScript.empty()) {
    html += "<script type=\"application/json\" id=\"data\">" + data_of(runs) +
            "</script>\n<script>" + std::string(kScript) + "</script>\n";
  }
  return html + "</body></html>\n";
}

}  // namespace palpate
