// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "common/session/file/convert.h"

namespace palpate {

namespace {

MotorLimits to_motors(const Fields& motors) {
  const MotorLimits limits{.peak_force_newton = motors.number("peak_force_newton"),
                           .continuous_force_newton = motors.number("continuous_force_newton"),
                           .thermal_time_s = motors.number("thermal_time_s")};
  if (limits.continuous_force_newton > limits.peak_force_newton) {
    motors.problem("continuous_force_newton",
                   "must be ≤ peak_force_newton; give the peak force if the device has only one");
  }
  return limits;
}

/// Fields that the drivers share by name.
template <class Config>
void read_common(const Fields& driver, Config& config) {
  const Fields mount = driver.message("mount");
  config.origin_m = mount.vector("origin_m");
  config.rotation = mount.rotation("rotation_rad");
  config.workspace_half_extent_m = mount.vector("workspace_half_extent_m");
  config.limits = to_motors(driver.message("motors"));
  config.position_resolution_m = driver.number("position_resolution_m");
  config.transfer_limit = driver.milliseconds("transfer_limit_ms");
}

HaplyConfig to_haply(const Fields& haply) {
  HaplyConfig config;
  read_common(haply, config);
  if (haply.has("host")) config.host = haply.text("host");
  config.port = static_cast<std::uint16_t>(haply.integer("port"));
  config.device_id = haply.text("device_id");
  config.grip_id = haply.text("grip_id");
  config.writes_values = haply.enumerator("dialect") == 2;
  // they are written into messages as they stand
  for (const char* name : {"device_id", "grip_id"}) {
    if (haply.text(name).find_first_of("\"\\") != std::string::npos ||
        haply.text(name).size() > 64) {
      haply.problem(name,
                    "must have at most 64 characters and neither quotes nor backslashes; "
                    "give the id that the Inverse Service shows");
    }
  }
  return config;
}

HapiConfig to_hapi(const Fields& hapi) {
  HapiConfig config;
  read_common(hapi, config);
  if (hapi.has_required("port")) config.port = hapi.text("port");
  config.device_id = static_cast<std::uint32_t>(hapi.integer("device_id"));
  std::size_t i = 0;
  for (const char* name : {"left", "right"}) {
    const Fields axis = hapi.message(name);
    config.motor_ports[i] = static_cast<std::uint32_t>(axis.integer("motor_port"));
    config.are_motors_reversed[i] = axis.flag("motor_reversed");
    config.encoder_ports[i] = static_cast<std::uint32_t>(axis.integer("encoder_port"));
    config.are_encoders_reversed[i] = axis.flag("encoder_reversed");
    config.encoder_offsets_deg[i] = axis.number("encoder_offset_deg");
    ++i;
  }
  for (const auto& [ports, name] :
       {std::pair{&config.motor_ports, "motor_port"}, {&config.encoder_ports, "encoder_port"}}) {
    const Fields right = hapi.message("right");
    if ((*ports)[0] == (*ports)[1] && right.has(name)) {
      right.problem(name, "must differ from that of left; give the port of the other motor");
    }
  }
  config.encoder_resolution = hapi.number("encoder_resolution");
  config.arm_m = hapi.number("arm_m");
  config.rod_m = hapi.number("rod_m");
  config.base_m = hapi.number("base_m");
  config.torque_gain = hapi.number("torque_gain");
  config.largest_torque_newton_m = hapi.number("largest_torque_newton_m");
  config.torque_step_newton_m = hapi.number("torque_step_newton_m");
  if (config.torque_step_newton_m > config.largest_torque_newton_m) {
    hapi.problem("torque_step_newton_m",
                 "must not be larger than largest_torque_newton_m; give the step of the firmware");
  }
  return config;
}

FalconConfig to_falcon(const Fields& falcon, const std::filesystem::path& base_dir) {
  FalconConfig config;
  read_common(falcon, config);
  config.port = falcon.text("port");
  if (falcon.has("firmware_file")) {
    config.firmware_file = falcon.file("firmware_file", base_dir).string();
  }
  config.torque_gain = falcon.number("torque_gain");
  if (config.torque_gain == 0.0) {
    falcon.problem("torque_gain", "must not be 0; measure it with a known weight on the grip");
  }
  config.largest_torque = static_cast<int>(falcon.integer("largest_torque"));
  config.encoder_offset_deg = falcon.number("encoder_offset_deg");
  return config;
}

WoodenConfig to_wooden(const Fields& wooden) {
  WoodenConfig config;
  read_common(wooden, config);
  config.port = wooden.text("port");
  std::size_t i = 0;
  for (const char* name : {"a", "b", "c"}) {
    const Fields axis = wooden.message(name);
    config.torque_constants_newton_m_per_a[i] = axis.number("torque_constant_newton_m_per_a");
    config.are_reversed[i] = axis.flag("reversed");
    config.capstans_m[i] = axis.number("capstan_m");
    config.drums_m[i] = axis.number("drum_m");
    config.encoder_resolutions[i] = axis.number("encoder_resolution");
    // NaN: a problem already
    const double count = axis.number("calibration_count");
    if (count == std::round(count)) {
      config.calibration_counts[i] = static_cast<std::int16_t>(count);
    } else if (!std::isnan(count)) {
      axis.problem("calibration_count", "must be a whole number; round it");
    }
    ++i;
  }
  config.base_m = wooden.number("base_m");
  config.arm_m = wooden.number("arm_m");
  config.rod_m = wooden.number("rod_m");
  config.largest_current_a = wooden.number("largest_current_a");
  config.is_calibrated = wooden.flag("is_calibrated");
  return config;
}

PluginConfig to_plugin(const Fields& plugin, const std::filesystem::path& base_dir) {
  PluginConfig config;
  if (plugin.has_required("library")) {
    config.library = plugin.text("library");
    if (config.library.find('/') != std::string::npos) {
      config.library =
          std::filesystem::absolute(base_dir / config.library).lexically_normal().string();
    }
  }
  config.options = plugin.text("options");
  return config;
}

template <class Config>
void limit_as(const Config& config, SimulatedDeviceConfig& simulated) {
  simulated.peak_force_newton = config.limits.peak_force_newton;
  simulated.position_resolution_m = config.position_resolution_m;
}

}  // namespace

DriverConfig to_driver(const Fields& device, const std::filesystem::path& base_dir) {
  const std::string name = device.given_member("driver");
  if (name == "haply_inverse") return to_haply(device.message("haply_inverse"));
  if (name == "hapi") return to_hapi(device.message("hapi"));
  if (name == "falcon") return to_falcon(device.message("falcon"), base_dir);
  if (name == "wooden") return to_wooden(device.message("wooden"));
  if (name == "plugin") return to_plugin(device.message("plugin"), base_dir);
  return {};
}

double declared_step_m(const DriverConfig& driver) {
  return std::visit(
      [](const auto& own) {
        if constexpr (requires { own.position_resolution_m; }) {
          return std::isnan(own.position_resolution_m) ? 0.0 : own.position_resolution_m;
        } else {
          return 0.0;
        }
      },
      driver);
}

SimulatedDeviceConfig simulated_as(const DriverConfig& driver,
                                   const SimulatedDeviceConfig& simulated) {
  SimulatedDeviceConfig config = simulated;
  std::visit(
      [&](const auto& own) {
        if constexpr (requires { own.limits; }) limit_as(own, config);
      },
      driver);
  return config;
}

SimulatedDeviceConfig with_friction_of(const DeviceProfile& profile,
                                       SimulatedDeviceConfig simulated) {
  simulated.viscous_newton_s_per_m = profile.viscous_newton_s_per_m;
  simulated.coulomb_newton = profile.coulomb_newton;
  simulated.per_axis = profile.per_axis;
  return simulated;
}

}  // namespace palpate
