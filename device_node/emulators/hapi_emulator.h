// SPDX-License-Identifier: Apache-2.0
// hapi_emulator.h — stands in for a pantograph on a hAPI board, behind a pseudo-terminal. Its
// counters begin anew with each set-up, as in the public firmware.
#pragma once

#include <atomic>
#include <stop_token>
#include <string>

#include "common/session/driver_config.h"
#include "device_node/drivers/hapi/pantograph.h"
#include "device_node/drivers/transport/serial_port.h"
#include "device_node/emulators/emulated_device.h"
#include "device_node/emulators/pseudo_terminal.h"

namespace palpate::device {

class HapiEmulator {
 public:
  /// @param config  geometry, encoders, gain and frame of the board; its port is not read
  /// @throws SetupError  no pseudo-terminal to be had
  HapiEmulator(EmulatedDevice& device, const HapiConfig& config);
  HapiEmulator(const HapiEmulator&) = delete;
  HapiEmulator& operator=(const HapiEmulator&) = delete;

  /// What a driver opens.
  [[nodiscard]] const std::string& port() const noexcept { return terminal_.name(); }
  /// Set-ups so far.
  [[nodiscard]] int set_ups() const noexcept { return set_ups_; }
  /// Serves until the stop.
  void run(const std::stop_token& stop);

 private:
  void set_up();
  void place(const DeviceSample& sample);
  void answer(const std::byte* message);
  /// Of what the board was sent, as in the public firmware: scaled to its largest torque, in its
  /// steps.
  [[nodiscard]] Vector2 made_torque_newton_m(Vector2 sent) const;
  DeviceSample move(const Vector2& torque_newton_m);
  /// What these torques make where the arms are at these angles.
  [[nodiscard]] Vector3 force_newton(const Vector2& torque_newton_m,
                                     const Vector2& angles_rad) const;

  EmulatedDevice& device_;
  HapiConfig config_;
  Pantograph links_;
  PseudoTerminal terminal_;
  SerialPort line_;
  Vector2 angles_rad_;          // true ones
  Vector2 zero_rad_{0.0, 0.0};  // what the board's angles are off by
  bool is_set_up_ = false;
  std::atomic<int> set_ups_ = 0;
};

}  // namespace palpate::device
