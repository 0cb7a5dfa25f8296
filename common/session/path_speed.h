// SPDX-License-Identifier: Apache-2.0
// path_speed.h — how fast the intended path of a simulated hand moves.
#pragma once

#include "common/session/simulation_config.h"

namespace palpate {

/// The fastest place of a path.
struct PathSpeed {
  /// Of the intended point, an upper bound: the hand follows it by spring and damper, more slowly.
  /// Infinite where a path that loops ends elsewhere than it begins.
  double m_per_s = 0.0;
  double at_s = 0.0;  ///< since the start of the path; 0 where it is the same all the time
};
[[nodiscard]] PathSpeed top_speed_of(const PathConfig& path);

}  // namespace palpate
