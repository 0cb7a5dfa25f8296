// SPDX-License-Identifier: Apache-2.0
/// @file
/// guard_mofc.h — the controller for real use: one pool, a hand of bounded speed, bounded credit.
#pragma once

#include <optional>

#include "force_controller.h"
#include "leak_gate.h"
#include "leased_pool.h"

namespace palpate::controllers {

/// Settings of mode `guard`. Symbols as in docs/theory.md §2.7.
struct GuardParameters {
  MofcParameters mofc;  ///< T: the time for which every command may act, T_hold
  std::optional<AxisFriction> per_axis = {};  ///< the friction, instead of mofc.f_d and mofc.f_co
  double resolution_m = 0.0;                  ///< q ≥ 0, of the position, per axis
  double delta_max_s = 0.0;        ///< δ_max ≥ 0: longest time from the reading to the switch
  double prompt_s = 0.0;           ///< δ_p: for answers within it first; 0: δ_max
  double longest_lease_s = 0.0;    ///< T_lease,max: no command acts longer; below T it counts as T
  double v_max_m_per_s = 0.5;      ///< > 0: fastest the hand can be
  double credit_cap_joule = 5e-3;  ///< S_cap > 0: credit beyond what the environment stores
  double contact_credit_joule = 0.0;  ///< S_c ≥ 0: work of this contact that counts as stored
  double gate_joule = 10e-3;          ///< S_g > 0: leak that closes the gate
  double gate_recovery_s = 0.5;       ///< t_rec > 0: time constant with which it opens
};

/// Mode `guard`. With drain(f) the most power a hand no faster than v_max draws from a held f:
///
///     F     = F_e min(1, f_max / |F_e|)
///     f_max = f_co + gate · (f* − f_co),   T drain(f*) + δ drain(|F_acting|) = E′  (LeasedPool)
///
/// With friction per axis drain is a function of the vector, and the same is done with the scale of
/// F_e instead of its norm (OnePoolClamp).
///
/// Credit is bounded twice, so that hours of gentle contact cannot buy one violent burst:
///
///     cap   E′ ← min(E′, S_cap + max(V_e, min(W_c, S_c))): what the environment stores it may give
///           back, or the work W_c that the hand has done in this contact, up to S_c; and no more
///           than S_cap on top. W_c begins at 0 wherever no force is requested
///     gate  S grows with the friction's work, falls by the leak of holding the force between two
///           evaluations of the environment, −½ s ΔF_e·Δx with s = |F_acting| / |F_e| of the
///           previous evaluation, and recovers to S_g with the time constant t_rec; gate = S / S_g
///           in 0 … 1. A force that generates energy because it is late or held closes it.
///
/// Both only reduce the force, so the guarantee is that of `vector` with one more assumption: E(t)
/// ≥ 0 for all t, any hand no faster than v_max at any instant, any environment. A higher measured
/// speed is reported; its loss is booked in E′, which may then be negative (f_max = f_co). f_d = 0
/// is allowed.
class GuardMofc final : public ForceController {
 public:
  /// Without credit, the gate open. Does not check the parameters.
  explicit GuardMofc(const GuardParameters& parameters);
  void reset() noexcept override;
  /// Books what acted, limits the credit, and grants a force with its lease.
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override;

 private:
  void update_gate(const ControlInput& input, double elapsed_s) noexcept;

  GuardParameters p_;
  LeasedPool pool_;
  double contact_work_joule_ = 0.0;  // W_c

  LeakGate gate_;
  Vector3 position_m_ = Vector3::Zero();           // x of the step before
  Vector3 moved_since_fresh_m_ = Vector3::Zero();  // Δx since F_e was last evaluated
  Vector3 requested_newton_ = Vector3::Zero();     // that F_e
};

}  // namespace palpate::controllers
