// shared_clock.h — virtual time for two threads: the one that waits advances it.
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

 private:
  std::atomic<std::int64_t> now_ns_ = 0;
};

}  // namespace palpate::test
