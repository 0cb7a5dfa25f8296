// SPDX-License-Identifier: Apache-2.0
#include "common/task/needle_score.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "common/telemetry/summary.h"

namespace palpate {
namespace {

std::string mm_text(double m) { return fmt::format("{:.1f} mm", 1e3 * m); }

}  // namespace

const char* name(NeedleScore::Outcome outcome) {
  constexpr std::array<const char*, 5> kNames{"not_through", "inside", "through", "too_far",
                                              "injury"};
  return kNames[static_cast<std::size_t>(outcome)];
}

NeedleScore::Outcome NeedleScore::outcome() const {
  const bool is_injured = std::any_of(layers.begin(), layers.end(), [](const LayerScore& layer) {
    return layer.is_spared && layer.punctures > 0;
  });
  if (is_injured) return Outcome::kInjury;
  if (layers[membrane].punctures == 0) return Outcome::kNotThrough;
  if (!(overshoot_m > 0.0)) return Outcome::kInside;
  return overshoot_m > most_overshoot_m ? Outcome::kTooFar : Outcome::kThrough;
}

std::vector<std::string> findings_of(const NeedleScore& score) {
  std::vector<std::string> findings;
  const std::string& membrane = score.layers[score.membrane].name;
  const std::string behind =
      fmt::format("The tip went {} behind {}", mm_text(score.overshoot_m), membrane);
  switch (score.outcome()) {
    case NeedleScore::Outcome::kNotThrough:
      findings.push_back(fmt::format("You did not get through {}.", membrane));
      break;
    case NeedleScore::Outcome::kInside:
      findings.push_back(
          fmt::format("{} gave way, but the tip of the needle stayed in it.", membrane));
      break;
    case NeedleScore::Outcome::kThrough:
      findings.push_back(fmt::format("You got through {}. {}.", membrane, behind));
      break;
    case NeedleScore::Outcome::kTooFar:
      findings.push_back(fmt::format("Too far: you got through {}. {}; {} are allowed.", membrane,
                                     behind, mm_text(score.most_overshoot_m)));
      break;
    case NeedleScore::Outcome::kInjury:
      for (const LayerScore& layer : score.layers) {
        if (!layer.is_spared || layer.punctures == 0) continue;
        findings.push_back(fmt::format("You punctured {}, which was to be spared.", layer.name));
      }
      if (score.overshoot_m > 0.0) findings.push_back(behind + ".");
      break;
  }
  if (score.layers[score.membrane].punctures == 0) return findings;
  findings.push_back(
      std::isfinite(score.told_after_s)
          ? fmt::format("You marked the loss of resistance {:.1f} s after it.", score.told_after_s)
          : "You did not mark the loss of resistance.");
  return findings;
}

std::vector<std::pair<std::string, std::string>> figures_of(const NeedleScore& score) {
  std::vector<std::pair<std::string, std::string>> figures;
  const auto add = [&](const std::string& label, double m) {
    if (std::isfinite(m)) figures.emplace_back(label, mm_text(m));
  };
  add("depth", score.depth_most_m);
  add("overshoot", score.overshoot_m);
  add("behind at the end", score.end_behind_m);
  add("sideways", score.sideways_m);
  for (const LayerScore& layer : score.layers) {
    figures.emplace_back(
        layer.name,
        layer.punctures == 0
            ? "not punctured"
            : fmt::format("punctured after {:.1f} s{}, with {:.2f} N", layer.punctured_after_s,
                          std::isfinite(layer.puncture_depth_m)
                              ? ", " + mm_text(layer.puncture_depth_m) + " deep"
                              : "",
                          layer.puncture_newton));
  }
  return figures;
}

void add_json(const NeedleScore& score, nlohmann::ordered_json& json) {
  json["outcome"] = name(score.outcome());
  json["membrane"] = score.layers[score.membrane].name;
  json["insertion_depth_m"] = number_or_null(score.depth_most_m);
  json["sideways_m"] = number_or_null(score.sideways_m);
  json["overshoot_m"] = number_or_null(score.overshoot_m);
  json["most_overshoot_m"] = number_or_null(score.most_overshoot_m);
  json["end_behind_m"] = number_or_null(score.end_behind_m);
  json["told_after_s"] = number_or_null(score.told_after_s);
  json["layers"] = nlohmann::ordered_json::array();
  for (const LayerScore& layer : score.layers) {
    json["layers"].push_back({{"name", layer.name},
                              {"spared", layer.is_spared},
                              {"punctures", layer.punctures},
                              {"punctured_after_s", number_or_null(layer.punctured_after_s)},
                              {"puncture_depth_m", number_or_null(layer.puncture_depth_m)},
                              {"puncture_n", number_or_null(layer.puncture_newton)},
                              {"force", force_json(layer.force)}});
  }
}

}  // namespace palpate
