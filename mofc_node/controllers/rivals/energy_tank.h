// SPDX-License-Identifier: Apache-2.0
/// @file
/// energy_tank.h — an energy tank with a valve: force that gives energy to the hand takes it out.
#pragma once

#include "interval.h"

namespace palpate::controllers {

/// Levels of the tank, and the damping that fills it.
struct EnergyTankParameters {
  double initial_joule = 0.02;  ///< H₀ ≥ 0: charge at the beginning
  double most_joule = 0.1;      ///< H_max ≥ H₀: no more is stored
  double valve_joule = 2e-3;    ///< H_v > 0: level below which the valve closes
  double damping = 2.0;         ///< d ≥ 0 [N·s/m], where the valve is closed
};

/// H is the level of the tank; the work of the hand fills it, up to H_max:
///
///     H ← min(H_max, H − F(k−1)·Δx)
///     σ = clamp(H / H_v, 0, 1)
///     F = (σ where F_e·v > 0, else 1) F_e − (1 − σ) d v
///
/// A force that gives energy to the hand (F_e·v > 0) passes the valve, which closes as the tank
/// runs empty; damping refills it. The tissue need not be passive.
///
/// Property: the hand extracts at most H₀, and what one period lets through after the last reading.
/// Broken by: that period (a stiff wall at a low rate), and the initial charge itself, which is
/// free. When the tank is empty, the tissue no longer pushes back on release.
/// Source: [Franken11] (tank, damping injection), [Ferraguti15] (valve, upper limit).
class EnergyTank final : public ForceController {
 public:
  /// With the initial charge. Does not check the parameters.
  explicit EnergyTank(const EnergyTankParameters& parameters)
      : p_(parameters), level_joule_(parameters.initial_joule) {}
  void reset() noexcept override { *this = EnergyTank(p_); }
  /// Takes v as the mean velocity since the previous step, 0 after a gap.
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override;

 private:
  EnergyTankParameters p_;
  IntervalReader interval_;
  double level_joule_;  // H
};

}  // namespace palpate::controllers
