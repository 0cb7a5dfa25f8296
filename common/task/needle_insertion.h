// SPDX-License-Identifier: Apache-2.0
// needle_insertion.h — what a needle has punctured and how far it went, from where its tip was: by
// the step of a tissue with which mofc_node renders it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "common/contact/analytic_surfaces.h"
#include "common/contact/relaxation.h"
#include "common/contact/tissue_step.h"
#include "common/contact/touch.h"
#include "common/core/scene_messages.h"
#include "common/core/tissue.h"
#include "common/session/task_config.h"
#include "common/task/force_figures.h"
#include "common/task/needle_score.h"

namespace palpate {

class NeedleInsertion {
 public:
  NeedleInsertion(const NeedleTask& task, const ToolShape& tool);

  /// The constants of the materials, which may change during a session.
  void take(const SceneState& scene);
  /// The device has started anew: nothing is punctured.
  void reset();
  /// Every tick, also before the start of the task.
  void follow(const ToolPose& now);
  /// The tick that was followed last counts.
  /// @param t_s        since the start of the task
  /// @param newton     force on the hand
  /// @param elapsed_s  that the tick stands for
  void count(double t_s, double newton, double elapsed_s);
  /// The person says that the resistance is lost. Whether it was, for the first time.
  enum class Mark : std::uint8_t { kTooEarly, kFirst, kRepeated };
  [[nodiscard]] Mark mark(double t_s);

  [[nodiscard]] const NeedleScore& score() const { return score_; }
  /// Completes the score.
  void finish();

 private:
  struct Layer {
    std::uint32_t tissue = 0;
    AnalyticSurface surface;
    KelvinVoigtMaterial material;
    RelaxationState relaxation{};
    std::optional<Touch> touch{};
    bool is_broken_now = false;  // punctured by the motion that was followed last
    ForceCount forces{};

    [[nodiscard]] bool is_punctured() const { return touch && touch->is_punctured; }
    /// ≤ 0: the tip does not touch it.
    [[nodiscard]] double penetration_m() const { return touch ? touch->penetration_m() : 0.0; }
  };
  void step(Layer& layer, const ToolPose& now, double dt_s);
  [[nodiscard]] double behind_membrane_m() const;

  ToolShape tool_;
  Vector3 direction_;
  std::size_t membrane_;
  std::vector<Layer> layers_;
  std::optional<ToolPose> pose_;      // followed last
  std::optional<Vector3> entry_m_{};  // where the tip first touched
  /// Forces of the last kJustBefore_s, by time.
  std::deque<std::pair<double, double>> recent_{};
  NeedleScore score_;
};

}  // namespace palpate
