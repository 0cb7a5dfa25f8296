// SPDX-License-Identifier: Apache-2.0
// device_claim.h — one process drives a device.
#pragma once

#include <string>

#include "common/session/driver_config.h"

namespace palpate::device {

/// Where the device of a session is: "hapi /dev/ttyACM0". Two sessions that name the same device
/// in other words, such as the only one and its identifier, have different ones. "": of a simulated
/// device, and of a plug-in, whose library alone knows it.
[[nodiscard]] std::string place_of(const DriverConfig& driver);

/// Two processes at one device would each count the work of the hand for itself, and not know the
/// other's force. While this exists no other process of this machine, and no other user, has a
/// claim on the place. It ends with the process, however that ends. An abstract socket: processes
/// in another network namespace, such as a container's, do not see it.
class DeviceClaim {
 public:
  /// @throws SetupError  another process has it
  explicit DeviceClaim(const std::string& place);
  ~DeviceClaim();
  DeviceClaim(const DeviceClaim&) = delete;
  DeviceClaim& operator=(const DeviceClaim&) = delete;

 private:
  int socket_ = -1;
};

}  // namespace palpate::device
