// SPDX-License-Identifier: Apache-2.0
// stated_error.h — how far what is computed between two full solutions may be from the next one.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::elastic {

/// From what was measured at the solutions before: the largest of late, and the largest for the way
/// of the tool. No bound that is proven; how often it is passed is counted.
class StatedError {
 public:
  /// A solution was `error_newton` from what was expected there.
  /// @param way_m  of the tool since the solution before
  void note(double error_newton, double way_m) noexcept {
    error_newton_ = std::fmax(error_newton, kMemory * error_newton_);
    error_newton_per_m_ *= kMemory;
    if (way_m > kShortWay_m) {
      error_newton_per_m_ = std::max(error_newton_per_m_, error_newton / way_m);
    }
  }
  /// NaN: unknown, as nothing was measured yet.
  [[nodiscard]] double bound_newton(double way_m) const noexcept {
    return error_newton_ + error_newton_per_m_ * way_m;
  }

 private:
  static constexpr double kMemory = 0.95;
  static constexpr double kShortWay_m = 2e-5;

  double error_newton_ = std::numeric_limits<double>::quiet_NaN();  // at the solution
  double error_newton_per_m_ = 0.0;
};

}  // namespace palpate::elastic
