// SPDX-License-Identifier: Apache-2.0
// conform_device.h — does a device keep what device_node and the hand rely on?
#pragma once

#include <chrono>
#include <limits>
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
  bool may_lack_watchdog = false;  ///< and its motors may go on pushing if this program is killed
  OnFinding on_finding = {};
  /// Called, by another thread, if a check has not ended after `hang_after`: a call of the driver
  /// does not return, and only the end of the program ends it.
  OnFinding on_hang = {};
  std::chrono::milliseconds hang_after{60'000};
  /// Of hardware: prompts the person at the device and tells whether the last prompt was
  /// acknowledged. Its stop ends the checks, motors released.
  device::StartUp start_up = {};
  /// What the session claims of the device; none: no gain is judged.
  std::optional<DeviceProfile> profile = {};
  Duration latency{};
  /// No push is stronger; none is stronger than 1 N if the motors of hardware have no watchdog,
  /// unless `accepts_no_watchdog`.
  double peak_force_newton = std::numeric_limits<double>::infinity();
  bool accepts_no_watchdog = false;             ///< device { accept: NO_MOTOR_WATCHDOG }
  std::optional<RealtimeConfig> realtime = {};  ///< of the checks of hardware; none: as it is
};

/// Opens the device of the session's first side, as device_node does, and runs device_checks(): a
/// simulation on virtual time and held by nobody, hardware on this host's clock, with the session's
/// real-time scheduling, in about 20 s. Hardware moves only after a person has acknowledged the
/// prompt, with no more than the session's peak force, and with more than the small push of the
/// check of its motors only if that was good.
/// @throws SetupError          the device is absent, or real and may not be moved
/// @throws std::runtime_error  a stop was requested: motors released, or did not confirm it
[[nodiscard]] std::vector<ConformFinding> conform_device(const Session& session,
                                                         const ConformDeviceOptions& options);

/// The same with a driver, at that period of the tick.
/// @param steady  for hardware
[[nodiscard]] std::vector<ConformFinding> conform_device(const device::Driver& driver,
                                                         Duration period, Clock& steady,
                                                         const ConformDeviceOptions& options);

}  // namespace palpate
