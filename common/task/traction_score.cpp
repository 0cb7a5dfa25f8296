// SPDX-License-Identifier: Apache-2.0
#include "common/task/traction_score.h"

#include <spdlog/fmt/fmt.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "common/telemetry/summary.h"

namespace palpate {

const char* name(TractionScore::Outcome outcome) {
  constexpr std::array<const char*, 6> kNames{"not_held", "not_reached", "too_short",
                                              "lost",     "torn",        "done"};
  return kNames[static_cast<std::size_t>(outcome)];
}

TractionScore::Outcome TractionScore::outcome() const {
  if (tears > 0) return Outcome::kTorn;
  if (std::isfinite(done_after_s)) return Outcome::kDone;
  if (slipped_out > 0) return Outcome::kLost;
  if (grips == 0) return Outcome::kNotHeld;
  return std::isfinite(reached_after_s) ? Outcome::kTooShort : Outcome::kNotReached;
}

std::vector<std::string> findings_of(const TractionScore& score) {
  using Outcome = TractionScore::Outcome;
  std::vector<std::string> findings;
  if (score.unknown_ticks > 0) {
    findings.push_back(fmt::format(
        "What the jaws did is not known for {} measurements: they count as the last known.",
        score.unknown_ticks));
  }
  const std::string most = fmt::format("{:.2f} N", score.force.most_newton);
  switch (score.outcome()) {
    case Outcome::kNotHeld:
      findings.emplace_back("You did not take hold of the tissue.");
      return findings;
    case Outcome::kTorn:
      findings.push_back(
          fmt::format("You tore the tissue after {:.1f} s: you pulled with up to {}.",
                      score.torn_after_s, most));
      break;
    case Outcome::kLost:
      findings.push_back(fmt::format(
          "You lost the tissue: it slipped out of the jaws. You pulled with up to {}.", most));
      break;
    case Outcome::kNotReached:
      findings.emplace_back("You did not bring the tissue to the target.");
      break;
    case Outcome::kTooShort:
      findings.push_back(fmt::format(
          "You brought the tissue to the target, but held it there for {:.1f} s without "
          "a break; {:.1f} s are asked for.",
          score.longest_s, score.hold_s));
      break;
    case Outcome::kDone:
      findings.push_back(fmt::format("You held the tissue at the target for {:.1f} s, as asked.",
                                     score.longest_s));
      break;
  }
  if (std::isfinite(score.within_ratio())) {
    findings.push_back(
        fmt::format("From when it first was there it was within {:.0f} mm of the "
                    "target for {:.0f} % of the time.",
                    1e3 * score.tolerance_m, 100.0 * score.within_ratio()));
  }
  if (score.slips > 0) {
    findings.push_back(fmt::format(
        "It slipped {}.", score.slips == 1 ? "once" : fmt::format("{} times", score.slips)));
  }
  return findings;
}

std::vector<std::pair<std::string, std::string>> figures_of(const TractionScore& score) {
  std::vector<std::pair<std::string, std::string>> figures;
  const auto add = [&](const char* label, std::string value) {
    figures.emplace_back(label, std::move(value));
  };
  const auto add_time = [&](const char* label, double s) {
    add(label, std::isfinite(s) ? fmt::format("after {:.1f} s", s) : "never");
  };
  add_time("took hold", score.held_after_s);
  add_time("at the target", score.reached_after_s);
  add_time("held long enough", score.done_after_s);
  add("held at the target",
      fmt::format("{:.1f} s without a break, of {:.1f} s", score.longest_s, score.hold_s));
  if (std::isfinite(score.within_ratio())) {
    add("within the target", fmt::format("{:.1f} % of the time", 100.0 * score.within_ratio()));
  }
  if (std::isfinite(score.retraction_m)) {
    add("retraction", fmt::format("{:.1f} mm", 1e3 * score.retraction_m));
  }
  add("holds", fmt::format("{}; torn {}, slipped {}, slipped out {}", score.grips, score.tears,
                           score.slips, score.slipped_out));
  if (score.grips > 0) add("force while holding", force_text(score.force));
  return figures;
}

void add_json(const TractionScore& score, nlohmann::ordered_json& json) {
  json["outcome"] = name(score.outcome());
  json["hold_s"] = score.hold_s;
  json["tolerance_m"] = score.tolerance_m;
  json["held_after_s"] = number_or_null(score.held_after_s);
  json["reached_after_s"] = number_or_null(score.reached_after_s);
  json["done_after_s"] = number_or_null(score.done_after_s);
  json["torn_after_s"] = number_or_null(score.torn_after_s);
  json["longest_s"] = score.longest_s;
  json["within_ratio"] = number_or_null(score.within_ratio());
  json["retraction_m"] = number_or_null(score.retraction_m);
  json["grips"] = score.grips;
  json["tears"] = score.tears;
  json["slips"] = score.slips;
  json["slipped_out"] = score.slipped_out;
  json["force_held"] = force_json(score.force);
  json["unknown_grip_ticks"] = score.unknown_ticks;
}

}  // namespace palpate
