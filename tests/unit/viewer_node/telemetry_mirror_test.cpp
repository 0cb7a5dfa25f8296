// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/feed/telemetry_mirror.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "common/core/random.h"
#include "tests/unit/viewer_node/batches.h"

namespace palpate::viewer {
namespace {

using namespace std::chrono_literals;

const TimePoint kArrival =
    time_at(100.0);  // the viewer's clock has nothing to do with the device's

struct Rows {
  explicit Rows(TelemetryMirror& mirror) {
    mirror.on_row = [this](const TickRow& row) { all.push_back(row); };
  }
  [[nodiscard]] std::vector<std::uint64_t> sequences() const {
    std::vector<std::uint64_t> sequences;
    for (const TickRow& row : all) sequences.push_back(row.device.sequence);
    return sequences;
  }
  std::vector<TickRow> all;
};

std::vector<std::uint64_t> counting(std::uint64_t first, std::uint64_t last) {
  std::vector<std::uint64_t> numbers;
  for (std::uint64_t n = first; n <= last; ++n) numbers.push_back(n);
  return numbers;
}

// --- links ------------------------------------------------------------------------------------

TEST(TelemetryMirror, KnowsNothingBeforeTheFirstBatch) {
  const TelemetryMirror mirror;

  EXPECT_FALSE(mirror.device_link().is_heard());
  EXPECT_FALSE(mirror.device_link().is_alive(kArrival));
  const TelemetryFigures figures = mirror.figures();
  EXPECT_TRUE(std::isnan(figures.tick_rate_hz));
  EXPECT_TRUE(std::isnan(figures.transparency));
  EXPECT_TRUE(std::isnan(figures.answered_ratio_since_start));
  EXPECT_EQ(figures.lateness_p99, std::nullopt);
  EXPECT_EQ(figures.force_age_p50, std::nullopt);
}

TEST(TelemetryMirror, TakesANodeForGoneAfterTwoSecondsOfItsOwnClock) {
  TelemetryMirror mirror;
  mirror.take(mofc_batch(0, 0, 0), kArrival);

  EXPECT_TRUE(mirror.mofc_link().is_alive(kArrival + 2s));
  EXPECT_FALSE(mirror.mofc_link().is_gone(kArrival + 2s));
  EXPECT_TRUE(mirror.mofc_link().is_gone(kArrival + 2s + 1ns));
  mirror.take(mofc_batch(1, 1, 1), kArrival + 5s);
  EXPECT_TRUE(mirror.mofc_link().is_alive(kArrival + 5s));
}

TEST(TelemetryMirror, CountsLostBatchesByTheirSequence) {
  TelemetryMirror mirror;
  for (const std::uint64_t batch : {7U, 8U, 11U, 12U}) {  // joined at 7; 9 and 10 are lost
    mirror.take(device_batch(batch, batch, batch), kArrival);
  }

  EXPECT_EQ(mirror.device_link().batches_received, 4U);
  EXPECT_EQ(mirror.device_link().batches_lost, 2U);
}

TEST(TelemetryMirror, TakesALossBackWhenTheBatchComesLate) {
  TelemetryMirror mirror;
  for (const std::uint64_t batch : {0U, 3U, 1U, 2U}) {
    mirror.take(device_batch(batch, batch, batch), kArrival);
  }

  EXPECT_EQ(mirror.device_link().batches_received, 4U);
  EXPECT_EQ(mirror.device_link().batches_lost, 0U);
  EXPECT_EQ(mirror.ticks().size(), 4U);
}

TEST(TelemetryMirror, DoesNotCreditABatchFromBeforeItJoinedAgainstALoss) {
  TelemetryMirror mirror;
  for (const std::uint64_t batch : {5U, 7U, 4U}) {
    mirror.take(device_batch(batch, batch, batch), kArrival);
  }

  EXPECT_EQ(mirror.device_link().batches_lost, 1U);
}

TEST(TelemetryMirror, TakesABatchOnce) {
  TelemetryMirror mirror;
  for (const std::uint64_t batch : {0U, 1U, 1U, 0U, 100U, 1U}) {
    mirror.take(physics_batch(batch, batch, batch), kArrival);
  }

  EXPECT_EQ(mirror.physics_link().batches_received, 3U);
  EXPECT_EQ(mirror.physics_link().batches_lost, 98U);
}

TEST(TelemetryMirror, KeepsTheNewestCountersWhenBatchesChangePlaces) {
  TelemetryMirror mirror;
  mirror.take(device_batch(1, 10, 19), kArrival);
  mirror.take(device_batch(0, 0, 9), kArrival);

  EXPECT_EQ(mirror.device_counters().loop.ticks, 20U);
}

// Two physics that take over from each other: the one that is back counts once the other is gone.
TEST(TelemetryMirror, ANodeThatSpeaksAgainIsHeardOnceTheOtherIsGone) {
  TelemetryMirror mirror;
  DeviceBatch first = device_batch(0, 0, 9);
  mirror.take(first, kArrival);
  mirror.take(device_batch(0, 0, 9, 12), kArrival + std::chrono::seconds(1));
  first.header.sequence = 1;
  mirror.take(first, kArrival + std::chrono::milliseconds(2900));
  EXPECT_EQ(mirror.device_link().heard_at, kArrival + std::chrono::seconds(1));
  first.header.sequence = 2;
  mirror.take(first, kArrival + std::chrono::milliseconds(3100));
  EXPECT_EQ(mirror.device_link().heard_at, kArrival + std::chrono::milliseconds(3100));
  EXPECT_EQ(mirror.device_link().sessions, 2U);  // it was not restarted
}

TEST(TelemetryMirror, StartsAgainWithARestartedNodeAndRefusesTheOldOne) {
  TelemetryMirror mirror;
  mirror.take(device_batch(50, 500, 509), kArrival);
  mirror.take(device_batch(0, 0, 4, 12), kArrival);
  mirror.take(device_batch(51, 510, 519), kArrival);  // a straggler of the session before

  EXPECT_EQ(mirror.device_link().sessions, 2U);
  EXPECT_EQ(mirror.device_link().batches_lost, 0U);
  EXPECT_EQ(mirror.device_counters().loop.ticks, 5U);
  EXPECT_EQ(mirror.ticks().size(), 5U);
  EXPECT_EQ(mirror.ticks().rbegin()->first, 4U);
}

// --- joining ----------------------------------------------------------------------------------

TEST(TelemetryMirror, JoinsBothHalvesOfATickInEitherOrder) {
  TelemetryMirror mirror;
  mirror.take(device_batch(0, 0, 1), kArrival);
  mirror.take(mofc_batch(0, 0, 3), kArrival);
  mirror.take(device_batch(1, 2, 3), kArrival);

  ASSERT_EQ(mirror.ticks().size(), 4U);
  for (const auto& [sequence, tick] : mirror.ticks()) {
    ASSERT_TRUE(tick.device && tick.mofc);
    EXPECT_EQ(tick.device->sequence, sequence);
    EXPECT_EQ(tick.mofc->device_sequence, sequence);
  }
}

TEST(TelemetryMirror, NeverJoinsTicksOfDifferentDeviceSessions) {
  TelemetryMirror mirror;
  mirror.take(device_batch(0, 0, 9), kArrival);
  // mofc is the first to speak of the new device session; its batch spans both
  MofcBatch both = mofc_batch(0, 0, 9);
  const MofcBatch later = mofc_batch(0, 0, 3, 12);
  both.records.insert(both.records.end(), later.records.begin(), later.records.end());
  mirror.take(both, kArrival);
  mirror.take(mofc_batch(1, 10, 12), kArrival);  // still about the old one

  ASSERT_EQ(mirror.ticks().size(), 4U);
  for (const auto& [sequence, tick] : mirror.ticks()) EXPECT_FALSE(tick.device);
  mirror.take(device_batch(0, 0, 3, 12), kArrival);
  for (const auto& [sequence, tick] : mirror.ticks()) EXPECT_TRUE(tick.device && tick.mofc);
}

TEST(TelemetryMirror, HoldsOneSecondOfTicks) {
  TelemetryMirror mirror;
  for (std::uint64_t batch = 0; batch < 500; ++batch) {
    mirror.take(device_batch(batch, 10 * batch, 10 * batch + 9), kArrival);
    mirror.take(physics_batch(batch, 10 * batch, 10 * batch + 9), kArrival);
  }

  // newest 4999 ms, so 3999 … 4999 ms
  EXPECT_EQ(mirror.ticks().size(), 1001U);
  EXPECT_EQ(mirror.ticks().begin()->first, 3999U);
  EXPECT_EQ(mirror.physics_ticks().size(), 1001U);
}

TEST(TelemetryMirror, IsBoundedWhateverTheStampsSay) {
  TelemetryMirror mirror;
  for (std::uint64_t batch = 0; batch < 100; ++batch) {
    DeviceBatch device = device_batch(batch, 1000 * batch, 1000 * batch + 999);
    for (DeviceTick& tick : device.records) tick.sampled_at = kArrival;
    mirror.take(device, kArrival);
    PhysicsBatch physics = physics_batch(batch, 1000 * batch, 1000 * batch + 999);
    for (PhysicsTick& tick : physics.records) tick.stepped_at = kArrival;
    mirror.take(physics, kArrival);
  }

  EXPECT_EQ(mirror.ticks().size(), kMaxTicksHeld);
  EXPECT_EQ(mirror.physics_ticks().size(), kMaxTicksHeld);
}

TEST(TelemetryMirror, HoldsThePhysicsTicksOfOneSessionOnly) {
  TelemetryMirror mirror;
  mirror.take(physics_batch(5, 100, 109), kArrival);
  mirror.take(physics_batch(0, 0, 2, 34), kArrival);

  EXPECT_EQ(mirror.physics_ticks().size(), 3U);
}

// --- rows -------------------------------------------------------------------------------------

TEST(TelemetryMirrorRows, ComeOnceEachInOrderAndJoined) {
  TelemetryMirror mirror;
  const Rows rows(mirror);
  for (std::uint64_t batch = 0; batch < 200; ++batch) {
    const std::uint64_t first = 10 * batch;
    if (batch >= 3) mirror.take(mofc_batch(batch - 3, first - 30, first - 21), kArrival);
    mirror.take(device_batch(batch, first, first + 9), kArrival);
  }

  // mofc is 30 ticks behind: 0 … 1969 are joined, the rest still wait for their other half
  EXPECT_EQ(rows.sequences(), counting(0, 1969));
  EXPECT_TRUE(std::all_of(rows.all.begin(), rows.all.end(), [](const TickRow& row) {
    return row.mofc && row.mofc->device_sequence == row.device.sequence &&
           row.device_session_id == kDeviceSession;
  }));
  mirror.flush_rows();
  EXPECT_EQ(rows.sequences(), counting(0, 1999));
  EXPECT_FALSE(rows.all.back().mofc);
  mirror.flush_rows();
  EXPECT_EQ(rows.all.size(), 2000U);
}

TEST(TelemetryMirrorRows, ComeWithoutTheAnswerThatNeverCame) {
  TelemetryMirror mirror;
  const Rows rows(mirror);
  for (std::uint64_t batch = 0; batch < 100; ++batch) {
    mirror.take(device_batch(batch, 10 * batch, 10 * batch + 9), kArrival);
    if (batch != 20) mirror.take(mofc_batch(batch, 10 * batch, 10 * batch + 9), kArrival);
  }

  EXPECT_EQ(rows.sequences(), counting(0, 999));
  for (const TickRow& row : rows.all) {
    EXPECT_EQ(row.mofc.has_value(), row.device.sequence / 10 != 20) << row.device.sequence;
  }
}

TEST(TelemetryMirrorRows, LeaveOutTicksWhoseDeviceHalfIsLost) {
  TelemetryMirror mirror;
  const Rows rows(mirror);
  for (std::uint64_t batch = 0; batch < 100; ++batch) {
    if (batch != 20) mirror.take(device_batch(batch, 10 * batch, 10 * batch + 9), kArrival);
    mirror.take(mofc_batch(batch, 10 * batch, 10 * batch + 9), kArrival);
  }
  mirror.flush_rows();

  std::vector<std::uint64_t> expected = counting(0, 199);
  const std::vector<std::uint64_t> rest = counting(210, 999);
  expected.insert(expected.end(), rest.begin(), rest.end());
  EXPECT_EQ(rows.sequences(), expected);
}

// Batches of both nodes shuffled within 20 batches (200 ms, less than the wait), one in ten lost.
TEST(TelemetryMirrorRows, AreInOrderAndWholeUnderLossAndReordering) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    struct Arrival {
      double at;
      bool is_device;
      std::uint64_t batch;
    };
    std::vector<Arrival> arrivals;
    std::vector<std::uint64_t> expected;
    std::vector<bool> has_answer(300, false);
    for (std::uint64_t batch = 0; batch < 300; ++batch) {
      for (const bool is_device : {true, false}) {
        if (random.chance(0.1)) continue;
        arrivals.push_back({static_cast<double>(batch) + random.uniform(0, 20), is_device, batch});
        if (!is_device) has_answer[batch] = true;
        if (!is_device) continue;
        for (std::uint64_t n = 10 * batch; n < 10 * batch + 10; ++n) expected.push_back(n);
      }
    }
    std::sort(arrivals.begin(), arrivals.end(),
              [](const Arrival& a, const Arrival& b) { return a.at < b.at; });

