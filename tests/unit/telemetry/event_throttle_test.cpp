// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/event_throttle.h"

#include <gtest/gtest.h>

namespace palpate {
namespace {

using std::chrono::milliseconds;

TimePoint since_start(Duration duration) { return TimePoint{} + duration; }

TEST(EventThrottle, ReportsTheFirstOccurrenceAtOnce) {
  EventThrottle throttle;
  EXPECT_EQ(throttle.note(since_start(milliseconds(0)), 0), 0u);
  EXPECT_EQ(throttle.note(since_start(milliseconds(5)), 3), 3u);
}

// 2 + 4 occurrences are swallowed within the second after the first line, 1 comes at its end: 7.
TEST(EventThrottle, ThenReportsAtMostOnceASecondWithWhatItSwallowed) {
  EventThrottle throttle;
  ASSERT_EQ(throttle.note(since_start(milliseconds(0)), 1), 1u);

  EXPECT_EQ(throttle.note(since_start(milliseconds(1)), 2), 0u);
  EXPECT_EQ(throttle.note(since_start(milliseconds(999)), 4), 0u);
  EXPECT_EQ(throttle.note(since_start(milliseconds(1000)), 1), 7u);
}

// As the times of a recording, when the wall clock was set back an hour.
TEST(EventThrottle, LosesNothingWhenTheClockStepsBack) {
  EventThrottle throttle;
  ASSERT_EQ(throttle.note(since_start(std::chrono::hours(1)), 1), 1u);

  EXPECT_EQ(throttle.note(since_start(milliseconds(0)), 2), 2u);
  EXPECT_EQ(throttle.note(since_start(milliseconds(500)), 4), 0u);
  EXPECT_EQ(throttle.note(since_start(milliseconds(1000)), 0), 4u);
}

TEST(EventThrottle, ReportsSwallowedOccurrencesAlsoWhenNoMoreCome) {
  EventThrottle throttle;
  ASSERT_EQ(throttle.note(since_start(milliseconds(0)), 1), 1u);
  ASSERT_EQ(throttle.note(since_start(milliseconds(500)), 2), 0u);

  EXPECT_EQ(throttle.note(since_start(milliseconds(1500)), 0), 2u);
  EXPECT_EQ(throttle.note(since_start(milliseconds(9000)), 0), 0u);
}

}  // namespace
}  // namespace palpate
