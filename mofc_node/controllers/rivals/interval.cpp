// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/rivals/interval.h"

#include <limits>

namespace palpate::controllers {

Interval IntervalReader::read(const ControlInput& input) noexcept {
  Interval interval;
  const bool is_known = has_position_ && !input.has_gap;
  if (is_known) {
    Vector3 impulse = Vector3::Zero();
    // stretches whose ends were not read share the displacement up to the next reading
    Vector3 read_at_m = position_m_;
    Vector3 unread_impulse = Vector3::Zero();
    double unread_s = 0.0;
    for (const AppliedStretch& stretch : input.applied) {
      unread_impulse += stretch.duration_s * stretch.force_on_hand_newton;
      unread_s += stretch.duration_s;
      if (!stretch.has_position_at_end) continue;
      if (unread_s > 0.0) {
        interval.work_joule -=
            unread_impulse.dot(stretch.hand_position_at_end_m - read_at_m) / unread_s;
      }
      interval.duration_s += unread_s;
      impulse += unread_impulse;
      read_at_m = stretch.hand_position_at_end_m;
      unread_impulse.setZero();
      unread_s = 0.0;
    }
    if (interval.duration_s > 0.0) interval.force_on_hand_newton = impulse / interval.duration_s;
    interval.moved_m = read_at_m - position_m_;
  }
  position_m_ = input.hand_position_m;
  has_position_ = true;
  return interval;
}

ControlOutput unbounded_output(const ControlInput& input, const Vector3& force_on_hand_newton,
                               double observed_joule) noexcept {
  return {.force_on_hand_newton = force_on_hand_newton,
          .f_max_newton = Vector3::Constant(std::numeric_limits<double>::quiet_NaN()),
          .ledger_energy_joule = observed_joule,
          .is_clamped = !input.requested_force_on_hand_newton.isZero(0.0) &&
                        force_on_hand_newton != input.requested_force_on_hand_newton};
}

}  // namespace palpate::controllers
