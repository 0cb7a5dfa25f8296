// SPDX-License-Identifier: Apache-2.0
// conform_device.h — does a device keep what device_node and the hand rely on?
#pragma once

#include <chrono>
#include <optional>
#include <vector>

#include "common/core/clock.h"
#include "common/session/session.h"
#include "deploy/conform/finding.h"
#include "device_node/drivers/driver_registry.h"
#include "device_node/drivers/start_up.h"

namespace palpate {

struct ConformDeviceOptions {
  bool may_move_hardware = false;  ///< the device is clear, and nobody holds it
  OnFinding on_finding = {};
  /// Called, by another thread, if a check has not ended after `hang_after`: a call of the driver
  /// does not return, and only the end of the program ends it.
  OnFinding on_hang = {};
  std::chrono::milliseconds hang_after{60'000};
  /// Of hardware: prompts the person at the device and tells whether the last prompt was
  /// acknowledged.
  device::StartUp start_up = {};
  /// What the session claims of the device; none: no gain is judged.
  std::optional<DeviceProfile> profile = {};
};

/// Opens the device of the session's first side, as device_node does, and runs device_checks(): a
/// simulation on virtual time and held by nobody, hardware on this host's clock in about 20 s.
/// Hardware moves only after a person has acknowledged the prompt.
/// @throws SetupError  the device is absent, or real and may not be moved
[[nodiscard]] std::vector<ConformFinding> conform_device(const Session& session,
                                                         const ConformDeviceOptions& options);

/// The same with a driver, at that period of the tick.
/// @param steady  for hardware
[[nodiscard]] std::vector<ConformFinding> conform_device(const device::Driver& driver,
                                                         Duration period, Clock& steady,
                                                         const ConformDeviceOptions& options);

}  // namespace palpate
