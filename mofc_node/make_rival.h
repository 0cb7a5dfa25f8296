// make_rival.h — from the session's settings to a controller published by others.
#pragma once

#include <memory>

#include "common/session/clamped_device.h"
#include "common/session/mofc_config.h"
#include "mofc_node/controllers/force_controller.h"

namespace palpate::mofc {

/// Of a kind other than none, mofc and output_limiter.
[[nodiscard]] std::unique_ptr<controllers::ForceController> make_rival(const MofcConfig& mofc,
                                                                       const ClampedDevice& device);

}  // namespace palpate::mofc
