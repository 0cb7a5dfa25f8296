// SPDX-License-Identifier: Apache-2.0
/// @file
/// input_to_state.h — input-to-state stability: the requested force and a share of its change.
#pragma once

#include "interval.h"

namespace palpate::controllers {

/// ISS. With T_e the time between two evaluations of F_e:
///
///     F(k) = F_e(k) + τ (F_e(k) − F_e(k−1)) / T_e
///
/// On a spring K it acts as a damper K τ that leads: with τ ≥ T/2 + delay it cancels the lag of the
/// hold. It allows the counter-clockwise loops of force over position that a hold makes, bounded in
/// area, so what the hand can extract per stroke is bounded, not zero.
///
/// Property: stable for 0 ≤ −dF_e/dx ≤ μ_max on hands and devices that dissipate. Broken by:
/// damping of the tissue (it is multiplied), changes of F_e that no motion caused. Not passive.
/// Source: [Jafari15].
class InputToState final : public ForceController {
 public:
  /// @param time_constant_s  τ > 0, not checked
  explicit InputToState(double time_constant_s) : tau_s_(time_constant_s) {}
  void reset() noexcept override { *this = InputToState(tau_s_); }
  /// The requested force where there is none, or only one, evaluation to compare.
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override;

 private:
  double tau_s_;
  IntervalReader interval_;
  bool has_evaluation_ = false;
  double since_evaluation_s_ = 0.0;
  Vector3 evaluated_newton_ = Vector3::Zero();
  Vector3 lead_newton_ = Vector3::Zero();  // τ ΔF_e / T_e, until the next evaluation
};

}  // namespace palpate::controllers
