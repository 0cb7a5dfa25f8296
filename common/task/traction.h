// SPDX-License-Identifier: Apache-2.0
// traction.h — how tissue in the jaws is brought to a place and held there, from where the tip was
// and what mofc_node says of the jaws.
#pragma once

#include <optional>

#include "common/core/vector.h"
#include "common/session/task_config.h"
#include "common/task/traction_score.h"
#include "common/telemetry/mofc_telemetry.h"
#include "common/telemetry/run_messages.h"

namespace palpate {

class Traction {
 public:
  explicit Traction(const TractionTask& task);

  /// The device has started anew: the jaws are open.
  void reset();
  /// Every tick, also before the start of the task. @param grip  none: not known, as before
  void follow(std::optional<GripState> grip, const Vector3& tip_m);
  /// The tick that was followed last counts.
  /// @param t_s        since the start of the task
  /// @param newton     force on the hand
  /// @param elapsed_s  that the tick stands for
  void count(double t_s, double newton, double elapsed_s);

  [[nodiscard]] TractionScore score() const;
  /// For a page.
  [[nodiscard]] TaskState::Traction state() const;

 private:
  [[nodiscard]] bool is_at_target() const {
    return is_holding(grip_) && (tip_m_ - task_.target_m).norm() <= task_.tolerance_m;
  }
  void note_change(double t_s);

  TractionTask task_;
  GripState grip_ = GripState::kNone;  // of the tick followed last
  std::optional<GripState> before_{};  // of the tick counted last
  bool is_told_ = false;               // some tick has told
  bool is_unknown_ = false;            // this one does not
  Vector3 tip_m_ = Vector3::Zero();
  std::optional<Vector3> taken_m_;  // where the jaws took hold
  double streak_s_ = 0.0;           // at the target without a break
  double slipped_s_ = kNotKnown;    // the newest tick that slipped
  ForceCount forces_;
  TractionScore score_;
};

}  // namespace palpate
