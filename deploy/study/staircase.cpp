// SPDX-License-Identifier: Apache-2.0
#include "deploy/study/staircase.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace palpate::study {
namespace {

constexpr std::size_t kLeftOut = 2;  // reversals of the way from the start

}  // namespace

void Staircase::answer(bool is_right) {
  ++trials_;
  right_in_a_row_ = is_right ? right_in_a_row_ + 1 : 0;
  int step = 0;
  if (!is_right) {
    step = 1;
  } else if (right_in_a_row_ == plan_.right_answers) {
    step = -1;
    right_in_a_row_ = 0;
  }
  if (step == 0) return;
  if (direction_ != 0 && step != direction_) reversals_.push_back(difference_ratio_);
  direction_ = step;
  difference_ratio_ =
      std::min(plan_.most_ratio, difference_ratio_ * std::pow(plan_.step_factor, step));
}

double Staircase::threshold_ratio() const {
  const std::size_t odd = reversals_.size() % 2;
  if (reversals_.size() < kLeftOut + odd + 2) return std::numeric_limits<double>::quiet_NaN();
  double sum = 0.0;
  for (std::size_t i = kLeftOut + odd; i < reversals_.size(); ++i) sum += std::log(reversals_[i]);
  return std::exp(sum / static_cast<double>(reversals_.size() - kLeftOut - odd));
}

}  // namespace palpate::study
