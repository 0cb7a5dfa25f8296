// SPDX-License-Identifier: Apache-2.0
#include "common/task/hand_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {

std::optional<HandMotion::Mean> HandMotion::Slots::add(double t_s, const Vector3& position_m) {
  const auto at = static_cast<std::int64_t>(std::floor(t_s / length_s + 1e-9));
  std::optional<Mean> ended;
  if (at != slot) ended = end();
  slot = at;
  sum_m += position_m;
  ++count;
  return ended;
}

std::optional<HandMotion::Mean> HandMotion::Slots::end() {
  if (count == 0) return std::nullopt;
  const Mean mean{slot, sum_m / static_cast<double>(count)};
  sum_m.setZero();
  count = 0;
  return mean;
}

void HandMotion::add(double t_s, const Vector3& position_m) {
  if (!begin_s_) {
    begin_s_ = t_s;
    pulled_m_ = position_m;
  }
  end_s_ = t_s;
  newest_m_ = position_m;
  pull(path_slots_.add(t_s - *begin_s_, position_m));
  take(slots_.add(t_s - *begin_s_, position_m));
}

void HandMotion::finish() {
  take(slots_.end());
  pull(path_slots_.end());
  path_m_ += (newest_m_ - pulled_m_).norm();
}

void HandMotion::pull(const std::optional<Mean>& mean) {
  if (!mean) return;
  const Vector3 away_m = mean->position_m - pulled_m_;
  const double step_m = away_m.norm() - kString_m;
  if (step_m <= 0.0) return;
  pulled_m_ += away_m * (step_m / away_m.norm());
  path_m_ += step_m;
}

void HandMotion::take(const std::optional<Mean>& mean) {
  if (!mean) return;
  std::move_backward(last_.begin(), last_.end() - 1, last_.end());
  last_[0] = *mean;
  known_ = std::min(known_ + 1, last_.size());
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
  if (jerks_ == 0 || path_m_ < kLeastPath_m || !(peak_m_per_s_ > 0.0) || !(jerk2_s_ > 0.0)) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const double time_s = end_s_ - *begin_s_;
  return -std::log(std::pow(time_s, 3) / (peak_m_per_s_ * peak_m_per_s_) * jerk2_s_);
}

}  // namespace palpate
