// SPDX-License-Identifier: Apache-2.0
// histogram.h — percentiles of a quantity over the ticks of a run, in bounded memory.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "common/telemetry/quantile.h"

namespace palpate {

/// Counts values ≥ 0 in bins of one width; larger ones than it has bins for count as the last.
class Histogram {
 public:
  /// @param width > 0, the resolution of the quantiles   @param bins > 0
  Histogram(double width, std::size_t bins) : width_(width), counts_(bins) {}

  void add(double value) {
    const double bin = std::clamp(value / width_, 0.0, static_cast<double>(counts_.size() - 1));
    ++counts_[static_cast<std::size_t>(bin)];
    ++count_;
    max_ = count_ == 1 ? value : std::max(max_, value);
  }
  /// Middle of the bin of the quantile, at most the largest value; NaN without values.
  [[nodiscard]] double quantile(double q) const {
    if (count_ == 0) return std::numeric_limits<double>::quiet_NaN();
    const std::uint64_t rank = quantile_rank(q, count_);
    std::uint64_t seen = 0;
    for (std::size_t bin = 0; bin < counts_.size(); ++bin) {
      seen += counts_[bin];
      if (seen >= rank) return std::min(max_, (static_cast<double>(bin) + 0.5) * width_);
    }
    return max_;
  }
  [[nodiscard]] double max() const { return max_; }  ///< NaN without values
  [[nodiscard]] std::uint64_t count() const { return count_; }

 private:
  double width_;
  std::vector<std::uint32_t> counts_;
  std::uint64_t count_ = 0;
  double max_ = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace palpate
