// SPDX-License-Identifier: Apache-2.0
// wooden_emulator.h — stands in for a WoodenHaptics board and its open firmware, as HID reports
// over a socket.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <stop_token>

#include "common/session/driver_config.h"
#include "device_node/drivers/wooden/wooden_driver.h"
#include "device_node/drivers/wooden/wooden_wire.h"
#include "device_node/emulators/packet_listener.h"

namespace palpate::device {

class WoodenEmulator {
 public:
  /// After so long without a message the firmware ends the force.
  static constexpr Duration kWatchdog = std::chrono::milliseconds(500);

  /// @param config  drive and frame of the device, and the socket
  /// @throws SetupError  no socket can be made there
  WoodenEmulator(EmulatedDevice& device, const WoodenConfig& config);

  /// The person presses the board's button. Any thread.
  void press() noexcept { was_button_pressed_ = true; }
  /// Serves until the stop.
  void run(const std::stop_token& stop);

 private:
  void serve(PacketPort& client, const std::stop_token& stop);
  void take(const WoodenCommand& command);
  /// Of currents while the arm is there.
  [[nodiscard]] Vector3 force_newton(const Vector3& ma, const Vector3& angles_rad) const;
  /// What calibrated counters show.
  [[nodiscard]] std::array<std::int32_t, kWoodenAxes> raw_counts(const Vector3& hand_m) const;
  [[nodiscard]] WoodenReading reading() const;
  /// Who holds the handle at the calibration position and presses the board's button.
  [[nodiscard]] bool is_person_there() const { return !config_.is_calibrated && !has_lost_power_; }

  EmulatedDevice& device_;
  WoodenConfig config_;
  WoodenDrive drive_;
  PacketListener listener_;
  DeviceSample sample_;
  std::array<std::int32_t, kWoodenAxes> raw_{};
  std::array<std::int32_t, kWoodenAxes> zero_{};  // raw counts where the counters are 0
  std::atomic<bool> was_button_pressed_ = false;
  bool has_lost_power_ = false;  // nobody presses the button since then
};

}  // namespace palpate::device