    TelemetryMirror mirror;
    const Rows rows(mirror);
    for (const Arrival& arrival : arrivals) {
      const std::uint64_t first = 10 * arrival.batch;
      if (arrival.is_device) {
        mirror.take(device_batch(arrival.batch, first, first + 9), kArrival);
      } else {
        mirror.take(mofc_batch(arrival.batch, first, first + 9), kArrival);
      }
    }
    mirror.flush_rows();

    ASSERT_EQ(rows.sequences(), expected);
    for (const TickRow& row : rows.all) {
      ASSERT_EQ(row.mofc.has_value(), has_answer[row.device.sequence / 10]);
    }
  }
}

TEST(TelemetryMirrorRows, OfTheOldSessionComeBeforeThoseOfTheNew) {
  TelemetryMirror mirror;
  const Rows rows(mirror);
  mirror.take(device_batch(0, 0, 9), kArrival);
  mirror.take(device_batch(0, 0, 4, 12), kArrival);
  mirror.flush_rows();

  ASSERT_EQ(rows.all.size(), 15U);
  EXPECT_EQ(rows.all[9].device_session_id, kDeviceSession);
  EXPECT_EQ(rows.all[10].device_session_id, 12U);
  EXPECT_EQ(rows.all[10].device.sequence, 0U);
}

