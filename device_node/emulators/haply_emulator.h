// SPDX-License-Identifier: Apache-2.0
// haply_emulator.h — stands in for Haply's Inverse Service and an Inverse3 with a wireless grip:
// the same WebSocket messages (service 3.5; forces of 3.1's dialect are taken too).
#pragma once

#include <cstdint>
#include <stop_token>
#include <string>

#include "device_node/emulators/emulated_device.h"

namespace palpate::device {

class WebSocket;

/// One client at a time; a second waits for the end of the first.
class HaplyEmulator {
 public:
  /// @param port  on 127.0.0.1; 0: any free one
  /// @throws SetupError  the port is in use
  HaplyEmulator(EmulatedDevice& device, std::uint16_t port);
  ~HaplyEmulator();
  HaplyEmulator(const HaplyEmulator&) = delete;
  HaplyEmulator& operator=(const HaplyEmulator&) = delete;

  [[nodiscard]] std::uint16_t port() const noexcept { return port_; }
  /// Serves until the stop.
  void run(const std::stop_token& stop);

  static constexpr const char* kDeviceId = "049D";
  static constexpr const char* kGripId = "61576";

 private:
  void serve(int socket, const std::stop_token& stop);
  /// @return  whether the client is still there
  bool send(WebSocket& client, const std::string& answer);

  EmulatedDevice& device_;
  std::string last_answer_;
  int listener_ = -1;
  std::uint16_t port_ = 0;
};

}  // namespace palpate::device
