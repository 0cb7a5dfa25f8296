// SPDX-License-Identifier: Apache-2.0
#include "common/task/hand_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {

void HandMotion::add(double t_s, const Vector3& position_m) {
  if (!begin_s_) {
    begin_s_ = t_s;
    pulled_m_ = position_m;
  }
  end_s_ = t_s;
  newest_m_ = position_m;
  const auto slot_of = [&](double length_s) {
    return static_cast<std::int64_t>(std::floor((t_s - *begin_s_) / length_s + 1e-9));
  };
  if (slot_of(kPathSlot_s) != path_slot_) end_path_slot();
  path_slot_ = slot_of(kPathSlot_s);
  path_sum_m_ += position_m;
  ++path_count_;
  const std::int64_t slot = slot_of(kSlot_s);
  if (slot != slot_) end_slot();
  slot_ = slot;
  sum_m_ += position_m;
  ++count_;
}

void HandMotion::finish() {
  end_slot();
  end_path_slot();
  path_m_ += (newest_m_ - pulled_m_).norm();
}

void HandMotion::end_path_slot() {
  if (path_count_ == 0) return;
  const Vector3 away_m = path_sum_m_ / static_cast<double>(path_count_) - pulled_m_;
  path_sum_m_.setZero();
  path_count_ = 0;
  const double step_m = away_m.norm() - kString_m;
  if (step_m <= 0.0) return;
  pulled_m_ += away_m * (step_m / away_m.norm());
  path_m_ += step_m;
}

void HandMotion::end_slot() {
  if (count_ == 0) return;
  std::move_backward(last_.begin(), last_.end() - 1, last_.end());
  last_[0] = {slot_, sum_m_ / static_cast<double>(count_)};
  known_ = std::min(known_ + 1, last_.size());
  sum_m_.setZero();
  count_ = 0;
  if (known_ < 2) return;
  const double step_m = (last_[0].position_m - last_[1].position_m).norm();
  const double step_s = kSlot_s * static_cast<double>(last_[0].slot - last_[1].slot);
  peak_m_per_s_ = std::max(peak_m_per_s_, step_m / step_s);
  if (known_ < 4 || last_[0].slot - last_[3].slot != 3) return;
  const Vector3 third_m = last_[0].position_m - 3.0 * last_[1].position_m +
                          3.0 * last_[2].position_m - last_[3].position_m;
  jerk2_s_ += third_m.squaredNorm() / std::pow(kSlot_s, 5);
  ++jerks_;
}

double HandMotion::log_dimensionless_jerk() const {
  if (jerks_ == 0 || !(peak_m_per_s_ > 0.0) || !(jerk2_s_ > 0.0)) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const double time_s = end_s_ - *begin_s_;
  return -std::log(std::pow(time_s, 3) / (peak_m_per_s_ * peak_m_per_s_) * jerk2_s_);
}

}  // namespace palpate
