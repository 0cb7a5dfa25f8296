// SPDX-License-Identifier: Apache-2.0
// device_server.h — the end of the Unix socket at which the plug-in in device_node asks. Only one
// of the same user is served, one at a time.
#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "common/core/time.h"
#include "deploy/ros/device/device_wire.h"

namespace palpate::ros {

class DeviceServer {
 public:
  /// Makes the socket, which only this user can open; one that nobody serves any more is replaced.
  /// @throws SetupError  no socket can be made there, or another program serves it
  explicit DeviceServer(const std::string& path);
  ~DeviceServer();
  DeviceServer(const DeviceServer&) = delete;
  DeviceServer& operator=(const DeviceServer&) = delete;

  /// Serves whoever asks and waits for a force: of several the newest. By one thread.
  [[nodiscard]] std::optional<ros_device_force> receive(Duration wait);
  /// Left out if nobody asks, or does not read. By any thread.
  void send(const ros_device_pose& pose) noexcept;
  [[nodiscard]] bool has_peer() const;
  /// Why somebody was not served, since the last call; empty: nobody. By the thread of receive().
  [[nodiscard]] std::string take_refusal() { return std::exchange(refusal_, {}); }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  void accept_peer();
  void hang_up();

  const std::string path_;
  int lock_ = -1;  // of a file beside it, as long as this program serves, stopped or not
  int listener_ = -1;
  std::string refusal_;
  mutable std::mutex mutex_;
  int peer_ = -1;
};

}  // namespace palpate::ros
