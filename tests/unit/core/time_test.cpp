// SPDX-License-Identifier: Apache-2.0
// Time conversions, clocks, the schedule of a loop, seeded random numbers.
#include "common/core/time.h"

#include <gtest/gtest.h>

#include <string>

#include "common/core/clock.h"
#include "common/core/random.h"
#include "common/core/tick_schedule.h"
#include "common/session/session.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;

TEST(Time, SecondsAreRoundedToTheNearestNanosecond) {
  EXPECT_EQ(from_seconds(1e-9), 1ns);
  EXPECT_EQ(from_seconds(1.4e-9), 1ns);
  EXPECT_EQ(from_seconds(1.6e-9), 2ns);
  EXPECT_EQ(from_seconds(-1.6e-9), -2ns);
  EXPECT_EQ(from_seconds(1.0 / 3.0), 333'333'333ns);
  EXPECT_DOUBLE_EQ(to_seconds(1500us), 0.0015);
  EXPECT_EQ(time_at(2.5), TimePoint{} + 2500ms);
  EXPECT_DOUBLE_EQ(seconds_of(TimePoint{} + 2500ms), 2.5);
}

TEST(ManualClock, MovesForwardOnly) {
  ManualClock clock;
  clock.sleep_until(TimePoint{} + 5ms);
  EXPECT_EQ(clock.now(), TimePoint{} + 5ms);
  clock.sleep_until(TimePoint{} + 3ms);
  EXPECT_EQ(clock.now(), TimePoint{} + 5ms);
}

// --- tick schedule ----------------------------------------------------------------------------

constexpr TimePoint kFirstTick{5s};

TEST(TickSchedule, KeepsAbsoluteTimes) {
  TickSchedule schedule(kFirstTick, 1000.0);
  for (std::int64_t i = 0; i < 100; ++i) {
    ASSERT_EQ(schedule.next(), kFirstTick + i * 1ms);
    const Tick tick =
        schedule.begin(schedule.next() + 10us);  // a late tick does not shift the next
    ASSERT_EQ(tick.index, static_cast<std::uint64_t>(i));
    ASSERT_EQ(tick.scheduled_at, kFirstTick + i * 1ms);
    ASSERT_EQ(tick.now, kFirstTick + i * 1ms + 10us);
    schedule.finish(tick.now + 500us);
  }
  EXPECT_EQ(schedule.begun(), 100u);
  EXPECT_EQ(schedule.skipped(), 0u);
}

TEST(TickSchedule, SkipsWholePeriodsAfterAnOverrunWithoutABurst) {
  TickSchedule schedule(kFirstTick, 1000.0);
  static_cast<void>(schedule.begin(kFirstTick));
  schedule.finish(kFirstTick + 3500us);  // the ticks at 1, 2 and 3 ms are past
  EXPECT_EQ(schedule.next(), kFirstTick + 4ms);
  EXPECT_EQ(schedule.skipped(), 3u);
  EXPECT_EQ(schedule.begin(kFirstTick + 4ms).index, 4u);
}

TEST(TickSchedule, EndingExactlyAtTheNextTickSkipsNothing) {
  TickSchedule schedule(kFirstTick, 1000.0);
  static_cast<void>(schedule.begin(kFirstTick));
  schedule.finish(kFirstTick + 2ms);
  EXPECT_EQ(schedule.next(), kFirstTick + 2ms);
  EXPECT_EQ(schedule.skipped(), 1u);
  static_cast<void>(schedule.begin(kFirstTick + 2ms));
  schedule.finish(kFirstTick + 3ms);
  EXPECT_EQ(schedule.next(), kFirstTick + 3ms);
  EXPECT_EQ(schedule.skipped(), 1u);
}

TEST(TickSchedule, NeverSkipsAFutureTick) {
  // overruns of every length, at rates whose period is not a whole number of nanoseconds
  for (const double rate : {3000.0, 7.0, 44100.0 / 7.0}) {
    TickSchedule schedule(kFirstTick, rate);
    TimePoint now = kFirstTick;
    Random random(4);
    for (int i = 0; i < 10'000; ++i) {
      static_cast<void>(schedule.begin(schedule.next()));
      const TimePoint before = schedule.next();
      now = before + from_seconds(random.uniform(0.0, 20.0) / rate);
      schedule.finish(now);
      ASSERT_GE(schedule.next(), now);
      ASSERT_GT(schedule.next(), before);
      ASSERT_LT(schedule.next() - std::max(now, before), schedule.period() + 2ns);
    }
  }
}

TEST(TickSchedule, DoesNotDriftAtThreeKilohertz) {
  TickSchedule schedule(kFirstTick, 3000.0);
  for (int i = 0; i < 3000 * 600; ++i) {
    static_cast<void>(schedule.begin(schedule.next()));
    schedule.finish(schedule.next());
  }
  EXPECT_EQ(schedule.next(),
            kFirstTick + 600s);  // a period rounded to 333333 ns would be 0.6 ms off
}

// --- random -----------------------------------------------------------------------------------

TEST(Random, IsTheSameOnEveryMachine) {
  // The standard fixes mt19937_64: its 10000th output from the default seed 5489.
  Random random(5489);
  for (int i = 0; i < 9999; ++i) static_cast<void>(random.bits());
  EXPECT_EQ(random.bits(), 9981545732273789042ULL);
}

TEST(Random, DirectionsAreUnitAndNormalsHaveUnitVariance) {
  Random random(1);
  constexpr int kMany = 100'000;
  Vector3 mean = Vector3::Zero();
  double sum = 0.0;
  double sum2 = 0.0;
  for (int i = 0; i < kMany; ++i) {
    const Vector3 d = random.direction();
    ASSERT_NEAR(d.norm(), 1.0, 1e-12);
    mean += d / kMany;
    const double x = random.normal();
    sum += x / kMany;
    sum2 += x * x / kMany;
  }
  // standard deviations: 1/√(3n) per axis, 1/√n, √(2/n); five of each
  EXPECT_LT(mean.cwiseAbs().maxCoeff(), 5.0 / std::sqrt(3.0 * kMany));
  EXPECT_NEAR(sum, 0.0, 5.0 / std::sqrt(1.0 * kMany));
  EXPECT_NEAR(sum2, 1.0, 5.0 * std::sqrt(2.0 / kMany));
}

TEST(StreamSeed, IsRepeatableAndDiffersBetweenStreamsAndSessions) {
  EXPECT_EQ(stream_seed(1, "hand"), stream_seed(1, "hand"));
  EXPECT_NE(stream_seed(1, "hand"), stream_seed(1, "interaction"));
  EXPECT_NE(stream_seed(1, "hand"), stream_seed(2, "hand"));
}

}  // namespace
}  // namespace palpate