// --- figures ----------------------------------------------------------------------------------

TEST(TelemetryFigures, GiveTheTickRateDespiteLostBatches) {
  TelemetryMirror mirror;
  for (const std::uint64_t batch : {0U, 1U, 5U, 9U}) {
    mirror.take(device_batch(batch, 10 * batch, 10 * batch + 9), kArrival);
    mirror.take(physics_batch(batch, 10 * batch, 10 * batch + 9), kArrival);
  }

  // 99 periods of 1 ms between tick 0 and tick 99
  EXPECT_NEAR(mirror.figures().tick_rate_hz, 1000.0, 1e-9);
  EXPECT_NEAR(mirror.figures().physics_rate_hz, 1000.0, 1e-9);
  EXPECT_EQ(mirror.figures().compute_time_p99, Duration(3us));
}

TEST(TelemetryFigures, GivePercentilesOfLatenessAndReplyTime) {
  // 1 … 200 µs; the answer takes as long, but the slowest half is unanswered
  DeviceBatch batch = device_batch(0, 0, 199);
  for (std::size_t i = 0; i < 200; ++i) {
    DeviceTick& tick = batch.records[(7 * i) % 200];  // 7 and 200 have no common factor
    tick.lateness = std::chrono::microseconds(i + 1);
    tick.reply_time = tick.lateness;
    tick.is_answered = i < 100;
  }
  TelemetryMirror mirror;
  mirror.take(batch, kArrival);

  const TelemetryFigures figures = mirror.figures();
  EXPECT_EQ(figures.lateness_p99, Duration(198us));
  EXPECT_EQ(figures.lateness_max, Duration(200us));
  EXPECT_EQ(figures.reply_time_p50, Duration(50us));
  EXPECT_EQ(figures.reply_time_p99, Duration(99us));
}

