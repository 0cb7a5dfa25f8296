// SPDX-License-Identifier: Apache-2.0
#include "common/session/file/convert.h"
#include "palpate/v1/session.pb.h"

namespace palpate {

namespace {

VirtualCouplingConfig to_virtual_coupling(const Fields& fields) {
  VirtualCouplingConfig config{.stiffness_newton_per_m = fields.number("stiffness_newton_per_m"),
                               .damping_newton_s_per_m = fields.number("damping_newton_s_per_m")};
  if (fields.enumerator("criterion") == v1::Mofc::VirtualCoupling::sampled_data) {
    config.criterion = VirtualCouplingConfig::Criterion::kSampledData;
  }
  if (config.damping_newton_s_per_m > 0.0 && config.stiffness_newton_per_m == 0.0) {
    fields.problem("damping_newton_s_per_m",
                   "needs stiffness_newton_per_m > 0; give both, or leave both out");
  }
  return config;
}

PassivityControlConfig to_passivity_control(const Fields& fields) {
  PassivityControlConfig config{
      .most_damping_newton_s_per_m = fields.number("most_damping_newton_s_per_m"),
      .least_speed_m_per_s = fields.number("least_speed_m_per_s")};
  const int observer = fields.enumerator("observer");
  if (observer == v1::Mofc::PassivityControl::product) {
    config.observer = PassivityControlConfig::Observer::kProduct;
  }
  if (observer == v1::Mofc::PassivityControl::reference) {
    config.observer = PassivityControlConfig::Observer::kReference;
  }
  return config;
}

EnergyTankConfig to_energy_tank(const Fields& fields) {
  const EnergyTankConfig config{.initial_joule = fields.number("initial_joule"),
                                .most_joule = fields.number("most_joule"),
                                .valve_joule = fields.number("valve_joule"),
                                .damping_newton_s_per_m = fields.number("damping_newton_s_per_m")};
  const std::string limit = "must be ≤ most_joule, " + shown(config.most_joule) + " J";
  if (config.initial_joule > config.most_joule) fields.problem("initial_joule", limit);
  if (config.valve_joule > config.most_joule) fields.problem("valve_joule", limit);
  return config;
}

LyapunovConfig to_lyapunov(const Fields& fields) {
  const LyapunovConfig config{.least_mass_kg = fields.number("least_mass_kg"),
                              .most_mass_kg = fields.number("most_mass_kg"),
                              .hand_force_newton = fields.number("hand_force_newton"),
                              .slack_watt = fields.number("slack_watt")};
  if (config.most_mass_kg < config.least_mass_kg) {
    fields.problem("most_mass_kg",
                   "must be ≥ least_mass_kg, " + shown(config.least_mass_kg) + " kg");
  }
  return config;
}

}  // namespace

RivalsConfig to_rivals(const Fields& mofc) {
  RivalsConfig config;
  config.virtual_coupling = to_virtual_coupling(mofc.message("virtual_coupling_settings"));
  config.force_bounding.is_more_conservative =
      mofc.message("force_bounding_settings").enumerator("variant") !=
      v1::Mofc::ForceBounding::less_conservative;
  config.passivity_control = to_passivity_control(mofc.message("passivity_control_settings"));
  config.input_to_state.time_constant =
      mofc.message("input_to_state_settings").milliseconds("time_constant_ms");
  config.energy_tank = to_energy_tank(mofc.message("energy_tank_settings"));
  config.lyapunov = to_lyapunov(mofc.message("lyapunov_settings"));
  config.wave_variables.impedance_newton_s_per_m =
      mofc.message("wave_variables_settings").number("impedance_newton_s_per_m");
  return config;
}

}  // namespace palpate
