// SPDX-License-Identifier: Apache-2.0
// needle_score.h — how a needle was pushed through layers: figures, and sentences for people who do
// not read plots. What each figure means: docs/tasks.md.
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "common/task/force_figures.h"

namespace palpate {

/// One layer. NaN: it was not punctured.
struct LayerScore {
  std::string name{};
  bool is_spared = false;  ///< must not be punctured
  std::uint32_t punctures = 0;
  double punctured_after_s = kNotKnown;  ///< the first time, since the start
  double puncture_depth_m = kNotKnown;   ///< of the tip then
  double puncture_newton = kNotKnown;    ///< largest force on the hand in the 20 ms before
  ForceFigures force{};                  ///< while it was the innermost layer that the tip touched
};

struct NeedleScore {
  enum class Outcome : std::uint8_t {
    kNotThrough,  ///< the membrane was not punctured
    kInside,      ///< it was, and the tip stayed in it
    kThrough,
    kTooFar,  ///< through, and then farther than is allowed
    kInjury,  ///< a layer that is to be spared was punctured
  };

  std::vector<LayerScore> layers{};     ///< the outermost first
  std::size_t membrane = 0;             ///< index in layers
  double most_overshoot_m = kNotKnown;  ///< limit
  // of the tip
  double depth_most_m = kNotKnown;  ///< below where it first touched, along the insertion
  double sideways_m = kNotKnown;    ///< off the line of the insertion, at most
  double overshoot_m = kNotKnown;   ///< behind the membrane, at most
  double end_behind_m = kNotKnown;  ///< behind the membrane, at the end
  double told_after_s = kNotKnown;  ///< first mark after the puncture of the membrane, since then

  [[nodiscard]] Outcome outcome() const;
};
[[nodiscard]] const char* name(NeedleScore::Outcome outcome);

/// One sentence each, the most important first.
[[nodiscard]] std::vector<std::string> findings_of(const NeedleScore& score);
/// Label and value with unit.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> figures_of(const NeedleScore& score);
/// Adds the keys of docs/tasks.md. NaN becomes null.
void add_json(const NeedleScore& score, nlohmann::ordered_json& json);

}  // namespace palpate
