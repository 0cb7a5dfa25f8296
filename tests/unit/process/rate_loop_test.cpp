// SPDX-License-Identifier: Apache-2.0
#include "common/process/rate_loop.h"

#include <gtest/gtest.h>

#include <vector>

namespace palpate {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

TimePoint at(Duration since_start) { return TimePoint{} + since_start; }

// 1 kHz from 0: turns are due at 0, 1, 2, 3 ms. The manual clock sleeps exactly.
TEST(RateLoop, BeginsEachTurnWhenItIsDue) {
  ManualClock clock;
  RateLoop loop(clock, 1000.0);
  std::stop_source stop;
  std::vector<TimePoint> begun;

  loop.run(stop.get_token(), [&](const Tick& tick) {
    begun.push_back(tick.now);
    if (tick.index == 3) stop.request_stop();
  });

  EXPECT_EQ(begun, (std::vector{at(milliseconds(0)), at(milliseconds(1)), at(milliseconds(2)),
                                at(milliseconds(3))}));
  EXPECT_EQ(loop.counters().ticks, 4u);
  EXPECT_EQ(loop.counters().skipped_ticks, 0u);
}

// Turn 0 takes 2.5 ms: turns 1 and 2 (1 ms, 2 ms) are missed, the next one is number 3.
TEST(RateLoop, SkipsAndCountsTheTurnsMissedByAnOverrun) {
  ManualClock clock;
  RateLoop loop(clock, 1000.0);
  std::stop_source stop;
  std::vector<std::uint64_t> turns;

  loop.run(stop.get_token(), [&](const Tick& tick) {
    turns.push_back(tick.index);
    if (tick.index == 0) clock.advance(microseconds(2500));
    if (tick.index >= 4) stop.request_stop();
  });

  EXPECT_EQ(turns, (std::vector<std::uint64_t>{0, 3, 4}));
  EXPECT_EQ(loop.counters().skipped_ticks, 2u);
}

/// Wakes 30 µs after every deadline.
class LateClock final : public Clock {
 public:
  [[nodiscard]] TimePoint now() const noexcept override { return now_; }
  void sleep_until(TimePoint deadline) override {
    now_ = std::max(now_, deadline) + microseconds(30);
  }

 private:
  TimePoint now_{};
};

TEST(RateLoop, MeasuresHowLateEachTurnBegan) {
  LateClock clock;
  RateLoop loop(clock, 1000.0);
  std::stop_source stop;

  loop.run(stop.get_token(), [&](const Tick& tick) {
    EXPECT_EQ(tick.now - tick.scheduled_at, Duration(microseconds(30)));
    if (tick.index == 9) stop.request_stop();
  });

  EXPECT_EQ(loop.lateness().count(), 10u);
  EXPECT_EQ(loop.lateness().maximum(), Duration(microseconds(30)));
  EXPECT_EQ(loop.counters().worst_lateness, Duration(microseconds(30)));
}

TEST(RateLoop, DoesNothingWhenStoppedBeforeItBegins) {
  ManualClock clock;
  RateLoop loop(clock, 1000.0);
  std::stop_source stop;
  stop.request_stop();

  loop.run(stop.get_token(), [](const Tick&) { FAIL() << "a turn began"; });

  EXPECT_EQ(loop.counters().ticks, 0u);
}

}  // namespace
}  // namespace palpate
