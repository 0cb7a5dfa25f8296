// SPDX-License-Identifier: Apache-2.0
// identify.h — `palpate identify`: the friction of a session's device, measured (device_node/
// friction_identification.h), as a table and as a device profile.
#pragma once

#include <functional>
#include <stop_token>
#include <string>

#include "common/core/clock.h"
#include "common/session/session.h"
#include "device_node/drivers/driver_registry.h"
#include "device_node/identification/friction_identification.h"

namespace palpate {

struct IdentifyOptions {
  std::string profile_file = {};  ///< empty: none is written
  bool may_overwrite = false;     ///< the profile
  bool is_per_axis = false;       ///< the profile has friction per axis of D
  device::SweepConsent consent = {};
  /// Whether the person at the device has acknowledged the last prompt; empty: Enter in the
  /// terminal, or SIGUSR2.
  std::function<bool()> is_acknowledged = {};
  /// Ends it, motors released.
  std::stop_token stop = {};
};

/// Sweeps the device of the session, without a hand, and prints a row per line as it proceeds. A
/// simulated device starts in the middle of its workspace and runs on virtual time; hardware runs
/// on the steady clock, in real time and with the session's real-time scheduling. It begins when a
/// person has acknowledged the prompt and it was then at rest in its workspace for 2 s.
/// @throws SetupError                   refused, or the profile cannot be written
/// @throws device::IdentificationError  a bound was reached, the device failed or the stop was
///     requested
void run_identify(const Session& session, const IdentifyOptions& options);
/// The same with another driver. @param steady  the clock of hardware
void run_identify(const Session& session, const IdentifyOptions& options,
                  const device::Driver& driver, Clock& steady);

}  // namespace palpate
