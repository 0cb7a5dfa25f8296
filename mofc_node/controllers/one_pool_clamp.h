// SPDX-License-Identifier: Apache-2.0
/// @file
/// one_pool_clamp.h — the largest force that one pool of energy covers.
#pragma once

#include <optional>

#include "axis_friction.h"
#include "force_controller.h"
#include "mofc_equations.h"

namespace palpate::controllers {

/// The requested force, scaled: F = s F_e with the largest s in 0 … 1 for which T · drain(F) ≤ E′,
/// where drain(F) is at least the power that a hand with |v| ≤ v_max draws while F acts, F·v −
/// friction(v)·v.
///
/// Isotropic friction: drain(F) = drain_watt(|F|), so |F| ≤ maximum_force_newton(E′).
///
/// Friction per axis, with e_i = (|F_i| − f_co,i)₊:
///
///     drain(F) = min( Σ max_{v ≤ v_max} (e_i v − f_d,i v²),
///                     max_{v ≤ v_max} (|e| v − f_d,min v²) )
///
/// The power is Σ (F_i v_i − f_co,i|v_i| − f_d,i v_i²) ≤ Σ (e_i|v_i| − f_d,i v_i²). |v| ≤ v_max has
/// |v_i| ≤ v_max on every axis, which gives the first bound: exact while no axis gets to v_max, but
/// the hand may be √3 v_max fast in it. Σ e_i|v_i| ≤ |e||v| and Σ f_d,i v_i² ≥ f_d,min|v|² give the
/// second: exact where all f_d,i are equal. Both grow with s; s is found by halving, from below.
/// Lemmas: drain_per_axis, gate. No allocation, no throw.
class OnePoolClamp {
 public:
  /// @param parameters  f_d and f_co are unused where there is `per_axis`
  /// @param per_axis  the friction of each axis; none: isotropic
  /// @param v_max_m_per_s  > 0, may be infinite
  OnePoolClamp(const MofcParameters& parameters, const std::optional<AxisFriction>& per_axis,
               double v_max_m_per_s)
      : p_(parameters), per_axis_(per_axis), v_max_m_per_s_(v_max_m_per_s) {}

  /// drain(F), ≥ 0; infinite where the friction is not viscous, F exceeds Coulomb friction and
  /// v_max is infinite.
  [[nodiscard]] double drain_watt(const Vector3& force_newton) const noexcept;

  /// The largest F along the requested force. The caller sets the ledger's energy and the lease.
  /// @param requested_force_on_hand_newton  F_e
  /// @param energy_joule  E′; below 0 counts as 0
  /// @param gate  0 … 1: granted share of the force beyond what friction alone absorbs
  [[nodiscard]] ControlOutput clamp(const Vector3& requested_force_on_hand_newton,
                                    double energy_joule, double gate = 1.0) const noexcept;

 private:
  [[nodiscard]] double absorbed_scale(const Vector3& force_newton) const noexcept;
  [[nodiscard]] double paid_scale(const Vector3& force_newton, double energy_joule) const noexcept;

  MofcParameters p_;
  std::optional<AxisFriction> per_axis_;
  double v_max_m_per_s_;
};

}  // namespace palpate::controllers
