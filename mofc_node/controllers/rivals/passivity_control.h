// SPDX-License-Identifier: Apache-2.0
/// @file
/// passivity_control.h — passivity observer and passivity controller: damping takes back what the
/// observer finds missing, one sample late.
#pragma once

#include "interval.h"

namespace palpate::controllers {

/// The observer, and the limits of what the controller injects.
struct PassivityControlParameters {
  /// What counts as the energy.
  enum class Observer {
    kProduct,    ///< E += T F(k)·v(k): force and estimated velocity of the same instant
    kSampled,    ///< E += F(k−1)·Δx(k): the work of the force that acted
    kReference,  ///< as sampled, less the energy of the ideal tissue on the same path
  };
  Observer observer = Observer::kSampled;  ///< what counts as the energy
  double T = 0.001;                        ///< > 0, period [s]
  double most_damping = 30.0;              ///< α_max ≥ 0 [N·s/m]
  double least_speed = 1e-3;               ///< v_ε ≥ 0 [m/s]: below it no damping is injected
};

/// Observed energy E (into the tissue positive), reference E_ref (0 but for kReference):
///
///     ΔE = E − E_ref        α = min(α_max, −ΔE / (T v²)) if ΔE < 0 and |v| > v_ε, else 0
///     F  = F_e − α v
///
/// kProduct, [Hannaford02]: a damper counts b v² > 0 although it is held for a period, so the leak
/// of the hold is not seen. kSampled sees all of it. kReference, [Ryu05]: E_ref = Σ ½(F_e(k) +
/// F_e(k−1))·Δx, exact for a spring; the correction begins with the first joule, and E and E_ref
/// begin anew where no force is requested.
///
/// Property: the observed energy returns to E_ref a sample after it fell below, where α_max and the
/// velocity allow it. No friction is needed. Broken by: energy banked in earlier motion (not
/// kReference), v near 0, noise of v, α_max, damping of the tissue beyond 2m/T. The injected
/// damping may exceed the requested force. Differs: one α for the vector; a quantised standstill
/// injects nothing.
class PassivityControl final : public ForceController {
 public:
  /// Does not check the parameters.
  explicit PassivityControl(const PassivityControlParameters& parameters) : p_(parameters) {}
  void reset() noexcept override;
  /// kProduct takes the estimated velocity of the input, the others the mean since the last step.
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override;

 private:
  void observe_reference(const ControlInput& input) noexcept;

  PassivityControlParameters p_;
  IntervalReader interval_;
  double energy_joule_ = 0.0;                   // E
  double alpha_ = 0.0;                          // of the previous step
  double speed_ = 0.0;                          // then
  double reference_joule_ = 0.0;                // E_ref at the last evaluation of F_e
  Vector3 evaluated_at_m_ = Vector3::Zero();    // and where that was
  Vector3 evaluated_newton_ = Vector3::Zero();  // and what it was
};

/// A force with damping in it.
struct InjectedDamping {
  double alpha = 0.0;                              ///< α ≥ 0 [N·s/m]
  Vector3 force_on_hand_newton = Vector3::Zero();  ///< F = F_e − α v
};
/// F_e with the damping that takes back what is missing within the next period, if α_max allows.
/// No allocation, no throw.
/// @param requested_force_on_hand_newton  F_e   @param velocity_m_per_s  v   @param p  α_max, v_ε,
/// T
/// @param missing_joule  E − E_ref; ≥ 0: nothing is injected
[[nodiscard]] InjectedDamping inject_damping(const Vector3& requested_force_on_hand_newton,
                                             const Vector3& velocity_m_per_s, double missing_joule,
                                             const PassivityControlParameters& p) noexcept;

}  // namespace palpate::controllers
