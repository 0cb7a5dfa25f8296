// SPDX-License-Identifier: Apache-2.0
// falcon_emulator.h — stands in for a Novint Falcon on USB: its FTDI chip, its boot loader and its
// firmware.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "common/session/driver_config.h"
#include "device_node/drivers/falcon/falcon_wire.h"
#include "device_node/drivers/transport/usb_port.h"
#include "device_node/emulators/packet_listener.h"

namespace palpate::device {

struct FalconEmulatorState {
  bool is_loaded = true;                           ///< firmware runs
  Duration homing = std::chrono::milliseconds(0);  ///< time that a person takes to home it
};

class FalconEmulator {
 public:
  using State = FalconEmulatorState;
  /// @param config  gain and frame of the device, and the socket
  /// @throws SetupError  no socket can be made there
  FalconEmulator(EmulatedDevice& device, const FalconConfig& config, const State& state);

  /// Serves until the stop.
  void run(const std::stop_token& stop);
  /// Firmware loaded so far [bytes]: the last image only.
  [[nodiscard]] const std::vector<std::byte>& image() const noexcept { return image_; }

 private:
  using Steady = std::chrono::steady_clock;

  void serve(PacketPort& client, const std::stop_token& stop);
  /// @return  false: the client broke the rules of the wire
  bool take(PacketPort& client, std::span<const std::byte> packet);
  void control(std::uint8_t request, std::uint16_t value);
  void take_byte(std::byte byte);
  void boot(std::byte byte);
  void answer(const FalconMessage& command);
  void send_from_device(std::span<const std::byte> bytes);
  /// What the chip passes on now, if the host asks for it.
  void flush(PacketPort& client);
  void place(const DeviceSample& sample);
  /// Of motors while the grip is there.
  [[nodiscard]] Vector3 force_newton(const FalconCounts& motors, const Vector3& grip_m,
                                     const Vector3& angles_rad) const;
  DeviceSample move(const FalconCounts& motors);

  EmulatedDevice& device_;
  FalconConfig config_;
  State state_;
  PacketListener listener_;

  // the chip
  std::uint16_t divisor_ = 0;
  std::uint16_t event_ = 0;
  std::chrono::milliseconds latency_{16};
  bool is_dtr_high_ = false;
  bool is_asked_ = false;  // the host waits for a packet
  std::byte tag_{};
  Steady::time_point flushed_at_;
  bool has_event_ = false;
  std::vector<std::byte> to_host_;
  std::vector<std::byte> later_;  // in the packet after that

  // the boot loader
  bool is_booting_ = false;
  std::vector<std::byte> greeting_;
  std::vector<std::byte> image_;

  // the firmware
  std::vector<std::byte> command_;
  std::optional<double> homing_since_s_;  // of the device's clock, like State::homing
  FalconCounts encoders_{};
  Vector3 grip_m_;  // as the encoders say, frame of the device
};

}  // namespace palpate::device
