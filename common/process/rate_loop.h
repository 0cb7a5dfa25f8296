// SPDX-License-Identifier: Apache-2.0
// rate_loop.h — the periodic thread: begins each turn at an absolute time and measures its
// lateness.
#pragma once

#include <stop_token>
#include <utility>

#include "common/core/clock.h"
#include "common/core/tick_schedule.h"
#include "common/telemetry/metrics.h"
#include "common/telemetry/telemetry.h"

namespace palpate {

/// Runs on the calling thread. After an overrun the missed turns are skipped and counted, never
/// made up for in a burst. The loop itself does not allocate, lock or throw.
class RateLoop {
 public:
  /// `rate_hz` > 0, finite.
  RateLoop(Clock& clock, double rate_hz) : clock_(clock), rate_hz_(rate_hz) {}

  /// Calls `body(const Tick&)` at start + n / rate until `stop` is requested; the first turn begins
  /// at once. The loop ends within one period after the request.
  template <class Body>
  void run(const std::stop_token& stop, Body&& body) {
    wake_exactly();
    TickSchedule schedule(clock_.now(), rate_hz_);
    while (!stop.stop_requested()) {
      clock_.sleep_until(schedule.next());
      const Tick tick = schedule.begin(clock_.now());
      lateness_.add(tick.now - tick.scheduled_at);
      counters_.ticks = schedule.begun();
      counters_.worst_lateness = lateness_.maximum();
      body(tick);
      schedule.finish(clock_.now());
      counters_.skipped_ticks = schedule.skipped();
    }
  }

  /// Of the last run. The body may read them, other threads may not.
  [[nodiscard]] const LoopCounters& counters() const { return counters_; }
  /// Delay between the scheduled and the actual begin of each turn.
  [[nodiscard]] const DurationHistogram& lateness() const { return lateness_; }

 private:
  /// Removes the kernel's default 50 µs of slack from the timers of this thread.
  static void wake_exactly() noexcept;

  Clock& clock_;
  double rate_hz_;
  DurationHistogram lateness_;
  LoopCounters counters_;
};

}  // namespace palpate
