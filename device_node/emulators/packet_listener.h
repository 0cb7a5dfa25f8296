// SPDX-License-Identifier: Apache-2.0
// packet_listener.h — the socket that a driver finds where it would find a device's file.
#pragma once

#include <stop_token>
#include <string>

#include "device_node/drivers/transport/packet_port.h"
#include "device_node/emulators/emulated_device.h"

namespace palpate::device {

/// One client at a time; a second waits for the end of the first.
class PacketListener {
 public:
  /// @param field  "device.falcon.port" or "--leader", for what is in the way
  /// @throws SetupError  `path` cannot be a socket: too long, or something else is there
  PacketListener(const std::string& path, const std::string& field);
  ~PacketListener();
  PacketListener(const PacketListener&) = delete;
  PacketListener& operator=(const PacketListener&) = delete;

  [[nodiscard]] const std::string& path() const noexcept { return path_; }

  /// Accepts clients until the stop, and calls `serve(port)` for each.
  /// @param wait  called where none comes for a while
  template <class Serve, class Wait>
  void run(const std::stop_token& stop, const Serve& serve, const Wait& wait) {
    while (!stop.stop_requested()) {
      const int socket = accept();
      if (socket < 0) {
        wait();
        continue;
      }
      PacketPort client(socket);
      serve(client);
    }
  }

  /// The same for a USB device, which says what it is first.
  /// While the device is unplugged, none is accepted; while it has a wrong id, it says so.
  template <class Serve>
  void run(EmulatedDevice& device, const UsbIds& ids, const std::stop_token& stop,
           const Serve& serve) {
    const auto serve_device = [&](PacketPort& client) {
      const WireFault fault = device.fault();
      if (fault == WireFault::kUnplugged) return;
      const UsbIds said = fault == WireFault::kWrongId ? UsbIds{0xFFFF, 0xFFFF} : ids;
      if (client.send_ids(said) == Transfer::kDone) serve(client);
      device.let_go();
    };
    run(stop, serve_device, [] {});
  }

 private:
  /// @return  -1: nobody within 50 ms
  [[nodiscard]] int accept() const noexcept;

  std::string path_;
  int listener_ = -1;
};

}  // namespace palpate::device
