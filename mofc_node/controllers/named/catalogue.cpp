// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/named/catalogue.h"

#include <algorithm>
#include <array>
#include <utility>

#include "mofc_node/controllers/rivals/bounding.h"
#include "mofc_node/controllers/rivals/energy_tank.h"
#include "mofc_node/controllers/rivals/input_to_state.h"
#include "mofc_node/controllers/rivals/lyapunov.h"
#include "mofc_node/controllers/rivals/memory_based.h"
#include "mofc_node/controllers/rivals/passivity_control.h"
#include "mofc_node/controllers/rivals/two_port.h"
#include "mofc_node/controllers/rivals/virtual_coupling.h"
#include "mofc_node/controllers/rivals/wave_variables.h"

namespace palpate::controllers {

namespace {

using Settings = ControllerSettings;
using Made = std::unique_ptr<ForceController>;
using Observer = PassivityControlParameters::Observer;

/// The published methods know one friction: the least of the axes.
double viscous(const Settings& s) {
  return s.per_axis ? s.per_axis->f_d.minCoeff() : s.viscous_newton_s_per_m;
}

template <VirtualCouplingParameters (*Design)(double, double)>
Made virtual_coupling(const Settings& s) {
  if (s.coupling_stiffness_newton_per_m > 0.0) {
    return std::make_unique<VirtualCoupling>(
        VirtualCouplingParameters{.K_c = s.coupling_stiffness_newton_per_m,
                                  .B_c = s.coupling_damping_newton_s_per_m,
                                  .T = period_s(s)});
  }
  // a device without viscous friction allows no coupling: the least that has a solution
  return std::make_unique<VirtualCoupling>(Design(std::max(viscous(s), 1e-6), period_s(s)));
}

template <class Bounding>
Made bounding(const Settings& s) {
  return std::make_unique<Bounding>(BoundingParameters{.f_d = viscous(s), .T = period_s(s)});
}

PassivityControlParameters passivity(const Settings& s, Observer observer) {
  return {.observer = observer,
          .T = period_s(s),
          .most_damping = s.most_damping_newton_s_per_m,
          .least_speed = s.least_speed_m_per_s};
}

template <Observer observer>
Made passivity_control(const Settings& s) {
  return std::make_unique<PassivityControl>(passivity(s, observer));
}

constexpr std::array<ControllerEntry, 13> kRivals{{
    {"virtual_coupling", virtual_coupling<llewellyn_coupling>},
    {"virtual_coupling_sampled_data", virtual_coupling<sampled_data_coupling>},
    {"energy_bounding", bounding<EnergyBounding>},
    {"force_bounding", bounding<MoreConservativeBounding>},
    {"force_bounding_less_conservative", bounding<LessConservativeBounding>},
    {"passivity_control", passivity_control<Observer::kSampled>},
    {"passivity_control_product", passivity_control<Observer::kProduct>},
    {"passivity_control_reference", passivity_control<Observer::kReference>},
    {"memory_based",
     [](const Settings& s) -> Made {
       return std::make_unique<MemoryBased>(s.position_resolution_m);
     }},
    {"input_to_state",
     [](const Settings& s) -> Made {
       return std::make_unique<InputToState>(s.time_constant_s > 0.0 ? s.time_constant_s
                                                                     : 1.5 * period_s(s));
     }},
    {"two_port",
     [](const Settings& s) -> Made {
       return std::make_unique<TwoPort>(passivity(s, Observer::kSampled));
     }},
    {"energy_tank",
     [](const Settings& s) -> Made {
       return std::make_unique<EnergyTank>(
           EnergyTankParameters{.initial_joule = s.tank_initial_joule,
                                .most_joule = s.tank_most_joule,
                                .valve_joule = s.tank_valve_joule,
                                .damping = s.tank_damping_newton_s_per_m});
     }},
    {"lyapunov",
     [](const Settings& s) -> Made {
       return std::make_unique<LyapunovLimiter>(
           LyapunovParameters{.T = period_s(s),
                              .least_mass = s.least_mass_kg,
                              .most_mass = s.most_mass_kg,
                              .hand_force = s.hand_force_newton,
                              .slack_watt = s.slack_watt});
     }},
}};

template <double Settings::*member>
constexpr SettingEntry entry(const char* name, const char* unit, bool is_least_open,
                             bool (*holds)(const Settings&) = nullptr, const char* rule = nullptr) {
  return {.name = name,
          .unit = unit,
          .get = [](const Settings& s) { return s.*member; },
          .set = [](Settings& s, double value) { s.*member = value; },
          .least = 0.0,
          .is_least_open = is_least_open,
          .holds = holds,
          .rule = rule};
}

template <Vector3 AxisFriction::*member, int axis>
constexpr SettingEntry axis_entry(const char* name, const char* unit) {
  return {.name = name,
          .unit = unit,
          .get = [](const Settings& s) { return s.per_axis ? ((*s.per_axis).*member)[axis] : 0.0; },
          .set =
              [](Settings& s, double value) {
                if (!s.per_axis) s.per_axis.emplace();
                ((*s.per_axis).*member)[axis] = value;
              },
          .least = 0.0,
          .is_least_open = false};
}

constexpr bool kPositive = true;
constexpr bool kNotNegative = false;

bool tank_fits(const Settings& s) {
  return s.tank_initial_joule <= s.tank_most_joule && s.tank_valve_joule <= s.tank_most_joule;
}
constexpr const char* kTankRule =
    "must leave tank_initial_joule and tank_valve_joule ≤ tank_most_joule";
bool masses_fit(const Settings& s) { return s.least_mass_kg <= s.most_mass_kg; }
constexpr const char* kMassRule = "must leave least_mass_kg ≤ most_mass_kg";

constexpr std::array<SettingEntry, 32> kSettings{{
    entry<&Settings::rate_hz>("rate_hz", "Hz", kPositive),
    entry<&Settings::viscous_newton_s_per_m>("viscous_newton_s_per_m", "N·s/m", kNotNegative),
    entry<&Settings::coulomb_newton>("coulomb_newton", "N", kNotNegative),
    axis_entry<&AxisFriction::f_d, 0>("viscous_x_newton_s_per_m", "N·s/m"),
    axis_entry<&AxisFriction::f_d, 1>("viscous_y_newton_s_per_m", "N·s/m"),
    axis_entry<&AxisFriction::f_d, 2>("viscous_z_newton_s_per_m", "N·s/m"),
    axis_entry<&AxisFriction::f_co, 0>("coulomb_x_newton", "N"),
    axis_entry<&AxisFriction::f_co, 1>("coulomb_y_newton", "N"),
    axis_entry<&AxisFriction::f_co, 2>("coulomb_z_newton", "N"),
    entry<&Settings::position_resolution_m>("position_resolution_m", "m", kNotNegative),
    entry<&Settings::peak_force_newton>("peak_force_newton", "N", kPositive),
    entry<&Settings::lease_s>("lease_s", "s", kPositive),
    entry<&Settings::longest_lease_s>("longest_lease_s", "s", kNotNegative),
    entry<&Settings::delta_max_s>("delta_max_s", "s", kNotNegative),
    entry<&Settings::safety_net>("safety_net", "1", kNotNegative),
    entry<&Settings::v_max_m_per_s>("v_max_m_per_s", "m/s", kPositive),
    entry<&Settings::credit_cap_joule>("credit_cap_joule", "J", kPositive),
    entry<&Settings::gate_joule>("gate_joule", "J", kPositive),
    entry<&Settings::gate_recovery_s>("gate_recovery_s", "s", kPositive),
    entry<&Settings::coupling_stiffness_newton_per_m>("coupling_stiffness_newton_per_m", "N/m",
                                                      kNotNegative),
    entry<&Settings::coupling_damping_newton_s_per_m>("coupling_damping_newton_s_per_m", "N·s/m",
                                                      kNotNegative),
    entry<&Settings::most_damping_newton_s_per_m>("most_damping_newton_s_per_m", "N·s/m",
                                                  kPositive),
    entry<&Settings::least_speed_m_per_s>("least_speed_m_per_s", "m/s", kPositive),
    entry<&Settings::time_constant_s>("time_constant_s", "s", kNotNegative),
    entry<&Settings::tank_initial_joule>("tank_initial_joule", "J", kNotNegative, tank_fits,
                                         kTankRule),
    entry<&Settings::tank_most_joule>("tank_most_joule", "J", kPositive, tank_fits, kTankRule),
    entry<&Settings::tank_valve_joule>("tank_valve_joule", "J", kPositive, tank_fits, kTankRule),
    entry<&Settings::tank_damping_newton_s_per_m>("tank_damping_newton_s_per_m", "N·s/m",
                                                  kNotNegative),
    entry<&Settings::least_mass_kg>("least_mass_kg", "kg", kPositive, masses_fit, kMassRule),
    entry<&Settings::most_mass_kg>("most_mass_kg", "kg", kPositive, masses_fit, kMassRule),
    entry<&Settings::hand_force_newton>("hand_force_newton", "N", kNotNegative),
    entry<&Settings::slack_watt>("slack_watt", "W", kNotNegative),
}};

}  // namespace

std::span<const SettingEntry> setting_catalogue() noexcept { return kSettings; }
std::span<const ControllerEntry> controller_catalogue() noexcept {
  static const auto all = [] {
    std::array<ControllerEntry, kOwnControllers + kRivals.size()> both{};
    const auto rest = std::copy(own_controllers().begin(), own_controllers().end(), both.begin());
    std::copy(kRivals.begin(), kRivals.end(), rest);
    return both;
  }();
  return all;
}

std::unique_ptr<ForceController> make_named(std::string_view name, const Settings& settings) {
  if (Made own = make_own(name, settings)) return own;
  const auto rival = std::find_if(kRivals.begin(), kRivals.end(),
                                  [&](const ControllerEntry& e) { return e.name == name; });
  Made made;
  if (rival != kRivals.end()) made = rival->make(settings);
  if (name == "wave_variables") {
    made = std::make_unique<WaveVariables>(WaveVariablesParameters{
        .b = settings.wave_impedance_newton_s_per_m, .T = period_s(settings)});
  }
  return with_safety_net(std::move(made), settings);
}

}  // namespace palpate::controllers
