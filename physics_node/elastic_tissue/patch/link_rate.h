// SPDX-License-Identifier: Apache-2.0
// link_rate.h — how many bytes a second a link bears, by the age of its loop.
#pragma once

#include <algorithm>
#include <limits>

#include "common/core/time.h"

namespace palpate::physics {

/// Grows while the loop is as old as it has lately been at the least, and falls where it grows
/// older, as behind a queue: what fills a queue delays the forces behind it. It never falls below
/// kLeast, so that jitter, which looks the same, takes only what is above.
class LinkRate {
 public:
  static constexpr double kLeastBytesPerS = 1e6;
  static constexpr double kMostBytesPerS = 3e6;

  /// Once per message that names an age of the loop.
  void observe(Duration loop_age, TimePoint now) noexcept {
    const double age_s = to_seconds(loop_age);
    const double dt_s = std::clamp(to_seconds(now - at_), 0.0, kLongest_s);
    at_ = now;
    if (!(age_s > 0.0)) return;
    least_age_s_ = std::min(age_s, least_age_s_ + kForget * dt_s);
    if (age_s <= least_age_s_ + kQueue_s + kQueueShare * least_age_s_) {
      bytes_per_s_ = std::min(kMostBytesPerS, bytes_per_s_ + growth_bytes_per_s2_ * dt_s);
    } else if (now - reduced_at_ >= loop_age) {  // the last reduction shows
      bytes_per_s_ = std::max(kLeastBytesPerS, kReduction * bytes_per_s_);
      growth_bytes_per_s2_ = kGrowth_bytes_per_s2;
      reduced_at_ = now;
    }
  }
  [[nodiscard]] double bytes_per_s() const noexcept { return bytes_per_s_; }

 private:
  static constexpr double kQueue_s = 0.015;
  static constexpr double kQueueShare = 0.25;
  static constexpr double kReduction = 0.6;
  static constexpr double kFirstGrowth_bytes_per_s2 = 4e6;  // until a queue was seen
  static constexpr double kGrowth_bytes_per_s2 = 1e6;
  // of the least age, in s per s: the way may have changed
  static constexpr double kForget = 0.002;
  static constexpr double kLongest_s = 0.1;

  double bytes_per_s_ = kLeastBytesPerS;
  double growth_bytes_per_s2_ = kFirstGrowth_bytes_per_s2;
  double least_age_s_ = std::numeric_limits<double>::infinity();
  TimePoint at_{};
  TimePoint reduced_at_{};
};

}  // namespace palpate::physics
