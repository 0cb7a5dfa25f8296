// SPDX-License-Identifier: Apache-2.0
// tour.h — the motions along which a physics is judged: pressing, sliding and circling, each closed
// and in both senses.
#pragma once

#include <string>
#include <vector>

#include "common/core/vector.h"
#include "deploy/conform/model_check.h"
#include "deploy/conform/mofc_side.h"

namespace palpate {

/// A closed path, and what was answered on it.
struct Loop {
  std::string name;
  std::vector<AnsweredPlace> trace;
  bool has_slide = false;  ///< it enters the tissue at one place and leaves it at another
};

class Tour {
 public:
  /// From a clear place, W, to one where the tool presses.
  Tour(const Vector3& clear_m, const Vector3& press_m) : clear_m_(clear_m), press_m_(press_m) {}

  /// All of them, from the clear place; ends at the pressed one.
  void take(MofcSide& mofc);
  /// From the pressed place to the clear one.
  void leave(MofcSide& mofc);

  [[nodiscard]] const std::vector<Loop>& loops() const { return loops_; }
  /// What the answers say about their contacts; more may be added.
  [[nodiscard]] ModelCheck& models() { return models_; }
  /// Of the force from one answer to the next, beyond what the motion explains; 0: none.
  [[nodiscard]] double worst_jump_newton() const { return worst_jump_newton_; }
  /// How far the tool moved meanwhile.
  [[nodiscard]] double worst_jump_m() const { return worst_jump_m_; }

 private:
  std::vector<AnsweredPlace> along(MofcSide& mofc, const std::vector<Vector3>& corners);
  std::vector<AnsweredPlace> circle(MofcSide& mofc, const Vector3& x_m, const Vector3& y_m);
  std::vector<AnsweredPlace> noted(MofcSide& mofc);
  void note_jump(const AnsweredPlace& before, const AnsweredPlace& now);

  Vector3 clear_m_;
  Vector3 press_m_;
  Vector3 at_m_ = Vector3::Zero();  // the tool, at the end of a motion
  std::vector<Loop> loops_;
  ModelCheck models_;
  double worst_jump_newton_ = 0.0;
  double worst_jump_m_ = 0.0;
};

}  // namespace palpate
