// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/metrics.h"

#include <algorithm>
#include <cmath>

#include "common/telemetry/quantile.h"

namespace palpate {

void DurationHistogram::add(Duration d) noexcept {
  maximum_ = std::max(maximum_, d);
  ++count_;
  const double ns = static_cast<double>(std::max<std::int64_t>(d.count(), 1));
  const int bucket =
      static_cast<int>(std::ceil((std::log2(ns) - kLowestExponent) * kPerOctave)) - 1;
  ++buckets_[static_cast<std::size_t>(std::clamp(bucket, 0, kOctaves * kPerOctave - 1))];
}

Duration DurationHistogram::quantile(double q) const noexcept {
  if (count_ == 0) return Duration{};
  const std::uint64_t rank = quantile_rank(q, count_);
  std::uint64_t seen = 0;
  for (std::size_t i = 0; i < buckets_.size(); ++i) {
    seen += buckets_[i];
    if (seen >= rank) {
      const double exponent = kLowestExponent + static_cast<double>(i + 1) / kPerOctave;
      return std::min(Duration(static_cast<std::int64_t>(std::exp2(exponent))), maximum_);
    }
  }
  return maximum_;
}

}  // namespace palpate
