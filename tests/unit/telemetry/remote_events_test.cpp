// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/remote_events.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace palpate {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

class RemoteEventsTest : public testing::Test {
 protected:
  /// A batch each 20 ms.
  std::vector<std::string> lines_of(std::uint64_t session_id, std::uint64_t sequence) {
    batch_.header.session_id = session_id;
    batch_.header.sequence = sequence;
    now_ += std::chrono::milliseconds(20);
    events_.note(batch_, now_);
    return std::exchange(lines_, {});
  }

  DeviceBatch batch_;
  TimePoint now_{};
  std::vector<std::string> lines_;
  RemoteEvents<DeviceTick, DeviceCounters> events_{
      [this](spdlog::level::level_enum level, const std::string& text) {
        lines_.push_back(std::string(spdlog::level::to_string_view(level).data()) + ' ' + text);
      }};
};

TEST_F(RemoteEventsTest, TellsWhatTheNodeItselfLogs) {
  batch_.counters.answered_ticks = 20;
  EXPECT_THAT(lines_of(1, 0), IsEmpty());
  batch_.counters.fallback_ticks = 5;
  EXPECT_THAT(lines_of(1, 1), ElementsAre("warning event=fallback_began"));
  batch_.counters.device_faults = 1;
  batch_.counters.last_fault = FaultReason::kReadFailed;
  EXPECT_THAT(lines_of(1, 2),
              ElementsAre(testing::StartsWith("error event=device_fault reason=\"read failed\"")));
}

TEST_F(RemoteEventsTest, WhatWasBeforeALateViewerIsHistory) {
  batch_.counters.answered_ticks = 1000;
  batch_.counters.fallback_ticks = 50;
  batch_.counters.device_faults = 1;
  batch_.counters.loop.skipped_ticks = 3;
  EXPECT_THAT(lines_of(1, 40), IsEmpty());
  EXPECT_THAT(lines_of(1, 41), IsEmpty());
  batch_.counters.loop.skipped_ticks = 5;
  EXPECT_THAT(lines_of(1, 42), ElementsAre("warning event=ticks_skipped count=2"));
}

TEST_F(RemoteEventsTest, ARestartedNodeBeginsAnew) {
  batch_.counters.device_faults = 1;
  static_cast<void>(lines_of(1, 40));
  batch_.counters.device_faults = 0;
  EXPECT_THAT(lines_of(2, 0), IsEmpty());
  batch_.counters.device_faults = 1;
  EXPECT_THAT(lines_of(2, 1), ElementsAre(testing::StartsWith("error event=device_fault")));
}

TEST_F(RemoteEventsTest, ABatchThatIsNotNewerSaysNothing) {
  batch_.counters.loop.skipped_ticks = 5;
  static_cast<void>(lines_of(1, 40));
  batch_.counters.loop.skipped_ticks = 4;  // the growth since then would be 2^64 − 1
  EXPECT_THAT(lines_of(1, 39), IsEmpty());
  EXPECT_THAT(lines_of(1, 40), IsEmpty());
}

}  // namespace
}  // namespace palpate
