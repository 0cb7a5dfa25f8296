// SPDX-License-Identifier: Apache-2.0
// plugin_driver.h — a driver in a shared library, by the C interface of palpate_device.h.
#pragma once

#include <memory>

#include "common/core/clock.h"
#include "common/session/driver_config.h"
#include "device_node/device.h"
#include "device_node/drivers/start_up.h"

namespace palpate::device {

inline constexpr const char* kPluginDriver = "plugin";

/// @throws SetupError  the library cannot be loaded, has another interface, or its open() failed
[[nodiscard]] std::unique_ptr<HapticDevice> open_plugin(const PluginConfig& config,
                                                        const Clock& clock,
                                                        const StartUp& start_up);

}  // namespace palpate::device
