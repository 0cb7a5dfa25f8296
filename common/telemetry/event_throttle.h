// SPDX-License-Identifier: Apache-2.0
// event_throttle.h — limits how often a repeated event is logged.
#pragma once

#include <cstdint>
#include <utility>

#include "common/core/time.h"

namespace palpate {

/// Reports the first occurrence at once, then at most once per interval with the number of
/// occurrences since the previous report.
class EventThrottle {
 public:
  explicit EventThrottle(Duration interval = std::chrono::seconds(1)) : interval_(interval) {}

  /// Adds `occurrences`, possibly 0. Returns the number to report now; 0: no report is due. A clock
  /// that steps back, as that of a recording may, begins a new interval.
  [[nodiscard]] std::uint64_t note(TimePoint now, std::uint64_t occurrences) noexcept {
    pending_ += occurrences;
    if (pending_ == 0 || (has_reported_ && now >= reported_at_ && now < reported_at_ + interval_)) {
      return 0;
    }
    has_reported_ = true;
    reported_at_ = now;
    return std::exchange(pending_, 0);
  }

 private:
  Duration interval_;
  bool has_reported_ = false;
  TimePoint reported_at_{};
  std::uint64_t pending_ = 0;
};

}  // namespace palpate
