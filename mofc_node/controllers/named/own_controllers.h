// SPDX-License-Identifier: Apache-2.0
/// @file
/// own_controllers.h — the controllers of this project by name, from one flat set of settings, and
/// the settings of all.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include "axis_friction.h"
#include "force_controller.h"

namespace palpate::controllers {

/// What the controllers need to know of device and hand, and the settings of each. A controller
/// reads its own.
struct ControllerSettings {
  // of the device
  double rate_hz = 1000.0;                    ///< > 0, of step()
  double viscous_newton_s_per_m = 0.1;        ///< f_d, a lower bound
  double coulomb_newton = 0.1;                ///< f_co, a lower bound
  std::optional<AxisFriction> per_axis = {};  ///< instead of both
  double position_resolution_m = 55e-6;       ///< q, per axis
  double peak_force_newton = 3.3;             ///< > 0; guard's gate allows one hold of it
  double lease_s = 0.002;                     ///< T_hold > 0: every answer may act that long
  double longest_lease_s = 0.002;  ///< no answer acts longer; below lease_s it counts as lease_s
  double delta_max_s = 0.0;        ///< longest time from a reading to the switch to its answer
  double prompt_s =
      0.0;  ///< GuardParameters; a caller that sets it heeds begins_within_s. No setting by name
  double safety_net = 0.0;  ///< ≠ 0: mode guard limits what the controller answers

  // guard, and the safety net: GuardParameters
  double v_max_m_per_s = 0.5;      ///< > 0: fastest the hand can be
  double credit_cap_joule = 5e-3;  ///< S_cap > 0; raised to a quarter of that below
  double gate_joule = 10e-3;       ///< S_g > 0; raised to what one hold of the peak force leaks
  double gate_recovery_s = 0.5;    ///< t_rec > 0
  // virtual coupling: VirtualCouplingParameters
  double coupling_stiffness_newton_per_m = 0.0;  ///< K_c; 0: by the criterion of the name
  double coupling_damping_newton_s_per_m = 0.0;  ///< B_c ≥ 0; unused where K_c is 0
  // passivity control, two ports: PassivityControlParameters
  double most_damping_newton_s_per_m = 30.0;  ///< α_max > 0
  double least_speed_m_per_s = 1e-3;          ///< v_ε > 0: below it no damping is injected
  // input to state
  double time_constant_s = 0.0;  ///< τ; 0: 1.5 periods
  // energy tank: EnergyTankParameters
  double tank_initial_joule = 0.02;          ///< H₀ ≥ 0
  double tank_most_joule = 0.1;              ///< H_max ≥ H₀, H_v
  double tank_valve_joule = 2e-3;            ///< H_v > 0
  double tank_damping_newton_s_per_m = 2.0;  ///< d ≥ 0
  // Lyapunov: LyapunovParameters
  double least_mass_kg = 0.1;      ///< m₁ > 0, of hand and device
  double most_mass_kg = 1.0;       ///< m₂ ≥ m₁
  double hand_force_newton = 5.0;  ///< f_h,max ≥ 0
  double slack_watt = 1e-3;        ///< ε/T ≥ 0
  // wave variables
  double wave_impedance_newton_s_per_m = 2.0;  ///< b > 0; no setting by name: see make_named
};

/// T of step() [s].
[[nodiscard]] inline double period_s(const ControllerSettings& settings) noexcept {
  return 1.0 / settings.rate_hz;
}

/// One controller, by name.
struct ControllerEntry {
  const char* name;                                                     ///< unique
  std::unique_ptr<ForceController> (*make)(const ControllerSettings&);  ///< without a safety net
};

/// How many own_controllers() there are.
inline constexpr std::size_t kOwnControllers = 5;
/// none, guard, vector, paper, paper_isotropic.
[[nodiscard]] std::span<const ControllerEntry, kOwnControllers> own_controllers() noexcept;
/// Makes one of own_controllers(), behind mode guard where settings.safety_net ≠ 0. Does not check
/// the settings.
/// @return nullptr for any other name
[[nodiscard]] std::unique_ptr<ForceController> make_own(std::string_view name,
                                                        const ControllerSettings& settings);
/// @return `made`, behind mode guard where settings.safety_net ≠ 0; nullptr stays what it is
[[nodiscard]] std::unique_ptr<ForceController> with_safety_net(
    std::unique_ptr<ForceController> made, const ControllerSettings& settings);

}  // namespace palpate::controllers
