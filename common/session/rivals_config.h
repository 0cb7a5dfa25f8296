// SPDX-License-Identifier: Apache-2.0
// rivals_config.h — settings of the published controllers other than MOFC (docs/controllers.md).
#pragma once

#include <cstdint>

#include "common/core/time.h"

namespace palpate {

/// A spring and a damper between hand and proxy.
struct VirtualCouplingConfig {
  enum class Criterion : std::uint8_t { kLlewellyn, kSampledData };
  Criterion criterion = Criterion::kLlewellyn;  ///< designs what is 0 below
  double stiffness_newton_per_m = 0.0;          ///< K_c; 0: the largest by the criterion
  double damping_newton_s_per_m = 0.0;          ///< B_c, with a stiffness given
};

struct ForceBoundingConfig {
  bool is_more_conservative = true;
};

/// PO/PC, and the damping injection of the two-port form.
struct PassivityControlConfig {
  enum class Observer : std::uint8_t { kProduct, kSampled, kReference };
  Observer observer = Observer::kSampled;
  double most_damping_newton_s_per_m = 30.0;  ///< α_max
  double least_speed_m_per_s = 1e-3;          ///< v_ε: below it nothing is injected
};

struct InputToStateConfig {
  Duration time_constant{};  ///< τ; 0: 1.5 device periods
};

struct EnergyTankConfig {
  double initial_joule = 0.02;
  double most_joule = 0.1;
  double valve_joule = 2e-3;            ///< below it the valve closes
  double damping_newton_s_per_m = 2.0;  ///< injected while the tank is empty
};

struct LyapunovConfig {
  double least_mass_kg = 0.1;      ///< m₁
  double most_mass_kg = 1.0;       ///< m₂
  double hand_force_newton = 5.0;  ///< f_h,max
  double slack_watt = 1e-3;        ///< ε/T
};

struct WaveVariablesConfig {
  double impedance_newton_s_per_m = 2.0;  ///< b, at the hand
};

struct RivalsConfig {
  VirtualCouplingConfig virtual_coupling;
  ForceBoundingConfig force_bounding;
  PassivityControlConfig passivity_control;
  InputToStateConfig input_to_state;
  EnergyTankConfig energy_tank;
  LyapunovConfig lyapunov;
  WaveVariablesConfig wave_variables;
};

}  // namespace palpate
