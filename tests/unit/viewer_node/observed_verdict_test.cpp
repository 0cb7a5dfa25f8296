// SPDX-License-Identifier: Apache-2.0
// What a viewer counts of a run, and the verdict on it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/telemetry/verdict/verdict.h"
#include "tests/unit/viewer_node/batches.h"
#include "viewer_node/recording/run_figures.h"

namespace palpate::viewer {
namespace {

using testing::HasSubstr;

TEST(ObservedVerdict, OfADeviceThatWasNeverHeardNamesTheKeysThatWereRefused) {
  const Session session;
  TelemetryMirror mirror;
  EXPECT_EQ(cause_of(judge(facts_of(facts_of(session, session.side()), mirror, {}))),
            "device_silent");
  MofcBatch mofc = mofc_batch(0, 0, 9);
  mofc.peers_refused = 7;
  mirror.take(mofc, time_of_tick(10));
  const auto findings = judge(facts_of(facts_of(session, session.side()), mirror, {}));
  ASSERT_EQ(findings.size(), 1u);
  EXPECT_THAT(findings.front().remedy, HasSubstr("7 connections were refused"));
}

// as in a merged recording, or after a restart
TEST(RunFigures, CountOverAllSessions) {
  RunFigures figures;
  figures.add(device_batch(0, 0, 99));
  figures.add(device_batch(1, 100, 199));
  figures.add(device_batch(1, 100, 199));  // twice
  figures.add(mofc_batch(0, 0, 199));
  figures.add(device_batch(0, 0, 49, kDeviceSession + 1));
  figures.add(mofc_batch(1, 200, 249));
  EXPECT_EQ(figures.device.loop.ticks, 250u);
  EXPECT_EQ(figures.device.answered_ticks, 250u);
  EXPECT_EQ(figures.mofc.ticks, 250u);
}

// as in a part that was cut out: what came before it is not counted
TEST(RunFigures, CountFromTheFirstBatch) {
  RunFigures figures;
  figures.is_part = true;
  figures.add(device_batch(40, 4000, 4099));
  figures.add(device_batch(41, 4100, 4199));
  MofcBatch mofc = mofc_batch(40, 4000, 4099);
  mofc.counters.contact_ticks = 3000;
  figures.add(mofc);
  mofc = mofc_batch(41, 4100, 4199);
  mofc.counters.contact_ticks = 3100;
  figures.add(mofc);
  EXPECT_EQ(figures.device.loop.ticks, 200u);
  EXPECT_EQ(figures.device.answered_ticks, 200u);
  EXPECT_EQ(figures.mofc.ticks, 200u);
  EXPECT_EQ(figures.mofc.contact_ticks, 200u);

  // who begins to observe late still hears what was counted, as a fault that was latched before
  RunFigures late;
  DeviceBatch faulted = device_batch(40, 4000, 4099);
  faulted.counters.device_faults = 1;
  late.add(faulted);
  EXPECT_EQ(late.device.loop.ticks, 4100u);
  EXPECT_EQ(late.device.device_faults, 1u);
}

// the counters are read before the records are taken: a tick between is missing from them
TEST(RunFigures, CountNoFewerTicksThanWereReceived) {
  RunFigures figures;
  figures.is_part = true;
  for (std::uint64_t batch = 40; batch < 43; ++batch) {
    DeviceBatch device = device_batch(batch, 100 * batch, 100 * batch + 99);
    if (batch == 42) device.counters.loop.ticks -= 1;
    figures.add(device);
  }
  EXPECT_EQ(figures.device.loop.ticks, 300u);
}

// a replay goes through the same starts of the nodes again and again
TEST(ObservedVerdict, OfAReplayNamesTheRestartsOfTheRun) {
  TelemetryMirror mirror;
  for (std::uint64_t i = 0; i < 3; ++i) {
    const TimePoint now = time_of_tick(10'000 * i);
    mirror.take(device_batch(0, 0, 9), now);
    mirror.take(device_batch(0, 0, 9, kDeviceSession + 1), now + std::chrono::seconds(5));
    mirror.take(mofc_batch(0, 0, 9), now);
    mirror.take(physics_batch(0, 0, 9), now);
  }
  RunFacts facts = facts_of(RunFacts{}, mirror, {});
  leave_out_runs(facts, 0);
  EXPECT_EQ(facts.device_node.restarts, 1u);
  EXPECT_EQ(facts.mofc_node.restarts, 0u);
}

// in a recording of several runs; where it is one, all three nodes were restarted
TEST(ObservedVerdict, NamesNoRestartWhereAnotherRunBegan) {
  TelemetryMirror mirror;
  for (std::uint64_t run = 0; run < 2; ++run) {
    mirror.take(device_batch(0, 0, 9, kDeviceSession + run), time_of_tick(10));
    mirror.take(mofc_batch(0, 0, 9, kDeviceSession + run, kMofcSession + run), time_of_tick(10));
    mirror.take(physics_batch(0, 0, 9, kPhysicsSession + run), time_of_tick(10));
  }
  mirror.take(physics_batch(0, 0, 9, kPhysicsSession + 2), time_of_tick(10));
  RunFacts facts = facts_of(RunFacts{}, mirror, {});
  const RunFacts one_run = facts;
  EXPECT_EQ(one_run.device_node.restarts, 1u);
  EXPECT_EQ(one_run.mofc_node.restarts, 1u);
  leave_out_runs(facts, 1);
  EXPECT_EQ(facts.device_node.restarts, 0u);
  EXPECT_EQ(facts.mofc_node.restarts, 0u);
  EXPECT_EQ(facts.physics_node.restarts, 1u);
}

// but for the gap, its steps were quick
TEST(RunFigures, MeasureHowLongThePhysicsStoodStill) {
  RunFigures figures;
  figures.add(physics_batch(0, 0, 999));
  PhysicsBatch later = physics_batch(1, 1000, 1999);
  for (PhysicsTick& tick : later.records) tick.stepped_at += std::chrono::milliseconds(1400);
  figures.add(later);
  EXPECT_EQ(figures.physics_gap, std::chrono::milliseconds(1401));
  EXPECT_NEAR(figures.physics_busy_ratio(), 0.003 * 1999 / 3399, 1e-9);
}

// as it wakes, the link may be full of what the stopped process could not send
TEST(RunFigures, MeasureItWhereTelemetryOfThatTimeIsLost) {
  RunFigures figures;
  figures.add(physics_batch(0, 0, 999));
  PhysicsBatch later = physics_batch(2, 1015, 1999);
  figures.add(later);
  EXPECT_NEAR(to_seconds(figures.physics_gap), 1e-3, 1e-9);  // 15 steps, each in time
  later = physics_batch(4, 2015, 2999);
  for (PhysicsTick& tick : later.records) tick.stepped_at += std::chrono::milliseconds(1300);
  figures.add(later);
  EXPECT_NEAR(to_seconds(figures.physics_gap), 1.301, 1e-6);
}

// of what happened before a viewer, or a recording, began in the middle of a run
TEST(RunFigures, OfALateBeginCountOnlyWhatWasSeen) {
  RunFigures figures;
  DeviceBatch device = device_batch(400, 4000, 4099);
  device.counters.loop.skipped_ticks = 700;
  figures.add(device);
  MofcBatch mofc = mofc_batch(400, 4000, 4099);
  mofc.counters.contact_ticks = 3000;
  mofc.counters.clamped_ticks = 2900;
  figures.add(mofc);
  device = device_batch(401, 4100, 4199);
  device.counters.loop.skipped_ticks = 703;
  figures.add(device);
  EXPECT_EQ(figures.device.loop.ticks, 200u);
  EXPECT_EQ(figures.device.loop.skipped_ticks, 3u);
  EXPECT_EQ(figures.device.answered_ticks, 200u);
  EXPECT_EQ(figures.mofc.contact_ticks, 100u);
  EXPECT_EQ(figures.mofc.clamped_ticks, 0u);
  // a node that is restarted is seen from its start, though its first batches may be lost
  figures.add(device_batch(70, 700, 799, kDeviceSession + 1));
  EXPECT_EQ(figures.device.loop.ticks, 1000u);
}

TEST(RunFigures, CountTheAnswersToAClutchedHand) {
  RunFigures figures;
  MofcBatch mofc = mofc_batch(0, 0, 9);
  for (MofcTick& tick : mofc.records) tick.state = MofcState::kClutched;
  figures.add(mofc);
  figures.add(mofc);  // twice
  EXPECT_EQ(figures.clutched_ticks, 10u);
}

// 3 s of loading do not make a physics slow; a stop of 3 s does
TEST(RunFigures, MeasureTheRateOfThePhysicsWhileItRuns) {
  RunFigures figures;
  EXPECT_TRUE(std::isnan(figures.physics_hz()));
  figures.add(physics_batch(0, 0, 1000));
  EXPECT_DOUBLE_EQ(figures.physics_hz(), 1000.0);
  PhysicsBatch again = physics_batch(0, 0, 1000, kPhysicsSession + 1);
  for (PhysicsTick& tick : again.records) tick.stepped_at += std::chrono::seconds(4);
  figures.add(again);
  EXPECT_DOUBLE_EQ(figures.physics_hz(), 1000.0);
  PhysicsBatch later = physics_batch(1, 1001, 1001, kPhysicsSession + 1);
  later.records.front().stepped_at += std::chrono::seconds(7);
  figures.add(later);
  EXPECT_NEAR(figures.physics_hz(), 2001.0 / 5.001, 1e-9);
  figures.add(physics_batch(0, 0, 3, kPhysicsSession + 1));  // late: counted already
  EXPECT_NEAR(figures.physics_hz(), 2001.0 / 5.001, 1e-9);
}

}  // namespace
}  // namespace palpate::viewer
