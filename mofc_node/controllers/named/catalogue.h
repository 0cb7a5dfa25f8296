// catalogue.h — every controller by name, from one flat set of settings: for programs that choose
// at run time, and for the C interface.
#pragma once

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
  // the device
  double rate_hz = 1000.0;                    ///< of step()
  double viscous_newton_s_per_m = 0.1;        ///< f_d, a lower bound
  double coulomb_newton = 0.1;                ///< f_co, a lower bound
  std::optional<AxisFriction> per_axis = {};  ///< instead of both
  double position_resolution_m = 55e-6;       ///< q, per axis
  double peak_force_newton = 3.3;
  double lease_s = 0.002;          ///< T_hold: every answer may act that long
  double longest_lease_s = 0.002;  ///< and none longer; below lease_s it counts as that
  double delta_max_s = 0.0;        ///< longest time from a reading to the switch to its answer
  /// Mode guard limits what the controller answers.
  double safety_net = 0.0;  ///< ≠ 0: on

  // guard
  double v_max_m_per_s = 0.5;
  double credit_cap_joule = 5e-3;
  double gate_joule = 10e-3;
  double gate_recovery_s = 0.5;
  // virtual coupling; stiffness 0: designed by the criterion of the name
  double coupling_stiffness_newton_per_m = 0.0;
  double coupling_damping_newton_s_per_m = 0.0;
  // passivity control, two ports
  double most_damping_newton_s_per_m = 30.0;
  double least_speed_m_per_s = 1e-3;
  // input to state; 0: 1.5 periods
  double time_constant_s = 0.0;
  // energy tank
  double tank_initial_joule = 0.02;
  double tank_most_joule = 0.1;
  double tank_valve_joule = 2e-3;
  double tank_damping_newton_s_per_m = 2.0;
  // Lyapunov
  double least_mass_kg = 0.1;
  double most_mass_kg = 1.0;
  double hand_force_newton = 5.0;
  double slack_watt = 1e-3;
  // wave variables; no setting by name, as the controller is not in the catalogue
  double wave_impedance_newton_s_per_m = 2.0;
};

/// One field of the settings, by name.
struct SettingEntry {
  const char* name;
  const char* unit;
  double (*get)(const ControllerSettings&);
  void (*set)(ControllerSettings&, double);
  double least;        ///< allowed: ≥ least, or > least
  bool is_least_open;  ///< > least
  /// A rule with other settings, or nullptr. In words for an error.
  bool (*holds)(const ControllerSettings&) = nullptr;
  const char* rule = nullptr;
};

struct ControllerEntry {
  const char* name;
  std::unique_ptr<ForceController> (*make)(const ControllerSettings&);
};

[[nodiscard]] std::span<const SettingEntry> setting_catalogue() noexcept;
[[nodiscard]] std::span<const ControllerEntry> controller_catalogue() noexcept;

/// @param name  one of the catalogue, or "wave_variables", which needs the physics' end and so is
/// no
///              controller to choose by name alone; nullptr is returned for any other
[[nodiscard]] std::unique_ptr<ForceController> make_named(std::string_view name,
                                                          const ControllerSettings& settings);

}  // namespace palpate::controllers
