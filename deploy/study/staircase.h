// SPDX-License-Identifier: Apache-2.0
// staircase.h — a difference that becomes smaller after right answers and larger after wrong ones,
// until it is where the answers turn.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "deploy/study/plan.h"

namespace palpate::study {

/// The transformed up-down method [Levitt71]: with d right answers in a row until it falls, it
/// converges to the difference that is told rightly with probability 2^(−1/d).
class Staircase {
 public:
  explicit Staircase(const StaircasePlan& plan)
      : plan_(plan), difference_ratio_(plan.start_ratio) {}

  /// Of the next trial.
  [[nodiscard]] double difference_ratio() const { return difference_ratio_; }
  void answer(bool is_right);
  [[nodiscard]] bool is_done() const {
    return reversals_.size() >= plan_.reversals || trials_ >= plan_.most_trials;
  }
  /// Differences at which it turned.
  [[nodiscard]] const std::vector<double>& reversals() const { return reversals_; }
  /// Geometric mean of an even number of reversals, the first two or three left out, and pairs of
  /// which one is at the largest difference: there it could not grow. NaN if there are not at least
  /// two more, or is_beyond_range().
  [[nodiscard]] double threshold_ratio() const;
  /// It is at the largest difference, or as many pairs of its reversals have been as have not: the
  /// threshold lies there or beyond.
  [[nodiscard]] bool is_beyond_range() const;

 private:
  /// Of reversals that count.
  struct Pairs {
    std::size_t at_limit = 0;  // left out
    std::size_t within = 0;
    double sum_of_logs = 0.0;  // of those within
  };
  [[nodiscard]] Pairs pairs() const;

  StaircasePlan plan_;
  double difference_ratio_;
  std::uint64_t trials_ = 0;
  std::uint64_t right_in_a_row_ = 0;
  int direction_ = 0;  // of the last step: −1 down, 1 up, 0 none yet
  std::vector<double> reversals_;
};

}  // namespace palpate::study
