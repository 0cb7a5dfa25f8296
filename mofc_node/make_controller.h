// SPDX-License-Identifier: Apache-2.0
// make_controller.h — from the session's settings to a controller.
#pragma once

#include <filesystem>
#include <memory>

#include "common/session/clamped_device.h"
#include "common/session/mofc_config.h"
#include "mofc_node/controllers/force_controller.h"

namespace palpate::mofc {

/// The library of the controllers published by others: lib/palpate/palpate_rivals.so beside the
/// folder of this program.
[[nodiscard]] std::filesystem::path rivals_library();

/// The controller that the session selects, with the device's profile. One published by others is
/// loaded from rivals_library(). Throws SetupError if that fails.
[[nodiscard]] std::unique_ptr<controllers::ForceController> make_controller(
    const MofcConfig& mofc, const ClampedDevice& device);

}  // namespace palpate::mofc
