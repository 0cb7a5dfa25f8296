// SPDX-License-Identifier: Apache-2.0
// make_controller.h — from the session's settings to a controller.
#pragma once

#include <memory>

#include "common/session/clamped_device.h"
#include "common/session/mofc_config.h"
#include "mofc_node/controllers/force_controller.h"

namespace palpate::mofc {

/// The controller that the session selects, with the device's profile. One published by others is
/// loaded from lib/palpate/ beside the folder of the program. Throws SetupError if that fails.
[[nodiscard]] std::unique_ptr<controllers::ForceController> make_controller(
    const MofcConfig& mofc, const ClampedDevice& device);

}  // namespace palpate::mofc
