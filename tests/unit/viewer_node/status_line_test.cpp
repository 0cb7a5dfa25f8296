// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/feed/status_line.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/viewer_node/batches.h"

namespace palpate::viewer {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::Not;

const TimePoint kStart = time_at(100.0);

std::size_t columns(const std::string& text) {
  std::size_t count = 0;
  for (const char c : text) count += (static_cast<unsigned char>(c) & 0xC0U) != 0x80U ? 1 : 0;
  return count;
}

// One second of a healthy run: 85 µs late, answered after 140 µs but for 1 tick in 5000, 1.92 N of
// 2.40 N asked, every eighth tick clamped.
TelemetryMirror healthy() {
  DeviceBatch device = device_batch(0, 0, 999);
  for (DeviceTick& tick : device.records) {
    tick.lateness = 85us;
    tick.reply_time = 140us;
    tick.force_on_hand_newton = {0, 0, 1.92};
    tick.true_energy_joule = 4.0e-3;
  }
  device.counters.loop.ticks = 5000;
  device.counters.answered_ticks = 4999;
  MofcBatch mofc = mofc_batch(0, 0, 999);
  for (MofcTick& tick : mofc.records) {
    tick.requested_force_on_hand_newton = {0, 0, 2.4};
    tick.ledger_energy_joule = 3.1e-3;
    tick.force_age = 1100us;
    tick.is_clamped = tick.device_sequence % 8 == 0;
  }
  TelemetryMirror mirror;
  mirror.take(device, kStart);
  mirror.take(mofc, kStart);
  mirror.take(physics_batch(0, 0, 999), kStart);
  return mirror;
}

// 1.92/2.40 = 0.80 transparent; 125 of 1000 clamped is 12.5 %, which rounds to even.
TEST(StatusLine, SaysTheWholeSystemInOneLine) {
  EXPECT_EQ(status_line(healthy(), kStart),
            "1000.0 Hz  jitter p99 85 µs  reply p99 140 µs  answered 99.98 %  contact  "
            "|F| 1.92/2.40 N  clamp 12 %  E 3.1 mJ (true 4.0)  transp 0.80  age 1.1 ms  lost 0");
}

TEST(StatusLine, SaysWhoWasNeverHeard) {
  EXPECT_EQ(status_line(TelemetryMirror(), kStart),
            "device: not heard yet  mofc: not heard yet  physics: not heard yet");
}

TEST(StatusLine, SaysInWordsWhichNodeIsGone) {
  TelemetryMirror mirror = healthy();
  const TimePoint later = kStart + 2300ms;
  // the device goes on alone, in fallback
  DeviceBatch device = device_batch(1, 3000, 3300);
  for (DeviceTick& tick : device.records) tick.guard = GuardState::kFallback;
  mirror.take(device, later);
  mirror.take(physics_batch(1, 1000, 1001), later);

  const std::string line = status_line(mirror, later);

  EXPECT_THAT(line, testing::StartsWith("mofc: not heard for 2.3 s  1000.0 Hz"));
  EXPECT_THAT(line, HasSubstr("  fallback  |F| 1.00/- N  lost 0"));
  EXPECT_THAT(line, Not(HasSubstr("clamp")));
  EXPECT_THAT(line, Not(HasSubstr("physics")));
}

TEST(StatusLine, SaysInCapitalsThatTheDeviceHasAFaultAndWhich) {
  TelemetryMirror mirror = healthy();
  DeviceBatch device = device_batch(1, 1000, 1000);
  device.records[0].guard = GuardState::kFault;
  device.counters.last_fault = FaultReason::kPositionJumped;
  mirror.take(device, kStart);

  EXPECT_THAT(status_line(mirror, kStart), HasSubstr("  FAULT: position jumped  |F| "));

  // reset: the counters remember the reason, the line does not
  device = device_batch(2, 1001, 1001);
  device.counters.last_fault = FaultReason::kPositionJumped;
  mirror.take(device, kStart);
  EXPECT_THAT(status_line(mirror, kStart), Not(HasSubstr("FAULT")));
}

TEST(StatusLine, SaysNothingOfTicksOnceTheDeviceIsGone) {
  EXPECT_EQ(status_line(healthy(), kStart + 61s),
            "device: not heard for 61.0 s  mofc: not heard for 61.0 s  physics: not heard for "
            "61.0 s");
}

TEST(StatusLine, CountsMessagesLostOnTheHopsOfTheTick) {
  TelemetryMirror mirror = healthy();
  DeviceBatch device = device_batch(3, 1000, 1000);  // batches 1 and 2 are lost
  device.counters.force_command.skipped = 3;
  device.records_lost = 5;
  MofcBatch mofc = mofc_batch(1, 1000, 1000);
  mofc.counters.device_state.skipped = 4;
  mofc.counters.interaction.skipped = 1000;  // overtaken, as newest-wins allows
  mirror.take(device, kStart);
  mirror.take(mofc, kStart);

  EXPECT_THAT(status_line(mirror, kStart), testing::EndsWith("  lost 7 (telemetry 7)"));
}

TEST(StatusLine, ShowsWhatIsNotKnownAsADash) {
  TelemetryMirror mirror;
  mirror.take(device_batch(0, 0, 9), kStart);
  MofcBatch mofc = mofc_batch(0, 0, 9);
  for (MofcTick& tick : mofc.records) {
    tick.state = MofcState::kNoPhysics;
    tick.requested_force_on_hand_newton = Vector3::Zero();
  }
  mirror.take(mofc, kStart);
  mirror.take(physics_batch(0, 0, 0), kStart);

  const std::string line = status_line(mirror, kStart);

  EXPECT_THAT(line, HasSubstr("  no physics  "));
  EXPECT_THAT(line, HasSubstr("  E - mJ  "));
  EXPECT_THAT(line, HasSubstr("  age -  "));
}

TEST(StatusLine, LeavesOutAFigureThatDoesNotFit) {
  TelemetryMirror mirror = healthy();
  DeviceBatch device = device_batch(1, 1000, 1000);
  device.records[0].force_on_hand_newton = {0, 0, 1e150};
  mirror.take(device, kStart);
  mirror.take(mofc_batch(1, 1000, 1000), kStart);

  const std::string line = status_line(mirror, kStart);

  EXPECT_LE(columns(line), kStatusColumns);
  EXPECT_THAT(line, Not(HasSubstr("|F|")));
  EXPECT_THAT(line, HasSubstr("  contact  clamp 12 %  "));
  EXPECT_THAT(line, testing::EndsWith("  lost 0"));
}

TEST(StatusLine, FitsANarrowTerminal) {
  const TelemetryMirror mirror = healthy();
  for (const std::size_t width : {0U, 10U, 40U, 80U, 100U}) {
    const std::string line = status_line(mirror, kStart, width);
    EXPECT_LE(columns(line), width);
    EXPECT_EQ(line.empty(), width < 10U);
  }
}

}  // namespace
}  // namespace palpate::viewer
