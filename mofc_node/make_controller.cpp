// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/make_controller.h"

#include <dlfcn.h>

#include <filesystem>
#include <string>

#include "common/core/check.h"
#include "common/core/version.h"
#include "mofc_node/controllers/named/own_controllers.h"

namespace palpate::mofc {

namespace {

namespace fs = std::filesystem;
using controllers::ControllerSettings;
using controllers::ForceController;

ControllerSettings settings_of(const MofcConfig& mofc, const ClampedDevice& device) {
  const DeviceProfile& profile = device.profile;
  const RivalsConfig& rivals = mofc.rivals;
  ControllerSettings settings{
      .rate_hz = device.rate_hz,
      .viscous_newton_s_per_m = profile.viscous_newton_s_per_m,
      .coulomb_newton = profile.coulomb_newton,
      .position_resolution_m = profile.position_resolution_m,
      .peak_force_newton = device.peak_force_newton,
      .lease_s = to_seconds(device.lease),
      .longest_lease_s = to_seconds(device.longest_lease),
      .delta_max_s = to_seconds(device.reply),
      .prompt_s = to_seconds(device.prompt),
      .safety_net = mofc.has_safety_net ? 1.0 : 0.0,
      .v_max_m_per_s = mofc.guard.v_max_m_per_s,
      .credit_cap_joule = mofc.guard.credit_cap_joule,
      .gate_joule = mofc.guard.gate_joule,
      .gate_recovery_s = to_seconds(mofc.guard.gate_recovery),
      .coupling_stiffness_newton_per_m = rivals.virtual_coupling.stiffness_newton_per_m,
      .coupling_damping_newton_s_per_m = rivals.virtual_coupling.damping_newton_s_per_m,
      .most_damping_newton_s_per_m = rivals.passivity_control.most_damping_newton_s_per_m,
      .least_speed_m_per_s = rivals.passivity_control.least_speed_m_per_s,
      .time_constant_s = to_seconds(rivals.input_to_state.time_constant),
      .tank_initial_joule = rivals.energy_tank.initial_joule,
      .tank_most_joule = rivals.energy_tank.most_joule,
      .tank_valve_joule = rivals.energy_tank.valve_joule,
      .tank_damping_newton_s_per_m = rivals.energy_tank.damping_newton_s_per_m,
      .least_mass_kg = rivals.lyapunov.least_mass_kg,
      .most_mass_kg = rivals.lyapunov.most_mass_kg,
      .hand_force_newton = rivals.lyapunov.hand_force_newton,
      .slack_watt = rivals.lyapunov.slack_watt,
      .wave_impedance_newton_s_per_m = rivals.wave_variables.impedance_newton_s_per_m};
  if (profile.per_axis) {
    settings.per_axis = controllers::AxisFriction{.f_d = profile.per_axis->viscous_newton_s_per_m,
                                                  .f_co = profile.per_axis->coulomb_newton};
  }
  return settings;
}

const char* mofc_name(const MofcConfig& mofc) {
  switch (mofc.mode) {
    case MofcMode::kPaper:
      return mofc.paper_friction == PaperFriction::kIsotropic ? "paper_isotropic" : "paper";
    case MofcMode::kVector:
      return "vector";
    case MofcMode::kGuard:
      break;
  }
  return "guard";
}

const char* passivity_name(const PassivityControlConfig& config) {
  switch (config.observer) {
    case PassivityControlConfig::Observer::kProduct:
      return "passivity_control_product";
    case PassivityControlConfig::Observer::kReference:
      return "passivity_control_reference";
    case PassivityControlConfig::Observer::kSampled:
      break;
  }
  return "passivity_control";
}

/// In the catalogue of the controllers.
const char* catalogue_name(const MofcConfig& mofc) {
  const RivalsConfig& rivals = mofc.rivals;
  switch (mofc.controller) {
    case ControllerKind::kNone:
      break;
    case ControllerKind::kMofc:
      return mofc_name(mofc);
    case ControllerKind::kVirtualCoupling:
      return rivals.virtual_coupling.criterion == VirtualCouplingConfig::Criterion::kSampledData
                 ? "virtual_coupling_sampled_data"
                 : "virtual_coupling";
    case ControllerKind::kEnergyBounding:
      return "energy_bounding";
    case ControllerKind::kForceBounding:
      return rivals.force_bounding.is_more_conservative ? "force_bounding"
                                                        : "force_bounding_less_conservative";
    case ControllerKind::kPassivityControl:
      return passivity_name(rivals.passivity_control);
    case ControllerKind::kMemoryBased:
      return "memory_based";
    case ControllerKind::kInputToState:
      return "input_to_state";
    case ControllerKind::kTwoPort:
      return "two_port";
    case ControllerKind::kEnergyTank:
      return "energy_tank";
    case ControllerKind::kLyapunov:
      return "lyapunov";
    case ControllerKind::kWaveVariables:
      return "wave_variables";
  }
  return "none";
}

/// From rivals_library.cpp, which is loaded now and stays.
std::unique_ptr<ForceController> make_rival(const char* name, const ControllerSettings& settings) {
  const std::string file = rivals_library();
  const auto refuse = [&](const std::string& why) {
    throw SetupError("mofc.controller = " + std::string(name) + " is in a library: " + why +
                     "; install the package again, or in a build folder build the target "
                     "palpate_rivals");
  };
  void* const library = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (library == nullptr) refuse(dlerror());
  const auto version_of =
      reinterpret_cast<decltype(&version)>(dlsym(library, "palpate_rivals_version"));
  const auto make = reinterpret_cast<ForceController* (*)(const char*, const ControllerSettings&)>(
      dlsym(library, "palpate_make_rival"));
  if (version_of == nullptr || make == nullptr || std::string(version_of()) != version()) {
    refuse(file + " is of another build");
  }
  return std::unique_ptr<ForceController>(make(name, settings));
}

}  // namespace

fs::path rivals_library() {
  const fs::path prefix = fs::read_symlink("/proc/self/exe").parent_path().parent_path();
  return prefix / "lib/palpate/palpate_rivals.so";
}

std::unique_ptr<ForceController> make_controller(const MofcConfig& mofc,
                                                 const ClampedDevice& device) {
  const char* const name = catalogue_name(mofc);
  const ControllerSettings settings = settings_of(mofc, device);
  std::unique_ptr<ForceController> controller = controllers::make_own(name, settings);
  if (controller == nullptr) controller = make_rival(name, settings);
  PALPATE_REQUIRE(controller != nullptr);
  return controller;
}

}  // namespace palpate::mofc
