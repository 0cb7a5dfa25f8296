// SPDX-License-Identifier: Apache-2.0
// traction_score.h — how tissue was held and retracted: figures, and sentences for people who do
// not read plots. What each figure means: docs/tasks.md.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "common/task/force_figures.h"

namespace palpate {

struct TractionScore {
  enum class Outcome : std::uint8_t {
    kNotHeld,     ///< the jaws never took hold
    kNotReached,  ///< they did, and never brought the tissue to the target
    kTooShort,    ///< it was there, but not for long enough without a break
    kLost,        ///< as kTooShort or kNotReached, and it slipped out of the jaws
    kTorn,
    kDone,
  };

  double hold_s = 0.0;       ///< to be held at the target without a break
  double tolerance_m = 0.0;  ///< of the tip from the target
  // since the start; NaN: it never came to that
  double held_after_s = kNotKnown;     ///< jaws took hold, first
  double reached_after_s = kNotKnown;  ///< at the target, first
  double done_after_s = kNotKnown;     ///< held there for long enough, first
  double torn_after_s = kNotKnown;     ///< first
  double longest_s = 0.0;              ///< at the target without a break
  double within_s = 0.0;               ///< of watched_s, held at the target
  double watched_s = 0.0;              ///< from reached_after_s until done_after_s, or the end
  double retraction_m = kNotKnown;     ///< farthest from where the jaws took hold
  std::uint32_t grips = 0;             ///< closings that took hold
  std::uint32_t tears = 0;
  std::uint32_t slips = 0;        ///< episodes
  std::uint32_t slipped_out = 0;  ///< of the jaws
  ForceFigures force{};           ///< while the jaws hold, also below the force of a touch
  /// Ticks since the first that told the state of the jaws that did not; it was taken as before.
  std::uint64_t unknown_ticks = 0;

  [[nodiscard]] Outcome outcome() const;
  /// Share of the time from the first arrival on; NaN without one.
  [[nodiscard]] double within_ratio() const {
    return watched_s > 0.0 ? within_s / watched_s : kNotKnown;
  }
};
[[nodiscard]] const char* name(TractionScore::Outcome outcome);

/// One sentence each, the most important first.
[[nodiscard]] std::vector<std::string> findings_of(const TractionScore& score);
/// Label and value with unit.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> figures_of(
    const TractionScore& score);
/// Adds the keys of docs/tasks.md. NaN becomes null.
void add_json(const TractionScore& score, nlohmann::ordered_json& json);

}  // namespace palpate
