// SPDX-License-Identifier: Apache-2.0
/// @file
/// energy_ledger.h — a lower bound of the energy that the hand has put in, from quantised
/// positions.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>

#include "axis_friction.h"
#include "energy_count.h"
#include "mofc_equations.h"

namespace palpate::controllers {

using Vector3 = Eigen::Vector3d;

/// A force that acted for `acted_s` and then ended at a position that was not read; no force acted
/// for the rest of `duration_s`, at whose end the position was read.
struct Release {
  Vector3 force_on_hand_newton = Vector3::Zero();    ///< F, that acted
  double acted_s = 0.0;                              ///< s ≥ 0
  double duration_s = 0.0;                           ///< T ≥ s
  Vector3 hand_position_at_end_m = Vector3::Zero();  ///< measured, at the end of T
  double v_max_m_per_s = 0.0;                        ///< ≥ 0, finite: the hand was no faster
  double most_drawn_joule = 0.0;                     ///< ≥ 0, upper bound of what the hand drew
};

/// Lower bound E′ of E(t) = ∫ (friction + rendered force resisting the hand)·v dt, with each
/// measured coordinate within ±q/2 of the true one. For isotropic friction f_d v + f_co v/|v| one
/// count in 3-D, with w = √3 q; for friction per axis one count on each axis, with w = q, and their
/// sum. A count is:
///
///     held      Σ g·dh, less (q/2)(|g(k−1)|₁ + |g(0)|₁ + Σ|Δg|₁), |·|₁ the sum over the axes: the
///               error of the sum telescopes. g = f + h with |h| ≤ f_co, because over any way d
///               friction dissipates at least h·d. On axis i |hᵢ| ≤ f_co Lᵢ/|L|, Lᵢ its recent
///               path. While its reading goes on hᵢ resists with all of that; else gᵢ stays where
///               it was as far as hᵢ can keep it, so that a force that trembles costs nothing
///     viscous   f_d (|Δh| − w)₊² / Δt over windows: one closes when the hand has moved
///               16 q, so that slow motion at a high rate is not lost in the quantisation
///
/// f is the force the user exerts on the environment, f = −F. With q = 0 this is [MOFC] eq. (8) in
/// vector form, or summed over the axes. E′ may dip below zero where the true energy does not.
/// Sums are rounded towards less credit, by at most 1e-14 of their largest term in a step. Lemmas:
/// telescoping, held_friction, quantised_path. No allocation, no throw.
class EnergyLedger {
 public:
  /// Isotropic. @param f_d ≥ 0 [N·s/m]   @param f_co ≥ 0 [N]   @param q ≥ 0 [m]
  EnergyLedger(double f_d, double f_co, double q);
  /// Per axis.
  EnergyLedger(const AxisFriction& friction, double q);
  /// Per axis if given, else with the parameters' f_d and f_co.
  EnergyLedger(const MofcParameters& parameters, const std::optional<AxisFriction>& per_axis,
               double q)
      : EnergyLedger(per_axis ? EnergyLedger(*per_axis, q)
                              : EnergyLedger(parameters.f_d, parameters.f_co, q)) {}

  /// Starts again with E′ = 0 at this measured position.
  void restart(const Vector3& hand_position_m) noexcept;

  /// Books an interval during which one force acted.
  /// @param duration_s  ≥ 0, measured       @param force_on_hand_newton  F, really applied
  /// @param hand_position_at_end_m  measured
  void book(double duration_s, const Vector3& force_on_hand_newton,
            const Vector3& hand_position_at_end_m) noexcept;

  /// Books an interval in which the force changed without a reading of the position.
  /// @param most_drawn_joule  ≥ 0, upper bound of what the hand drew in it. E′ covers it if the
  ///                          force was reserved for; of an answer that acted late E′ may fall
  ///                          below 0
  /// @param hand_position_at_end_m  measured
  void book_unread(double most_drawn_joule, const Vector3& hand_position_at_end_m) noexcept;

  /// Books a release, between what is known of it and its worst case (docs/theory.md §2.5).
  /// Lemmas: release_reach, release_energy.
  void book_release(const Release& release) noexcept;

  /// Starts again after an interval of which nothing is known: E′ ← min(E′, 0).
  void forfeit(const Vector3& hand_position_m) noexcept;

  /// E′ ← min(E′, joule). Lemma: cap.
  void limit(double joule) noexcept;

  /// E′ of all that is booked.
  [[nodiscard]] double energy_joule() const noexcept;
  /// Measured, where the last booked interval ended.
  [[nodiscard]] const Vector3& hand_position_m() const noexcept { return position_m_; }
  /// Dissipated by friction since the last restart() or book_unread(), on the paths that are sure.
  [[nodiscard]] double dissipated_joule() const noexcept;

 private:
  using Count = EnergyCount<3>;

  /// One, or one per axis.
  [[nodiscard]] std::span<const Count> counts() const noexcept { return {counts_.data(), used_}; }
  /// What the i-th count sees of a vector.
  [[nodiscard]] Vector3 part(std::size_t i, const Vector3& v) const noexcept;

  double f_co_newton_ = 0.0;  // isotropic; 0 with friction per axis
  double resolution_m_ = 0.0;
  Vector3 position_m_ = Vector3::Zero();
  std::array<Count, 3> counts_{};
  std::size_t used_ = 1;
  double carried_joule_ = 0.0;  // from before the last restart, with releases and what limit() took
};

}  // namespace palpate::controllers
