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

Staircase::Pairs Staircase::pairs() const {
  Pairs pairs;
  for (std::size_t i = kLeftOut + reversals_.size() % 2; i + 1 < reversals_.size(); i += 2) {
    if (std::max(reversals_[i], reversals_[i + 1]) >= plan_.most_ratio) {
      ++pairs.at_limit;
    } else {
      ++pairs.within;
      pairs.sum_of_logs += std::log(reversals_[i]) + std::log(reversals_[i + 1]);
    }
  }
  return pairs;
}

double Staircase::threshold_ratio() const {
  const Pairs counted = pairs();
  if (counted.within == 0 || is_beyond_range()) return std::numeric_limits<double>::quiet_NaN();
  return std::exp(counted.sum_of_logs / (2.0 * static_cast<double>(counted.within)));
}

bool Staircase::is_beyond_range() const {
  const Pairs counted = pairs();
  return difference_ratio_ >= plan_.most_ratio ||
         (counted.at_limit > 0 && counted.at_limit >= counted.within);
}

}  // namespace palpate::study
