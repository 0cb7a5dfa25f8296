// SPDX-License-Identifier: Apache-2.0
// task_config.h — what a person is to do in a session, and what is scored.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/core/vector.h"
#include "common/session/scene_config.h"

namespace palpate {

/// A lesion that is to be found: a ball in the tissue. In W.
struct TaskTarget {
  std::string name;
  std::uint32_t lesion = 0;  ///< index of the part or inclusion
  Vector3 center_m = Vector3::Zero();
  double radius_m = 0.0;
  /// Force from which on it can be felt; NaN: not known.
  double palpable_newton = std::numeric_limits<double>::quiet_NaN();
  /// By which the force over it exceeds that beside it, at the largest force; NaN: not known.
  double contrast_ratio = std::numeric_limits<double>::quiet_NaN();
};

/// Look for lesions by pressing.
struct PalpationTask {
  std::uint32_t tissue = 0;              ///< index in the scene
  std::optional<RegionGeometry> area{};  ///< never a MeshTag; none: the whole surface
  std::vector<TaskTarget> targets{};
  double least_force_newton = 0.5;   ///< from which on a press searches its place
  double coverage_radius_m = 0.005;  ///< around the tip's place on the surface
  double mark_tolerance_m = 0.01;    ///< of a mark, from the edge of the lesion
};

/// Nothing is looked for.
struct FreeTask {};

/// A tissue that a needle goes through: at rest, a simple shape that a tip can puncture.
struct NeedleLayer {
  std::uint32_t tissue = 0;  ///< index in the scene
  std::string name{};
  Geometry geometry{};  ///< never a FileGeometry
  KelvinVoigtMaterial material{};
  bool is_spared = false;  ///< must not be punctured
};

/// Push a needle through layers until the resistance is lost.
struct NeedleTask {
  std::vector<NeedleLayer> layers{};         ///< at least one; the outermost first
  std::size_t membrane = 0;                  ///< index in layers: the one to be passed
  Vector3 direction = Vector3(0, 0, -1);     ///< of the insertion, unit; W
  std::optional<double> most_overshoot_m{};  ///< behind the membrane; none: no limit
};

/// Take hold of elastic tissue with the gripper, bring it to a place and hold it there.
struct TractionTask {
  Vector3 target_m = Vector3::Zero();  ///< of the centre of the tip, W
  double tolerance_m = 0.003;          ///< of the tip from it
  double hold_s = 5.0;                 ///< without a break
};

/// What a tissue bears; it is at rest.
struct TissueLimit {
  std::size_t tissue = 0;  ///< index in the scene
  std::string name{};
  double most_force_newton = 0.0;  ///< > 0
  std::optional<double> most_damage_newton_s{};
};

struct TaskConfig {
  std::string briefing{};
  bool is_started_by_person = false;  ///< else with the first tick
  std::optional<double> time_s{};     ///< none: no limit
  std::optional<double> most_force_newton{};
  std::vector<TissueLimit> tissue_limits{};
  std::optional<std::uint32_t> mark_button{};
  std::variant<FreeTask, PalpationTask, NeedleTask, TractionTask> kind{};

  [[nodiscard]] const PalpationTask* palpation() const { return std::get_if<PalpationTask>(&kind); }
  [[nodiscard]] const NeedleTask* needle() const { return std::get_if<NeedleTask>(&kind); }
  [[nodiscard]] const TractionTask* traction() const { return std::get_if<TractionTask>(&kind); }
  /// Whether it must not be told where things are before it has ended.
  [[nodiscard]] bool hides_places() const { return palpation() != nullptr || needle() != nullptr; }
};

}  // namespace palpate
