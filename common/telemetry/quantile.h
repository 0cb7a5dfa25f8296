// SPDX-License-Identifier: Apache-2.0
// quantile.h — the one definition of a quantile: nearest rank.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/core/check.h"

namespace palpate {

/// Rank, from 1 on, of the smallest of `count` values that at least the share `q` of them does not
/// exceed. `q` outside [0, 1] is clamped. @pre count > 0
[[nodiscard]] inline std::uint64_t quantile_rank(double q, std::uint64_t count) noexcept {
  const double rank = std::ceil(std::clamp(q, 0.0, 1.0) * static_cast<double>(count));
  return std::clamp(static_cast<std::uint64_t>(rank), std::uint64_t{1}, count);
}

/// The value of that rank. Reorders `values`. @pre values is not empty
template <class T>
[[nodiscard]] T quantile(std::vector<T>& values, double q) {
  PALPATE_REQUIRE(!values.empty());
  const auto place =
      values.begin() + static_cast<std::ptrdiff_t>(quantile_rank(q, values.size()) - 1);
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

}  // namespace palpate
