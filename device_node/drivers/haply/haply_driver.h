// SPDX-License-Identifier: Apache-2.0
// haply_driver.h — Haply Inverse3 and its grips, by the Inverse Service's WebSocket. Never run on
// hardware: tested against the emulator of device_node/emulators.
#pragma once

#include <memory>

#include "common/core/clock.h"
#include "common/session/driver_config.h"
#include "device_node/device.h"
#include "device_node/drivers/start_up.h"

namespace palpate::device {

inline constexpr const char* kHaplyDriver = "haply_inverse";

/// Each reading and each switch is one message to the service and its answer. A force acts for one
/// tick of the service, so every message repeats it until its lease ends.
/// @throws SetupError  no service, no such device, or not ready within `start_up.limit`
[[nodiscard]] std::unique_ptr<HapticDevice> open_haply(const HaplyConfig& config,
                                                       const Clock& clock, const StartUp& start_up);

}  // namespace palpate::device
