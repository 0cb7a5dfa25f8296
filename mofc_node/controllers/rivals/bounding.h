// SPDX-License-Identifier: Apache-2.0
/// @file
/// bounding.h — energy bounding and force bounding: the viscous friction of the device bounds the
/// next force.
#pragma once

#include "interval.h"

namespace palpate::controllers {

/// What the three bounding controllers know of the device.
struct BoundingParameters {
  double f_d = 0.1;  ///< ≥ 0, viscous friction of the device [N·s/m]
  double T = 0.001;  ///< > 0, period [s]
};

/// Energy bounding (EBA). With B = f_d/T, Δx the displacement since the previous step:
///
///     |F(k)| ≤ |2 B Δx − F(k−1)|
///
/// keeps E(k) ≥ |F(k)|²/(4B), since E(k) + B|Δx|² − F·Δx ≥ |2BΔx − F|²/(4B). Nothing is banked: per
/// metre the force grows by at most 2 f_d/T, which is the stiffest wall that can be rendered.
///
/// Assumes: every force acts for one period T, from its step to the next; f_d is a lower bound;
/// positions are exact. Broken by: late and lost answers (F(k) acts longer), encoders, a device
/// without viscous friction (F = 0).
/// Source: [Kim04]. Differs: the published bounds of the slope per step come from two constants;
/// this is the form that its passivity condition allows, as a vector.
class EnergyBounding final : public ForceController {
 public:
  /// Does not check the parameters.
  explicit EnergyBounding(const BoundingParameters& parameters) : p_(parameters) {}
  void reset() noexcept override { interval_.reset(); }
  /// No force in the first step and after a gap, when nothing is known of the interval.
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override;

 private:
  BoundingParameters p_;
  IntervalReader interval_;
};

/// Force bounding (FBA), less conservative. With the energy since the contact began:
///
///     E += B|Δx|² − F·Δx        |F| ≤ 2 √(B E)
///
/// [MOFC] eq. (13) without Coulomb friction; the reset where no force is requested bounds the bank.
/// Assumes and is broken by: as EnergyBounding; a long contact banks energy all the same.
/// Source: [Kim15].
class LessConservativeBounding final : public ForceController {
 public:
  /// Does not check the parameters.
  explicit LessConservativeBounding(const BoundingParameters& parameters) : p_(parameters) {}
  void reset() noexcept override;
  /// No force in the first step and after a gap: E begins at 0 there.
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override;

 private:
  BoundingParameters p_;
  IntervalReader interval_;
  double energy_joule_ = 0.0;  // E
};

/// Force bounding (FBA), more conservative. Keeps the invariant E ≥ |F|²/(4 B ξ) instead of E:
///
///     φ = 2 ξ(k−1) √B Δx − F(k−1)/√B
///     ξ(k) = min(1, ξ(k−1) |F_e|²/(B |φ|²))        |F| ≤ √( B ξ(k)/ξ(k−1) ) |φ|
///
/// With ξ = 1 it is EnergyBounding. ξ < 1 stores what a small force leaves over; no force at all
/// forgets it, so free motion banks nothing.
/// Assumes and is broken by: as EnergyBounding.
/// Source: [Kim15].
class MoreConservativeBounding final : public ForceController {
 public:
  /// Does not check the parameters.
  explicit MoreConservativeBounding(const BoundingParameters& parameters) : p_(parameters) {}
  void reset() noexcept override;
  /// No force in the first step and after a gap: ξ begins at 1 there.
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override;
  /// ξ of the last step, 1e-9 … 1.
  [[nodiscard]] double xi() const noexcept { return xi_; }

 private:
  BoundingParameters p_;
  IntervalReader interval_;
  double xi_ = 1.0;
};

}  // namespace palpate::controllers
