// SPDX-License-Identifier: Apache-2.0
// driver_config.h — which device a device_node opens, and how.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>
#include <variant>

#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/session/simulation_config.h"

namespace palpate {

/// What the motors of a real device may do.
struct MotorLimits {
  double peak_force_newton = 0.0;        ///< |F| for moments
  double continuous_force_newton = 0.0;  ///< |F| without a time limit; ≤ peak
  double thermal_time_s = 30.0;          ///< time constant of the windings
};

/// Haply Inverse3 by the Inverse Service.
struct HaplyConfig {
  std::string host = "127.0.0.1";
  std::uint16_t port = 10001;
  std::string device_id;                         ///< "": the only one
  std::string grip_id;                           ///< "": the only one, if there is one
  bool writes_values = false;                    ///< the dialect of services before 3.5
  Vector3 origin_m = Vector3::Zero();            ///< of D, in the frame of the service
  Quaternion rotation = Quaternion::Identity();  ///< of the service's frame, in D
  Vector3 workspace_half_extent_m = Vector3::Zero();
  MotorLimits limits;
  double position_resolution_m = 0.0;
  Duration transfer_limit = std::chrono::milliseconds(20);  ///< a later answer is a fault
};

/// A pantograph on a hAPI board: force in the plane of its links only.
struct HapiConfig {
  std::string port;  ///< a serial port, such as /dev/ttyACM0
  std::uint32_t device_id = 5;
  std::array<std::uint32_t, 2> motor_ports{1, 2};
  std::array<bool, 2> are_motors_reversed{false, true};
  std::array<std::uint32_t, 2> encoder_ports{1, 2};
  std::array<bool, 2> are_encoders_reversed{false, true};
  std::array<double, 2> encoder_offsets_deg{180.0, 0.0};
  double encoder_resolution = 13824.0;  ///< counts a turn
  double arm_m = 0.05;
  double rod_m = 0.07;
  double base_m = 0.02;
  double torque_gain = 0.0;                      ///< what the board is sent per N·m
  double largest_torque_newton_m = 0.156;        ///< that the board makes, as it is sent
  double torque_step_newton_m = 1.525e-4;        ///< likewise
  Vector3 origin_m = Vector3::Zero();            ///< of D, in the frame of the links
  Quaternion rotation = Quaternion::Identity();  ///< of the links' frame (x right, y away), in D
  Vector3 workspace_half_extent_m = Vector3::Zero();
  MotorLimits limits;
  double position_resolution_m = 0.0;
  Duration transfer_limit = std::chrono::milliseconds(20);  ///< a later answer is a fault
};

/// Novint Falcon by USB.
struct FalconConfig {
  std::string port;           ///< "": the only one
  std::string firmware_file;  ///< absolute; "": it is loaded already
  double torque_gain = 0.0;   ///< what a motor is sent per N·m; may be negative, not 0
  int largest_torque = 4096;
  double encoder_offset_deg = 35.0;
  Vector3 origin_m = Vector3::Zero();            ///< of D, in the frame of the device
  Quaternion rotation = Quaternion::Identity();  ///< of the device's frame, in D
  Vector3 workspace_half_extent_m = Vector3::Zero();
  MotorLimits limits;
  double position_resolution_m = 0.0;
  Duration transfer_limit = std::chrono::milliseconds(20);  ///< a later answer is a fault
};

/// WoodenHaptics by HID. Axes a, b, c.
struct WoodenConfig {
  std::string port;  ///< "": the only one
  std::array<double, 3> torque_constants_newton_m_per_a{};
  std::array<bool, 3> are_reversed{};
  std::array<double, 3> capstans_m{0.01, 0.01, 0.01};
  std::array<double, 3> drums_m{0.16, 0.12, 0.12};
  std::array<double, 3> encoder_resolutions{2000.0, 2000.0, 2000.0};  ///< counts a turn
  std::array<std::int16_t, 3> calibration_counts{};
  double base_m = 0.08;
  double arm_m = 0.205;
  double rod_m = 0.245;
  double largest_current_a = 0.0;
  bool is_calibrated = false;                    ///< the counters are set already
  Vector3 origin_m = Vector3::Zero();            ///< of D, in the frame of the device
  Quaternion rotation = Quaternion::Identity();  ///< of the device's frame, in D
  Vector3 workspace_half_extent_m = Vector3::Zero();
  MotorLimits limits;
  double position_resolution_m = 0.0;
  Duration transfer_limit = std::chrono::milliseconds(20);  ///< a later answer is a fault
};

/// A driver in a shared library: device_node/drivers/plugin/palpate_device.h.
struct PluginConfig {
  std::string library;      ///< absolute
  std::string options;      ///< passed to its open()
  bool uses_wrist = false;  ///< device.wrist is that of the library
};

/// monostate: the simulated device.
using DriverConfig =
    std::variant<std::monostate, HaplyConfig, HapiConfig, FalconConfig, WoodenConfig, PluginConfig>;

/// Whether the driver is one of a real device.
[[nodiscard]] inline bool is_real(const DriverConfig& driver) {
  return !std::holds_alternative<std::monostate>(driver);
}

/// Half the workspace of the device, D; nothing where the driver alone knows it.
[[nodiscard]] inline std::optional<Vector3> workspace_half_extent_m(const DriverConfig& driver) {
  return std::visit(
      [](const auto& config) -> std::optional<Vector3> {
        using Config = std::decay_t<decltype(config)>;
        if constexpr (std::is_same_v<Config, std::monostate>) {
          return kSimulatedHalfExtent_m;
        } else if constexpr (std::is_same_v<Config, PluginConfig>) {
          return std::nullopt;
        } else {
          return config.workspace_half_extent_m;
        }
      },
      driver);
}

}  // namespace palpate
