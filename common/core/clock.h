// clock.h — the time, handed in: steady in real time, manual in tests, virtual in lockstep
// (virtual_time.h).
#pragma once

#include "common/core/time.h"

namespace palpate {

class Clock {
 public:
  virtual ~Clock() = default;
  [[nodiscard]] virtual TimePoint now() const noexcept = 0;
  /// Returns at `deadline` or, if that has passed, at once.
  virtual void sleep_until(TimePoint deadline) = 0;
};

/// CLOCK_MONOTONIC of this host.
class SteadyClock final : public Clock {
 public:
  [[nodiscard]] TimePoint now() const noexcept override;
  void sleep_until(TimePoint deadline) override;
};

/// Stands still until told. `sleep_until` moves it forward.
class ManualClock final : public Clock {
 public:
  [[nodiscard]] TimePoint now() const noexcept override { return now_; }
  void sleep_until(TimePoint deadline) override { now_ = deadline > now_ ? deadline : now_; }
  void advance(Duration d) { now_ += d; }

 private:
  TimePoint now_{};
};

}  // namespace palpate
