// SPDX-License-Identifier: Apache-2.0
/// @file
/// interval.h — what controllers that know samples only see of the time since the previous step.
#pragma once

#include "force_controller.h"

namespace palpate::controllers {

/// The stretches since the previous step as one interval. Nothing is known of the first one and
/// after a gap: all zero.
struct Interval {
  double duration_s = 0.0;                         ///< ≥ 0; 0: nothing is known
  Vector3 moved_m = Vector3::Zero();               ///< Δx(k) = x(k) − x(k−1), measured
  Vector3 force_on_hand_newton = Vector3::Zero();  ///< F(k−1), time average of what acted
  double work_joule = 0.0;                         ///< −Σ F·Δx, done by the hand against F

  /// Mean velocity; 0 where nothing is known.
  [[nodiscard]] Vector3 velocity_m_per_s() const noexcept {
    return duration_s > 0.0 ? Vector3(moved_m / duration_s) : Vector3(Vector3::Zero());
  }
};

/// Makes an Interval of the echo of each step. No allocation, no throw.
class IntervalReader {
 public:
  /// The next step is a first one.
  void reset() noexcept { has_position_ = false; }
  /// Once per step. Stretches whose ends were not read share the displacement up to the next
  /// reading.
  [[nodiscard]] Interval read(const ControlInput& input) noexcept;

 private:
  Vector3 position_m_ = Vector3::Zero();
  bool has_position_ = false;
};

/// The output of a method without a bound: F with the energy that the controller observes; f_max is
/// NaN, the lease is left to the caller.
/// @param input  of this step   @param force_on_hand_newton  F
/// @param observed_joule  NaN where the method observes none
[[nodiscard]] ControlOutput unbounded_output(const ControlInput& input,
                                             const Vector3& force_on_hand_newton,
                                             double observed_joule) noexcept;

}  // namespace palpate::controllers
