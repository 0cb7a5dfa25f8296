// SPDX-License-Identifier: Apache-2.0
// pointer_config.h — limits of a simulated hand that follows a viewer's pointer.
#pragma once

#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate {

/// Limits on the targets that a viewer's page sends to the hand.
struct PointerConfig {
  Vector3 center_m = Vector3::Zero();  ///< D; targets are limited to a sphere around it
  double reach_m = 0.1;                ///< radius of that sphere
  double speed_m_per_s = 0.25;         ///< speed limit of the target
  /// A client that holds the hand and is silent for longer loses it.
  Duration holder_timeout = std::chrono::seconds(2);
};

}  // namespace palpate
