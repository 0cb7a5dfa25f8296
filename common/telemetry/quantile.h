// quantile.h — exact quantiles of samples. DurationHistogram of metrics.h estimates them without
// keeping the samples.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "common/core/check.h"

namespace palpate {

/// The least of `samples` that a share `q` of them does not exceed (nearest rank); reorders them.
/// @param samples  not empty       @param q  0 … 1; 1: the maximum
template <class T>
[[nodiscard]] T quantile(std::vector<T>& samples, double q) {
  PALPATE_REQUIRE(!samples.empty());
  const double rank = std::ceil(q * static_cast<double>(samples.size()));
  const auto place = samples.begin() + (static_cast<std::ptrdiff_t>(std::max(rank, 1.0)) - 1);
  std::nth_element(samples.begin(), place, samples.end());
  return *place;
}

}  // namespace palpate
