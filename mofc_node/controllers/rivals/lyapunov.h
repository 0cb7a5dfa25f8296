// SPDX-License-Identifier: Apache-2.0
/// @file
/// lyapunov.h — a limiter that predicts the next period with a model of hand and tissue.
#pragma once

#include "interval.h"

namespace palpate::controllers {

/// The model of hand and device.
struct LyapunovParameters {
  double T = 0.001;          ///< > 0, period [s]
  double least_mass = 0.1;   ///< m₁ > 0, of hand and device [kg]
  double most_mass = 1.0;    ///< m₂ ≥ m₁ [kg]
  double hand_force = 5.0;   ///< f_h,max ≥ 0: most that the hand pushes [N]
  double slack_watt = 1e-3;  ///< ε/T ≥ 0: power that is let through
};

/// V = ½ m v² + V_e(x) must not grow by more than the hand puts in. With the hand's force f_h, a
/// mass m and a constant force F over the next period:
///
///     d = v T + (F_e + f_h) T²/(2m)          ΔV − f_h·d = F·d + V_e(x + d) − V_e(x)
///
/// F = s F_e with the largest s in 0 … 1 for which F·d + ΔV_e ≤ ε, for m in {m₁, m₂} and f_h in
/// {−f_h,max, 0, f_h,max} along F_e. So the force gives back no more than the tissue releases: no
/// bank, no friction needed, and no limit while the hand presses.
///
/// Property: |ΔV| per period is bounded whatever happened before. Broken by: a mass outside [m₁,
/// m₂], noise of v, a contact model that is wrong about V_e; ε each period accumulates. Source: the
/// future work named in [MOFC], as sketched from Lyapunov's direct method. Needs the contact model;
/// without one F = F_e.
class LyapunovLimiter final : public ForceController {
 public:
  /// Does not check the parameters.
  explicit LyapunovLimiter(const LyapunovParameters& parameters) : p_(parameters) {}
  /// Has no state.
  void reset() noexcept override {}
  /// Evaluates the contact model at most 7 times.
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override;

 private:
  LyapunovParameters p_;
};

}  // namespace palpate::controllers
