// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/rivals/memory_based.h"

#include <algorithm>

namespace palpate::controllers {

void MemoryBased::reset() noexcept {
  interval_.reset();
  forget();
}

void MemoryBased::forget() noexcept {
  count_ = 0;
  area_joule_ = spent_joule_ = penetration_m_ = 0.0;
  is_in_contact_ = false;
}

ControlOutput MemoryBased::step(const ControlInput& input) noexcept {
  const Interval interval = interval_.read(input);
  const Vector3& requested = input.requested_force_on_hand_newton;
  if (requested.isZero(0.0) || input.has_gap) forget();
  if (requested.isZero(0.0)) return unbounded_output(input, requested, 0.0);
  if (!is_in_contact_) {
    normal_ = input.surface_normal.isZero(0.0) ? requested.normalized() : input.surface_normal;
    is_in_contact_ = true;
    return unbounded_output(input, requested, 0.0);
  }

  // what the hand did against the normal force
  const double before_newton = std::max(0.0, interval.force_on_hand_newton.dot(normal_));
  const double moved = -normal_.dot(interval.moved_m);  // Δp
  const double to_m = penetration_m_ + moved;
  spent_joule_ += before_newton * moved;
  if (moved > 0.0) press(to_m, before_newton);
  if (moved < 0.0) release(to_m);
  penetration_m_ = to_m;

  const double pressing = requested.dot(normal_);  // f
  if (pressing <= 0.0) return unbounded_output(input, requested, spent_joule_);
  double newton = pressing;
  if (penetration_m_ <= 0.0) {
    count_ = 0;
    area_joule_ = spent_joule_ = penetration_m_ = 0.0;
    if (moved < 0.0) newton = 0.0;
  } else if (moved == 0.0) {
    newton = std::min(pressing, before_newton);
  } else if (moved < 0.0) {
    const double length_m = std::max(-1.5 * moved, resolution_m_);
    const double owed = std::max(0.0, area_joule_ - spent_joule_);
    newton = std::clamp(mean_newton(length_m) - owed / length_m, 0.0, pressing);
  }
  return unbounded_output(input, requested * (newton / pressing), spent_joule_);
}

void MemoryBased::press(double to_m, double newton) noexcept {
  const double from_m = std::max(0.0, penetration_m_);
  if (to_m <= from_m) return;
  area_joule_ += newton * (to_m - from_m);
  if (count_ > 0) {
    Segment& last = segments_[count_ - 1];
    if (count_ == kMostSegments || last.high_m - last.low_m < kLeastSegmentMetre) {
      // one segment of the same area
      const double joule = last.joule() + newton * (to_m - from_m);
      last.high_m = to_m;
      last.newton = joule / (last.high_m - last.low_m);
      return;
    }
  }
  segments_[count_++] = {.low_m = from_m, .high_m = to_m, .newton = newton};
}

void MemoryBased::release(double to_m) noexcept {
  while (count_ > 0) {
    Segment& last = segments_[count_ - 1];
    if (last.high_m <= to_m) return;
    area_joule_ -= last.joule();
    if (last.low_m < to_m) {
      last.high_m = to_m;
      area_joule_ += last.joule();
      return;
    }
    --count_;
  }
  area_joule_ = 0.0;
}

double MemoryBased::mean_newton(double length_m) const noexcept {
  double joule = 0.0;
  const double from_m = penetration_m_ - length_m;
  for (std::size_t i = count_; i > 0 && segments_[i - 1].high_m > from_m; --i) {
    const Segment& one = segments_[i - 1];
    joule += one.newton * (one.high_m - std::max(one.low_m, from_m));
  }
  return joule / length_m;
}

}  // namespace palpate::controllers
