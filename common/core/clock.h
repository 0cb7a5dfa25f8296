// clock.h — the time, handed in: steady in real time, manual in tests, virtual in lockstep
// (virtual_time.h).
#pragma once

#include <cstdint>

#include "common/core/time.h"

namespace palpate {

class Clock {
 public:
  virtual ~Clock() = default;
  [[nodiscard]] virtual TimePoint now() const noexcept = 0;
  /// Returns at `deadline` or, if that has passed, at once.
  virtual void sleep_until(TimePoint deadline) = 0;
};

/// What a thread does until a point in time or a message comes.
enum class WaitStrategy : std::uint8_t {
  kHybrid,  ///< sleeps; the last kSpinAhead before a point in time it looks at the clock instead
  kSpin,    ///< looks again and again, letting other threads run in between; never sleeps
  kBlock,   ///< sleeps
};
/// Longer than a real-time thread takes to wake up (p99, idle machine: 33 µs).
inline constexpr Duration kSpinAhead = std::chrono::microseconds(60);

/// CLOCK_MONOTONIC of this host.
class SteadyClock final : public Clock {
 public:
  explicit SteadyClock(WaitStrategy wait = WaitStrategy::kBlock) : wait_(wait) {}
  [[nodiscard]] TimePoint now() const noexcept override;
  void sleep_until(TimePoint deadline) override;

 private:
  WaitStrategy wait_;
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
