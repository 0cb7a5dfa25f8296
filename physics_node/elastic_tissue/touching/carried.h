// SPDX-License-Identifier: Apache-2.0
// carried.h — how what an elastic body lies on carries its surface near a tip.
#pragma once

#include <vector>

#include "common/contact/tissue_motion.h"

namespace palpate::physics {

/// Way of the untouched surface near a tip from where it is in the session, and how it goes on.
/// Only of bodies that lie on what moves; else all of it is zero.
struct Carried {
  Vector3 way_m = Vector3::Zero();            ///< in a full solution, W
  double time_s = 0.0;                        ///< of the motions, in that solution
  std::vector<TissueMotionConfig> motions{};  ///< what these do to the surface, where it leans now

  /// Since that solution. No allocation.
  [[nodiscard]] Vector3 since_m(double at_s) const noexcept {
    Vector3 sum = Vector3::Zero();
    for (const TissueMotionConfig& one : motions) {
      sum += displacement(one, at_s).position_m - displacement(one, time_s).position_m;
    }
    return sum;
  }
  [[nodiscard]] Vector3 at_m(double at_s) const noexcept { return way_m + since_m(at_s); }
  [[nodiscard]] Vector3 velocity_m_per_s(double at_s) const noexcept {
    Vector3 sum = Vector3::Zero();
    for (const TissueMotionConfig& one : motions) sum += displacement(one, at_s).velocity_m_per_s;
    return sum;
  }
};

}  // namespace palpate::physics
