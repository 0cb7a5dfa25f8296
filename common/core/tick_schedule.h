// SPDX-License-Identifier: Apache-2.0
// tick_schedule.h — the schedule of a periodic loop, in real and in virtual time.
#pragma once

#include <cstdint>

#include "common/core/time.h"

namespace palpate {

/// One tick of a periodic loop.
struct Tick {
  std::uint64_t index = 0;  ///< from 0; skipped ticks are included in the count
  TimePoint scheduled_at{};
  TimePoint now{};  ///< when the tick actually began
};

/// Ticks at absolute times start + n·period. After an overrun whole periods are skipped and counted
/// instead of being caught up in a burst. The period is stored as a rate so that 3 kHz does not
/// drift.
class TickSchedule {
 public:
  /// `rate_hz` > 0, finite.
  TickSchedule(TimePoint start, double rate_hz) : start_(start), rate_hz_(rate_hz) {}

  [[nodiscard]] TimePoint next() const noexcept { return at(index_); }
  [[nodiscard]] Duration period() const noexcept { return from_seconds(1.0 / rate_hz_); }

  /// Begins the current tick.
  [[nodiscard]] Tick begin(TimePoint now) noexcept {
    ++begun_;
    return {.index = index_, .scheduled_at = next(), .now = now};
  }

  /// Ends the tick at `now` and moves to the first scheduled time that is not in the past.
  void finish(TimePoint now) noexcept {
    ++index_;
    if (now > at(index_)) {
      const auto reached =
          static_cast<std::uint64_t>(seconds_of(now) * rate_hz_ - seconds_of(start_) * rate_hz_);
      std::uint64_t target = reached > index_ ? reached : index_;
      while (at(target) < now) ++target;
      skipped_ += target - index_;
      index_ = target;
    }
  }

  [[nodiscard]] std::uint64_t begun() const noexcept { return begun_; }
  [[nodiscard]] std::uint64_t skipped() const noexcept { return skipped_; }

 private:
  [[nodiscard]] TimePoint at(std::uint64_t index) const noexcept {
    return start_ + from_seconds(static_cast<double>(index) / rate_hz_);
  }

  TimePoint start_;
  double rate_hz_;
  std::uint64_t index_ = 0;
  std::uint64_t begun_ = 0;
  std::uint64_t skipped_ = 0;
};

}  // namespace palpate
