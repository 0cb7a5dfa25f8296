// pointer_config.h — limits of a simulated hand that a viewer's pointer leads.
#pragma once

#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate {

/// How a viewer's page may lead the hand.
struct PointerConfig {
  Vector3 center_m = Vector3::Zero();  ///< D; targets stay within `reach_m` of it
  double reach_m = 0.1;
  double speed_m_per_s = 0.25;                        ///< the intended point moves at most so fast
  Duration holder_timeout = std::chrono::seconds(2);  ///< silence that frees the hand for another
};

}  // namespace palpate
