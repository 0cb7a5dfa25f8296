// SPDX-License-Identifier: Apache-2.0
// shared_clock.h — virtual time for two threads: one waits or sets it, the other reads it.
#pragma once

#include <atomic>
#include <cstdint>

#include "common/core/clock.h"

namespace palpate::test {

class SharedClock final : public Clock {
 public:
  [[nodiscard]] TimePoint now() const noexcept override { return TimePoint(Duration(now_ns_)); }
  /// Of one thread only.
  void sleep_until(TimePoint deadline) override {
    const std::int64_t until_ns = Duration(deadline.time_since_epoch()).count();
    if (until_ns > now_ns_) now_ns_ = until_ns;
  }
  void set(Duration since_start) { now_ns_ = since_start.count(); }

 private:
  std::atomic<std::int64_t> now_ns_ = 0;
};

/// The hardware's time: it goes on while the machine sleeps. Any thread.
class WakefulClock final : public Clock {
 public:
  explicit WakefulClock(const Clock& clock) : clock_(clock) {}
  [[nodiscard]] TimePoint now() const noexcept override {
    return clock_.now() + Duration(slept_ns_);
  }
  void sleep_until(TimePoint /*deadline*/) override {}
  void slept(Duration duration) { slept_ns_ += duration.count(); }

 private:
  const Clock& clock_;
  std::atomic<std::int64_t> slept_ns_ = 0;
};

}  // namespace palpate::test
