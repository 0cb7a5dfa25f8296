// SPDX-License-Identifier: Apache-2.0
/// @file
/// mofc_equations.h — the equations of the maximum output force controller, one function each, for
/// comparison with the paper. [MOFC]: docs/theory.md §8.
///
/// Symbols as in [MOFC]:
///
///     T      sampling period: the time for which one force is held          [s]
///     v      v_s(k+1) = (x(k+1) − x(k)) / T, mean velocity of the interval  [m/s]
///     f_s    force the user exerts on the virtual environment               [N]
///     f_d    viscous friction of the device, a lower bound                  [N·s/m]
///     f_co   Coulomb friction of the device, a lower bound                  [N]
///     E′     lower bound of the energy the hand has put in                  [J]
///     f_max  largest force that keeps the next interval passive             [N]
///
/// Differs from the print: in (6) and (7) the index under the sum is n, not k; (10) is a lower
/// bound; in (11) f_so reads f_co; (12) has lost the bracket round its numerator:
/// docs/theory.md §2.1.
#pragma once

#include <algorithm>
#include <cmath>

namespace palpate::controllers {

/// Friction that the ledger may rely on, and the time for which one force is held.
struct MofcParameters {
  double f_d = 0.0;   ///< ≥ 0, viscous [N·s/m]
  double f_co = 0.0;  ///< ≥ 0, Coulomb [N]
  double T = 0.001;   ///< > 0 [s]
};

/// Lower bound of the energy of one interval of length T with displacement d and held force f_s:
///   e(k+1) = f_d T v² + f_co T |v| + T f_s v,   v = d/T
/// Source: [MOFC] eq. (10), which (5)–(8) sum and (9), (11) add to what was there. With the mean
/// velocity it holds for any motion inside the interval. T ≤ 0 counts no viscous part.
/// Lemmas: jensen, path_length.
[[nodiscard]] inline double interval_energy_joule(double f_d, double f_co, double T, double d,
                                                  double f_s) noexcept {
  const double viscous = T > 0.0 ? f_d * d * d / T : 0.0;
  return viscous + f_co * std::abs(d) + f_s * d;
}

/// The velocity at which the hand draws most energy from a held force f_s:
///   v* = −sgn(f_s) (|f_s| − f_co)₊ / (2 f_d)
/// Source: [MOFC] eq. (12). f_d > 0.
[[nodiscard]] inline double most_draining_velocity_m_per_s(const MofcParameters& p,
                                                           double f_s) noexcept {
  const double excess = std::max(0.0, std::abs(f_s) - p.f_co);
  return f_s > 0.0 ? -excess / (2.0 * p.f_d) : excess / (2.0 * p.f_d);
}

/// Most power the hand can draw while a force of norm f acts: (f − f_co)₊² / (4 f_d); infinite for
/// f_d = 0 and f > f_co. Source: [MOFC] eqs. (10), (12). Lemmas: drain, cauchy_schwarz.
[[nodiscard]] inline double drain_watt(const MofcParameters& p, double f) noexcept {
  const double excess = std::max(0.0, f - p.f_co);
  return excess > 0.0 ? excess * excess / (4.0 * p.f_d) : 0.0;
}

/// The same for a hand no faster than v_max: the maximum of (f − f_co) v − f_d v² over v ≤ v_max.
/// Finite for f_d = 0. v_max > 0; infinite: the same as above. Lemma: drain_bounded_speed.
[[nodiscard]] inline double drain_watt(const MofcParameters& p, double f, double v_max) noexcept {
  const double excess = std::max(0.0, f - p.f_co);
  if (!(excess > 2.0 * p.f_d * v_max)) return drain_watt(p, f);
  return (excess - p.f_d * v_max) * v_max;
}

/// f_max = f_co + 2 √(f_d E′ / T). Source: [MOFC] eq. (13).
/// Differs: E′ below zero (friction overestimated, or quantisation unaccounted for) counts as zero.
/// Lemmas: one_interval, between_samples.
[[nodiscard]] inline double maximum_force_newton(const MofcParameters& p, double energy) noexcept {
  return p.f_co + 2.0 * std::sqrt(p.f_d * std::max(0.0, energy) / p.T);
}

/// The largest f with T · drain_watt(p, f, v_max) ≤ E′:
///   f_co + 2 √(f_d E′ / T)               while E′ ≤ f_d T v_max²
///   f_co + f_d v_max + E′ / (T v_max)    beyond
/// Differs from [MOFC] eq. (13): a hand has a highest speed, so v* of (12) is cut there. Never
/// below (13), equal to it at the seam. v_max > 0; infinite: (13). Lemma: bound_bounded_speed.
[[nodiscard]] inline double maximum_force_newton(const MofcParameters& p, double energy,
                                                 double v_max) noexcept {
  if (!(energy > p.f_d * p.T * v_max * v_max)) return maximum_force_newton(p, energy);
  return p.f_co + p.f_d * v_max + energy / (p.T * v_max);
}

/// f_e if |f_e| < f_max, else sgn(f_e) f_max. Source: [MOFC] eq. (14).
[[nodiscard]] inline double output_force_newton(double f_e, double f_max) noexcept {
  return std::clamp(f_e, -f_max, f_max);
}

}  // namespace palpate::controllers
