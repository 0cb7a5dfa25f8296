// SPDX-License-Identifier: Apache-2.0
// falcon_driver.h — Novint Falcon, by USB. Never run on hardware: tested against the emulator of
// device_node/emulators.
#pragma once

#include <memory>

#include "common/core/clock.h"
#include "common/session/driver_config.h"
#include "device_node/device.h"
#include "device_node/drivers/falcon/falcon_wire.h"
#include "device_node/drivers/start_up.h"

namespace palpate::device {

inline constexpr const char* kFalconDriver = "falcon";

/// Angles of the legs where the encoders are at these counts [rad].
[[nodiscard]] Vector3 falcon_angles_rad(const FalconConfig& config,
                                        const FalconCounts& encoders) noexcept;

/// Loads the firmware if none runs, waits for homing.
/// @throws SetupError  no Falcon, no firmware, or not homed within `start_up.limit`
[[nodiscard]] std::unique_ptr<HapticDevice> open_falcon(const FalconConfig& config,
                                                        const Clock& clock,
                                                        const StartUp& start_up);

}  // namespace palpate::device
