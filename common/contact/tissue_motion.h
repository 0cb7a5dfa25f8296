// SPDX-License-Identifier: Apache-2.0
// tissue_motion.h — where tissue with a motion of its own is.
#pragma once

#include <cmath>
#include <numbers>

#include "common/core/tissue.h"
#include "common/core/vector.h"

namespace palpate {

/// Of a whole tissue, from where its geometry has it; W.
struct Displacement {
  Vector3 position_m = Vector3::Zero();
  Vector3 velocity_m_per_s = Vector3::Zero();
};

[[nodiscard]] inline bool is_moving(const TissueMotionConfig& motion) noexcept {
  return motion.frequency_hz > 0.0 && !motion.amplitude_m.isZero(0.0);
}

/// @param time_s  physics' clock
[[nodiscard]] inline Displacement displacement(const TissueMotionConfig& motion,
                                               double time_s) noexcept {
  if (!is_moving(motion)) return {};
  const double omega = 2.0 * std::numbers::pi * motion.frequency_hz;
  const double angle = omega * time_s + motion.phase_rad;
  return {std::sin(angle) * motion.amplitude_m, omega * std::cos(angle) * motion.amplitude_m};
}

}  // namespace palpate
