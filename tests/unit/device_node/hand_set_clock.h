// hand_set_clock.h — a clock that one thread sets while another reads it.
#pragma once

#include <atomic>

#include "common/core/clock.h"

namespace palpate::device {

class HandSetClock final : public Clock {
 public:
  [[nodiscard]] TimePoint now() const noexcept override {
    return TimePoint(Duration(since_start_.load()));
  }
  void sleep_until(TimePoint deadline) override { set(deadline.time_since_epoch()); }
  void set(Duration since_start) { since_start_ = since_start.count(); }

 private:
  std::atomic<Duration::rep> since_start_ = 0;
};

}  // namespace palpate::device