TEST(TelemetryFigures, GiveTheShareOfScheduledTicksAnswered) {
  TelemetryMirror mirror;
  DeviceBatch batch = device_batch(0, 0, 0);
  const auto take = [&](std::uint64_t ticks, std::uint64_t skipped, std::uint64_t answered,
                        TimePoint now) {
    batch.counters.loop.ticks = ticks;
    batch.counters.loop.skipped_ticks = skipped;
    batch.counters.answered_ticks = answered;
    mirror.take(batch, now);
    ++batch.header.sequence;
  };

  take(100, 0, 50, kArrival);
  EXPECT_TRUE(std::isnan(mirror.figures().answered_ratio)) << "one batch makes no difference";
  take(900, 100, 540, kArrival + 500ms);
  // since start 540 / 1000; in the window 490 / 900
  EXPECT_DOUBLE_EQ(mirror.figures().answered_ratio_since_start, 0.54);
  EXPECT_DOUBLE_EQ(mirror.figures().answered_ratio, 490.0 / 900.0);
  take(1900, 100, 1530, kArrival + 1400ms);
  // the first batch has left the window: 990 / 1000
  EXPECT_DOUBLE_EQ(mirror.figures().answered_ratio, 0.99);
}

TEST(TelemetryFigures, CountAnsweredTicksOfOneDeviceSessionOnly) {
  TelemetryMirror mirror;
  mirror.take(device_batch(0, 0, 999), kArrival);
  DeviceBatch restarted = device_batch(0, 0, 9, 12);
  mirror.take(restarted, kArrival);
  restarted.header.sequence = 1;
  restarted.counters.loop.ticks = 20;
  restarted.counters.answered_ticks = 15;
  mirror.take(restarted, kArrival);

  // of ten ticks since the first batch of the new session five were answered
  EXPECT_DOUBLE_EQ(mirror.figures().answered_ratio, 0.5);
}

