// SPDX-License-Identifier: Apache-2.0
// hapi_driver.h — a pantograph on one of Haply's hAPI boards, by its serial port. Two axes with
// force; the third gets none. Never run on hardware: tested against the emulator of
// device_node/emulators.
#pragma once

#include <memory>

#include "common/core/clock.h"
#include "common/session/driver_config.h"
#include "device_node/device.h"
#include "device_node/drivers/hapi/hapi_wire.h"
#include "device_node/drivers/hapi/pantograph.h"
#include "device_node/drivers/start_up.h"

namespace palpate::device {

inline constexpr const char* kHapiDriver = "hapi";

[[nodiscard]] HapiBoard hapi_board(const HapiConfig& config);
[[nodiscard]] PantographGeometry pantograph_geometry(const HapiConfig& config);

/// Each reading and each switch is one message to the board and its answer. The boards know no
/// lease: every message repeats the force until its lease ends.
/// @throws SetupError  no such port, or no board answers within `start_up.limit`
[[nodiscard]] std::unique_ptr<HapticDevice> open_hapi(const HapiConfig& config, const Clock& clock,
                                                      const StartUp& start_up);

}  // namespace palpate::device
