// SPDX-License-Identifier: Apache-2.0
// clock.h — the clock interface that every component receives: steady in real time, manual in
// tests, virtual in lockstep (deploy/lockstep/virtual_time.h).
#pragma once

#include <cstdint>

#include "common/core/time.h"

namespace palpate {

class Clock {
 public:
  virtual ~Clock() = default;
  [[nodiscard]] virtual TimePoint now() const noexcept = 0;
  /// Returns at `deadline`; at once if it has passed.
  virtual void sleep_until(TimePoint deadline) = 0;
};

/// How a thread waits for a deadline or a message.
enum class WaitStrategy : std::uint8_t {
  kHybrid,  ///< sleeps until kSpinAhead before a deadline, then polls the clock
  kSpin,    ///< polls and yields the processor in between; never sleeps
  kBlock,   ///< sleeps
};
/// Longer than the wake-up latency of a real-time thread (p99 on an idle machine: 33 µs).
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

/// Wall clock, nanoseconds since 1970: for people and files, never for the loop.
[[nodiscard]] std::uint64_t wall_clock_ns() noexcept;

/// Advances only by sleep_until() and advance().
class ManualClock final : public Clock {
 public:
  [[nodiscard]] TimePoint now() const noexcept override { return now_; }
  void sleep_until(TimePoint deadline) override { now_ = deadline > now_ ? deadline : now_; }
  void advance(Duration d) { now_ += d; }

 private:
  TimePoint now_{};
};

}  // namespace palpate