// Three ticks: 2 N asked along z and 1 N applied, clamped, until the second one, in which 4 N are
// asked and 4 N applied, until the third.
TEST(TelemetryFigures, CompareTheForceAskedWithTheForceApplied) {
  DeviceBatch device = device_batch(0, 0, 2);
  device.records[1].force_on_hand_newton = {0, 0, 4};
  device.records[2].force_on_hand_newton = {0, 0, 4};
  MofcBatch mofc = mofc_batch(0, 0, 2);
  mofc.records[1].requested_force_on_hand_newton = {0, 0, 4};
  mofc.records[2].requested_force_on_hand_newton = {0, 0, 4};
  mofc.records[0].is_clamped = true;
  TelemetryMirror mirror;
  mirror.take(device, kArrival);
  mirror.take(mofc, kArrival);

  const TelemetryFigures figures = mirror.figures();
  EXPECT_DOUBLE_EQ(figures.requested_newton, 4.0);
  EXPECT_DOUBLE_EQ(figures.applied_newton, 4.0);
  EXPECT_DOUBLE_EQ(figures.max_requested_newton, 4.0);
  EXPECT_DOUBLE_EQ(figures.max_applied_newton, 4.0);
  EXPECT_DOUBLE_EQ(figures.clamped_ratio, 1.0 / 3.0);
  EXPECT_DOUBLE_EQ(figures.transparency, 0.75);                            // (½ + 1)/2
  EXPECT_DOUBLE_EQ(figures.force_error_rms_ratio, std::sqrt(1.0 / 20.0));  // 1 N² of 4 + 16 N²
}

