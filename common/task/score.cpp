// SPDX-License-Identifier: Apache-2.0
#include "common/task/score.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "common/telemetry/summary.h"

namespace palpate {
namespace {

/// Two forces that are not equal, with as many digits as show it.
std::pair<std::string, std::string> forces_text(double a_newton, double b_newton) {
  for (int digits = 1;; ++digits) {
    std::string a = fmt::format("{:.{}f} N", a_newton, digits);
    std::string b = fmt::format("{:.{}f} N", b_newton, digits);
    if (a != b || digits == 4) return {std::move(a), std::move(b)};
  }
}

std::string finding_of(const TargetScore& target) {
  const double most = target.force.most_newton;
  const bool is_known = std::isfinite(target.palpable_newton);
  switch (target.outcome) {
    case TargetScore::Outcome::kFound:
      return fmt::format("{}: found after {:.1f} s, marked {:.0f} mm from its centre.", target.name,
                         target.found_after_s, 1e3 * target.mark_distance_m);
    case TargetScore::Outcome::kGuessed: {
      if (!(target.guess_newton > 0.0)) {
        return fmt::format("{}: marked, but guessed: before the mark you had not pressed over it.",
                           target.name);
      }
      const auto [pressed, palpable] = forces_text(target.guess_newton, target.palpable_newton);
      return fmt::format(
          "{}: marked, but guessed: before the mark you had pressed over it with at most {}, and "
          "it can be felt from {} on.",
          target.name, pressed, palpable);
    }
    case TargetScore::Outcome::kMissed:
      break;
  }
  if (!std::isfinite(most)) {
    return fmt::format("{}: missed. You never touched the place above it.", target.name);
  }
  if (is_known && most < target.palpable_newton) {
    const auto [pressed, palpable] = forces_text(most, target.palpable_newton);
    return fmt::format(
        "{}: missed. You pressed too lightly: at most {} over it, and it can be felt from {} on.",
        target.name, pressed, palpable);
  }
  return fmt::format("{}: missed. You pressed over it with up to {:.1f} N{}, and did not mark it.",
                     target.name, most, is_known ? ", which is enough to feel it" : "");
}

std::string end_text(TaskScore::End end) {
  switch (end) {
    case TaskScore::End::kStopped:
      return "stopped";
    case TaskScore::End::kTimeUp:
      return "the time was up";
    case TaskScore::End::kRunEnded:
      return "the run ended";
    default:
      return "not ended";
  }
}

nlohmann::ordered_json marks_json(const TaskScore& score) {
  auto marks = nlohmann::ordered_json::array();
  for (const MarkScore& mark : score.marks) {
    marks.push_back({{"t_s", mark.t_s},
                     {"origin", mark.origin},
                     {"outcome", name(mark.outcome)},
                     {"target", mark.target}});
  }
  return marks;
}

constexpr double kSaid = 1e-4;  // a smaller share of missing telemetry is not worth a sentence

/// With one digit after the point, of small values two that count: nothing known becomes 0.0.
std::string short_number(double value) {
  return value < 0.1 ? fmt::format("{:.2g}", value) : fmt::format("{:.1f}", value);
}

}  // namespace

const char* name(TaskScore::End end) {
  constexpr std::array<const char*, 5> kNames{"not_started", "running", "stopped", "time_up",
                                              "run_ended"};
  return kNames[static_cast<std::size_t>(end)];
}

const char* name(TaskState::Kind kind) {
  constexpr std::array<const char*, 4> kNames{"free", "palpation", "needle", "traction"};
  return kNames[static_cast<std::size_t>(kind)];
}

const char* name(TargetScore::Outcome outcome) {
  constexpr std::array<const char*, 3> kNames{"missed", "guessed", "found"};
  return kNames[static_cast<std::size_t>(outcome)];
}

const char* name(MarkScore::Outcome outcome) {
  constexpr std::array<const char*, 5> kNames{"find", "guess", "repeated", "false alarm",
                                              "not seen"};
  return kNames[static_cast<std::size_t>(outcome)];
}

const char* outcome_of(const TaskScore& score, const TargetScore& target) {
  return score.is_judged() ? name(target.outcome) : "not_judged";
}

std::size_t TaskScore::count(TargetScore::Outcome outcome) const {
  return static_cast<std::size_t>(std::count_if(
      targets.begin(), targets.end(), [&](const auto& one) { return one.outcome == outcome; }));
}

std::size_t TaskScore::count(MarkScore::Outcome outcome) const {
  return static_cast<std::size_t>(std::count_if(
      marks.begin(), marks.end(), [&](const auto& one) { return one.outcome == outcome; }));
}

double TaskScore::missing_ratio() const {
  const std::uint64_t all = ticks + missing_ticks;
  return all > 0 ? static_cast<double>(missing_ticks) / static_cast<double>(all) : 0.0;
}

std::vector<std::string> findings_of(const TaskScore& score) {
  std::vector<std::string> findings;
  if (score.end == TaskScore::End::kNotStarted) {
    findings.emplace_back(
        score.is_cut ? "The recording breaks off before the task was started: there is no score."
                     : "The task was not started, so there is no score.");
    return findings;
  }
  if (score.is_cut) {
    findings.push_back(fmt::format(
        "The recording breaks off {:.1f} s after the start: this is the score of a part, not of "
        "the task.",
        score.time_s));
  }
  if (score.missing_ratio() > kSaid || score.device_restarts > 0) {
    findings.push_back(
        fmt::format("{} % of the measurements are missing{}: the score covers the rest.",
                    short_number(100.0 * score.missing_ratio()),
                    score.device_restarts > 0 ? ", and the device was started again" : ""));
  }
  if (const std::size_t unseen = score.count(MarkScore::Outcome::kNotSeen); unseen > 0) {
    findings.push_back(fmt::format("{} {} not judged: the measurements before {} are missing.",
                                   unseen, unseen == 1 ? "mark is" : "marks are",
                                   unseen == 1 ? "it" : "them"));
  }
  if (score.lacks_surface()) {
    findings.emplace_back("The surface of the tissue was not received: the search is not judged.");
    return findings;
  }
  if (!score.is_judged()) {
    findings.emplace_back(
        "That is too much to judge the task: what was not seen may have been done.");
    return findings;
  }
  if (score.is_search()) {
    if (score.targets.empty()) {
      findings.push_back(score.marks.empty() ? "There was nothing to find, and you marked nothing."
                                             : "There was nothing to find.");
    } else {
      findings.push_back(fmt::format("Found {} of {}.", score.count(TargetScore::Outcome::kFound),
                                     score.targets.size()));
    }
    for (const TargetScore& target : score.targets) findings.push_back(finding_of(target));
    const auto in_air = std::count_if(score.marks.begin(), score.marks.end(),
                                      [](const MarkScore& one) { return one.is_in_air; });
    const auto told = [&](std::ptrdiff_t marks, const char* how) {
      if (marks <= 0) return;
      findings.push_back(
          fmt::format("{} {} set {}.", marks, marks == 1 ? "mark was" : "marks were", how));
    };
    told(static_cast<std::ptrdiff_t>(score.count(MarkScore::Outcome::kFalseAlarm)) - in_air,
         "where there is nothing");
    told(in_air, "without touching the tissue");
    if (std::isfinite(score.coverage_ratio)) {
      findings.push_back(fmt::format("You searched {:.0f} % of the surface with {:.2g} N or more.",
                                     100.0 * score.coverage_ratio, score.least_force_newton));
    } else {
      findings.emplace_back(
          "What part of the surface you searched is not known: the area that the session names "
          "meets no surface.");
    }
  }
  if (score.needle) {
    for (std::string& finding : findings_of(*score.needle)) findings.push_back(std::move(finding));
    if (const std::size_t early = score.count(MarkScore::Outcome::kFalseAlarm); early > 0) {
      findings.push_back(fmt::format("{} {} set before the resistance was lost.", early,
                                     early == 1 ? "mark was" : "marks were"));
    }
  }
  if (score.traction) {
    for (std::string& finding : findings_of(*score.traction)) {
      findings.push_back(std::move(finding));
    }
  }
  if (score.overshoot_newton > 0.0) {
    findings.push_back(fmt::format(
        "You {} too hard: up to {:.1f} N, {:.{}f} N beyond the limit, for {:.{}f} s.",
        score.traction ? "pulled" : "pressed", score.most_force_newton + score.overshoot_newton,
        score.overshoot_newton, score.overshoot_newton < 0.1 ? 2 : 1, score.beyond_s,
        score.beyond_s < 0.1 ? 3 : 1));
  }
  for (std::string& finding : findings_of(score.tissues)) findings.push_back(std::move(finding));
  return findings;
}

std::vector<std::pair<std::string, std::string>> figures_of(const TaskScore& score) {
  std::vector<std::pair<std::string, std::string>> figures;
  const auto add = [&](const std::string& label, std::string value) {
    figures.emplace_back(label, std::move(value));
  };
  if (score.end == TaskScore::End::kNotStarted) return figures;
  add("time",
      fmt::format(
          "{:.1f} s, {}{}", score.time_s,
          score.is_cut ? "where the recording breaks off" : end_text(score.end),
          std::isfinite(score.limit_s) ? fmt::format(" (limit {:g} s)", score.limit_s) : ""));
  if (score.is_search() && score.is_judged()) {
    add("found",
        fmt::format("{} of {}", score.count(TargetScore::Outcome::kFound), score.targets.size()));
    add("false alarms", std::to_string(score.count(MarkScore::Outcome::kFalseAlarm)));
    add("coverage",
        std::isfinite(score.coverage_ratio)
            ? fmt::format("{:.1f} % of {} cm² with {:.2f} N or more", 100.0 * score.coverage_ratio,
                          short_number(1e4 * score.area_m2), score.least_force_newton)
            : "not known");
  }
  if (score.needle && score.is_judged()) {
    for (auto& [label, value] : figures_of(*score.needle)) add(label, std::move(value));
  }
  if (score.traction && score.is_judged()) {
    for (auto& [label, value] : figures_of(*score.traction)) add(label, std::move(value));
  }
  add("force", force_text(score.force));
  for (const TargetScore& target : score.targets) {
    add("force over " + target.name, force_text(target.force));
  }
  if (!score.targets.empty()) add("force elsewhere", force_text(score.elsewhere));
  if (std::isfinite(score.depth_most_m)) {
    add("depth", fmt::format("{:.1f} mm at 95 %, {:.1f} mm at most", 1e3 * score.depth_p95_m,
                             1e3 * score.depth_most_m));
  }
  add("path", fmt::format("{:.3f} m", score.path_m));
  add("smoothness", std::isfinite(score.smoothness)
                        ? fmt::format("{:.2f} (log dimensionless jerk; nearer to 0 is smoother)",
                                      score.smoothness)
                        : "not known");
  if (std::isfinite(score.most_force_newton)) {
    add("force limit", fmt::format("{:.2f} N; beyond it by {:.2f} N, for {:.2f} s, {:.3f} N·s",
                                   score.most_force_newton, score.overshoot_newton, score.beyond_s,
                                   score.damage_newton_s));
  }
  for (auto& figure : figures_of(score.tissues)) figures.push_back(std::move(figure));
  add("telemetry missing",
      fmt::format("{} of {} ticks", score.missing_ticks, score.ticks + score.missing_ticks));
  return figures;
}

std::string score_text(const TaskScore& score) {
  std::string text = "task\n";
  for (const std::string& finding : findings_of(score)) text += "  " + finding + "\n";
  const auto figures = figures_of(score);
  std::size_t width = 20;
  for (const auto& [label, value] : figures) width = std::max(width, label.size());
  for (const auto& [label, value] : figures) {
    text += fmt::format("  {:<{}}  {}\n", label, width, value);
  }
  return text;
}

nlohmann::ordered_json state_json(const TaskState& state) {
  constexpr std::array<const char*, 3> kPhases{"waiting", "running", "ended"};
  nlohmann::ordered_json json{
      {"kind", name(state.kind)},
      {"phase", kPhases[static_cast<std::size_t>(state.phase)]},
      {"elapsed_s", state.elapsed_s},
      {"time_s", number_or_null(state.time_s > 0.0 ? state.time_s : kNotKnown)},
      {"marks", state.marks},
      {"findings", state.findings}};
  json["figures"] = nlohmann::ordered_json::object();
  for (const auto& [label, value] : state.figures) json["figures"][label] = value;
  return json;
}

nlohmann::ordered_json score_json(const TaskScore& score) {
  nlohmann::ordered_json json;
  json["kind"] = name(score.kind);
  json["end"] = name(score.end);
  json["is_cut"] = score.is_cut;
  json["is_judged"] = score.is_judged();
  json["time_s"] = score.time_s;
  json["limit_s"] = number_or_null(score.limit_s);
  if (score.is_search()) {
    json["targets"] = nlohmann::ordered_json::array();
    for (const TargetScore& target : score.targets) {
      json["targets"].push_back({{"name", target.name},
                                 {"outcome", outcome_of(score, target)},
                                 {"found_after_s", number_or_null(target.found_after_s)},
                                 {"mark_distance_m", number_or_null(target.mark_distance_m)},
                                 {"palpable_n", number_or_null(target.palpable_newton)},
                                 {"contrast_ratio", number_or_null(target.contrast_ratio)},
                                 {"force", force_json(target.force)}});
    }
    json["marks"] = marks_json(score);
    const auto count = [&](auto outcome) -> nlohmann::ordered_json {
      if (!score.is_judged()) return nullptr;
      return score.count(outcome);
    };
    json["found"] = count(TargetScore::Outcome::kFound);
    json["guessed"] = count(TargetScore::Outcome::kGuessed);
    json["missed"] = count(TargetScore::Outcome::kMissed);
    json["false_alarms"] = count(MarkScore::Outcome::kFalseAlarm);
    json["coverage_ratio"] = number_or_null(score.coverage_ratio);
    json["area_m2"] = number_or_null(score.area_m2);
    json["least_force_n"] = number_or_null(score.least_force_newton);
    json["force_elsewhere"] = force_json(score.elsewhere);
    json["depth_p95_m"] = number_or_null(score.depth_p95_m);
    json["depth_most_m"] = number_or_null(score.depth_most_m);
  }
  if (score.needle) {
    add_json(*score.needle, json);
    json["marks"] = marks_json(score);
    json["false_alarms"] = score.count(MarkScore::Outcome::kFalseAlarm);
  }
  if (score.traction) add_json(*score.traction, json);
  json["force"] = force_json(score.force);
  json["force_over_time"] = trace_json(score.trace);
  json["path_m"] = score.path_m;
  json["smoothness"] = number_or_null(score.smoothness);
  json["most_force_n"] = number_or_null(score.most_force_newton);
  json["overshoot_n"] = number_or_null(score.overshoot_newton);
  json["beyond_s"] = number_or_null(score.beyond_s);
  json["damage_n_s"] = number_or_null(score.damage_newton_s);
  if (!score.tissues.empty()) json["tissues"] = tissues_json(score.tissues);
  json["ticks"] = score.ticks;
  json["missing_ticks"] = score.missing_ticks;
  json["missing_ratio"] = score.missing_ratio();
  json["device_restarts"] = score.device_restarts;
  return json;
}

}  // namespace palpate
