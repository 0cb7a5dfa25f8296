// SPDX-License-Identifier: Apache-2.0
// score.h — the score of one task: figures, and sentences for people who do not read plots. What
// each figure means: docs/tasks.md.
#pragma once

#include <cmath>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/task/force_figures.h"
#include "common/task/needle_score.h"
#include "common/task/tissue_damage.h"
#include "common/task/traction_score.h"
#include "common/telemetry/run_messages.h"

namespace palpate {

/// One lesion.
struct TargetScore {
  enum class Outcome : std::uint8_t {
    kMissed,   ///< never marked
    kGuessed,  ///< marked, but never pressed so hard that it can be felt
    kFound,
  };
  std::string name;
  Outcome outcome = Outcome::kMissed;
  double found_after_s = kNotKnown;
  double mark_distance_m = kNotKnown;  ///< of the mark from the place above its centre
  double palpable_newton = kNotKnown;  ///< as in the session
  double contrast_ratio = kNotKnown;   ///< as in the session
  double guess_newton = kNotKnown;     ///< of a guess: the largest force over it before the mark
  ForceFigures force{};                ///< over it
};
[[nodiscard]] const char* name(TargetScore::Outcome outcome);

/// One mark of the person.
struct MarkScore {
  enum class Outcome : std::uint8_t {
    kFind,        ///< of a lesion; with a needle, of the loss of resistance
    kGuess,       ///< TargetScore::Outcome::kGuessed
    kRepeated,    ///< of a lesion that is found already
    kFalseAlarm,  ///< where there is nothing, or without a touch; before the loss of resistance
    kNotSeen,     ///< the telemetry before it is missing, so that it cannot be judged
  };
  double t_s = 0.0;  ///< since the start
  std::string origin{};
  Outcome outcome = Outcome::kFalseAlarm;
  std::string target{};    ///< the lesion or the membrane; empty: none
  bool is_in_air = false;  ///< of a search: without a touch
};
[[nodiscard]] const char* name(MarkScore::Outcome outcome);

struct TaskScore {
  enum class End : std::uint8_t { kNotStarted, kRunning, kStopped, kTimeUp, kRunEnded };

  TaskState::Kind kind = TaskState::Kind::kFree;
  End end = End::kNotStarted;
  bool is_cut = false;  ///< the recording breaks off before the task has ended
  double time_s = 0.0;
  double limit_s = kNotKnown;
  std::vector<TargetScore> targets{};
  std::vector<MarkScore> marks{};
  // of a search
  double coverage_ratio = kNotKnown;  ///< of the surface that is to be searched
  double area_m2 = kNotKnown;         ///< of that surface
  bool is_area_empty = false;         ///< the area of the task meets no surface
  double least_force_newton = kNotKnown;
  ForceFigures elsewhere{};  ///< away from all lesions
  double depth_p95_m = kNotKnown;
  double depth_most_m = kNotKnown;
  std::optional<NeedleScore> needle{};      ///< of a needle
  std::optional<TractionScore> traction{};  ///< of a traction
  // of every task
  ForceFigures force{};
  ForceTrace trace{};
  double path_m = 0.0;
  double smoothness = kNotKnown;         ///< log dimensionless jerk
  double most_force_newton = kNotKnown;  ///< limit
  double overshoot_newton = kNotKnown;   ///< the largest force beyond it
  double beyond_s = kNotKnown;           ///< time beyond it
  double damage_newton_s = kNotKnown;    ///< ∫ (F − limit) dt beyond it
  std::vector<TissueDamage> tissues{};   ///< with a limit
  // of the telemetry
  std::uint64_t ticks = 0;
  std::uint64_t missing_ticks = 0;
  std::uint64_t device_restarts = 0;

  [[nodiscard]] std::size_t count(TargetScore::Outcome outcome) const;
  [[nodiscard]] std::size_t count(MarkScore::Outcome outcome) const;
  [[nodiscard]] bool is_search() const { return kind == TaskState::Kind::kPalpation; }
  /// Share of the ticks of the task whose telemetry is missing; 0 without ticks.
  [[nodiscard]] double missing_ratio() const;
  /// A search whose surface was not received: nothing is known of the places that were pressed.
  [[nodiscard]] bool lacks_surface() const {
    return is_search() && end != End::kNotStarted && !std::isfinite(area_m2) && !is_area_empty;
  }
  /// False: so much of the telemetry is missing that what was not seen may have been done, or it
  /// lacks the surface.
  [[nodiscard]] bool is_judged() const {
    return missing_ratio() <= kMostMissing && !lacks_surface();
  }
  static constexpr double kMostMissing = 0.1;
};

[[nodiscard]] const char* name(TaskState::Kind kind);
[[nodiscard]] const char* name(TaskScore::End end);
/// Of a lesion; "not_judged" where the task is not.
[[nodiscard]] const char* outcome_of(const TaskScore& score, const TargetScore& target);

/// One sentence each, the most important first; of a task that did not start one that says so.
[[nodiscard]] std::vector<std::string> findings_of(const TaskScore& score);
/// Label and value with unit.
[[nodiscard]] std::vector<std::pair<std::string, std::string>> figures_of(const TaskScore& score);
/// How far a task is, as /task of viewer_node tells it: phase, elapsed_s, time_s, marks, and after
/// the end findings and figures. It tells nothing about places before.
[[nodiscard]] nlohmann::ordered_json state_json(const TaskState& state);
/// Sentences and figures for a terminal.
[[nodiscard]] std::string score_text(const TaskScore& score);
/// Keys: docs/tasks.md. NaN becomes null.
[[nodiscard]] nlohmann::ordered_json score_json(const TaskScore& score);

}  // namespace palpate