TEST(TelemetryFigures, TakeTheForceNowFromTheNewestTickThatBothSidesReported) {
  TelemetryMirror mirror;
  DeviceBatch device = device_batch(0, 0, 9);
  device.records[9].force_on_hand_newton = {0, 3, 0};
  mirror.take(device, kArrival);
  EXPECT_DOUBLE_EQ(mirror.figures().applied_newton, 3.0) << "nothing of mofc: the newest";
  EXPECT_TRUE(std::isnan(mirror.figures().requested_newton));

  mirror.take(mofc_batch(0, 0, 5), kArrival);

  EXPECT_DOUBLE_EQ(mirror.figures().applied_newton, 1.0);
  EXPECT_DOUBLE_EQ(mirror.figures().requested_newton, 2.0);
}

TEST(TelemetryFigures, GiveTheNewestEnergiesAndStates) {
  DeviceBatch device = device_batch(0, 0, 9);
  device.records[9].true_energy_joule = 4e-3;
  device.records[9].guard = GuardState::kLeased;
  MofcBatch mofc = mofc_batch(0, 0, 9);
  mofc.records[9].ledger_energy_joule = 3e-3;
  mofc.records[9].state = MofcState::kFree;
  mofc.records[9].is_in_contact = false;
  TelemetryMirror mirror;
  mirror.take(device, kArrival);
  mirror.take(mofc, kArrival);

  const TelemetryFigures figures = mirror.figures();
  EXPECT_EQ(figures.true_energy_joule, 4e-3);
  EXPECT_EQ(figures.ledger_energy_joule, 3e-3);
  EXPECT_EQ(figures.guard, GuardState::kLeased);
  EXPECT_EQ(figures.mofc_state, MofcState::kFree);
  EXPECT_FALSE(figures.is_in_contact);
}

TEST(TelemetryFigures, TakeTheForceAgeWherePhysicsHasSpoken) {
  MofcBatch mofc = mofc_batch(0, 0, 4);
  mofc.records[0].state = MofcState::kNoPhysics;
  mofc.records[1].state = MofcState::kClutched;
  mofc.records[2].force_age = 1ms;
  mofc.records[3].force_age = 5ms;
  mofc.records[4].force_age = 2ms;
  TelemetryMirror mirror;
  mirror.take(mofc, kArrival);

  EXPECT_EQ(mirror.figures().force_age_p50, Duration(2ms));
  EXPECT_EQ(mirror.figures().force_age_max, Duration(5ms));
}

TEST(TelemetryFigures, OfALateViewerAreThoseOfTheRunningNodes) {
  TelemetryMirror mirror;
  for (std::uint64_t batch = 100000; batch < 100010; ++batch) {
    mirror.take(device_batch(batch, 10 * batch, 10 * batch + 9), kArrival);
    mirror.take(mofc_batch(batch, 10 * batch, 10 * batch + 9), kArrival);
  }

  EXPECT_EQ(mirror.device_link().batches_lost, 0U);
  EXPECT_NEAR(mirror.figures().tick_rate_hz, 1000.0, 1e-9);
  EXPECT_DOUBLE_EQ(mirror.figures().transparency, 0.5);
  EXPECT_DOUBLE_EQ(mirror.figures().answered_ratio_since_start, 1.0);
}

}  // namespace
}  // namespace palpate::viewer
