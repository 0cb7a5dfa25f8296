// SPDX-License-Identifier: Apache-2.0
// The tick on a manual clock, which only the test and waits advance.
#include "device_node/device_node.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "common/core/clock.h"
#include "common/core/memory_link.h"
#include "device_node/simulation/simulated_device.h"
#include "device_node/suspend_watch.h"
#include "device_node/tick_watch.h"
#include "tests/support/device_node_bench.h"
#include "tests/support/scripted_device.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;
using test::device_config;
using test::DeviceNodeBench;
using test::ScriptedDevice;

using Bench = DeviceNodeBench<ScriptedDevice>;

void expect_segment(const AppliedForce& segment, const Vector3& force_newton, Duration from,
                    Duration until) {
  EXPECT_EQ(segment.force_on_hand_newton, force_newton);
  EXPECT_EQ(segment.from, TimePoint(from));
  EXPECT_EQ(segment.until, TimePoint(until));
}

TEST(DeviceNode, SendsWhatItReads) {
  DeviceConfig config = device_config();
  config.workspace.scale_ratio = 2.0;
  config.workspace.offset_m = Vector3(0, 0, 0.1);
  Bench bench(config);
  bench.device.position_m = Vector3(0.01, 0.02, 0.03);
  bench.device.orientation = Quaternion(0.6, 0.8, 0, 0);
  bench.device.buttons = 2;
  bench.clock.advance(7ms);

  bench.tick();

  ASSERT_EQ(bench.states.size(), 1u);
  const DeviceState& state = bench.states[0];
  EXPECT_EQ(state.header.session_id, Bench::kSession);
  EXPECT_EQ(state.header.sequence, 0u);
  EXPECT_EQ(state.header.sampled_at, TimePoint(7ms));
  EXPECT_EQ(state.hand_position_m, Vector3(0.01, 0.02, 0.03));
  EXPECT_LT((state.tool_position_world_m - Vector3(0.02, 0.04, 0.16)).norm(), 1e-15);
  EXPECT_EQ(state.tool_orientation_world.coeffs(), Quaternion(0.6, 0.8, 0, 0).coeffs());
  EXPECT_EQ(state.buttons, 2u);
  EXPECT_FALSE(state.is_clutched);
  EXPECT_EQ(state.applied_count, 0u);
  // and records it for viewers
  const DeviceTick& tick = bench.ticks.at(0);
  EXPECT_EQ(tick.measured_tool_position_world_m, state.tool_position_world_m);
  EXPECT_EQ(tick.measured_tool_orientation_world.coeffs(), Quaternion(0.6, 0.8, 0, 0).coeffs());
}

TEST(DeviceNode, TheToolRestsWhileTheClutchIsHeld) {
  DeviceConfig config = device_config();
  config.workspace.clutch_button = 1;
  Bench bench(config);
  bench.device.position_m = Vector3(0.01, 0, 0);
  bench.tick();
  bench.device.buttons = 2;
  bench.tick();
  bench.device.position_m = Vector3(0.015, 0, 0);
  bench.tick();

  EXPECT_TRUE(bench.states[2].is_clutched);
  EXPECT_TRUE(bench.ticks[2].is_clutched);
  EXPECT_EQ(bench.states[2].hand_position_m.x(), 0.015);
  EXPECT_NEAR(bench.states[2].tool_position_world_m.x(), 0.01, 1e-15);
}

TEST(DeviceNode, AppliesTheAnswerToThisTick) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.reply_delay = 200us;

  bench.tick();

  ASSERT_EQ(bench.device.writes.size(), 1u);
  EXPECT_EQ(bench.device.writes[0].at, TimePoint(200us));
  EXPECT_EQ(bench.device.writes[0].force_on_hand_newton, Vector3(1, 0, 0));
  EXPECT_EQ(bench.device.writes[0].until, TimePoint(2200us));
  const DeviceTick& tick = bench.ticks[0];
  EXPECT_TRUE(tick.is_answered);
  EXPECT_EQ(tick.guard, GuardState::kAnswered);
  EXPECT_EQ(tick.switched_at, TimePoint(200us));
  EXPECT_EQ(tick.reply_time, Duration(200us));
  EXPECT_EQ(tick.force_on_hand_newton, Vector3(1, 0, 0));
}

TEST(DeviceNode, AnAnswerAtTheDeadlineCountsAndOneAfterItDoesNot) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.reply_delay = 500us;  // the deadline itself
  bench.tick();
  bench.reply_delay = 501us;
  bench.tick();

  EXPECT_TRUE(bench.ticks[0].is_answered);
  EXPECT_FALSE(bench.ticks[1].is_answered);
}

// The answer to state 1 comes before that state was sent, with the newest stamp that is known.
TEST(DeviceNode, AnAnswerToAStateThatWasNotSentYetIsRefusedAndCounted) {
  Bench bench(device_config());
  bench.tick();
  bench.send_answer(Bench::kSession, 1, Vector3(1, 0, 0));

  bench.tick();

  EXPECT_FALSE(bench.ticks[1].is_answered);
  EXPECT_EQ(bench.ticks[1].force_on_hand_newton.norm(), 0.0);
  EXPECT_EQ(bench.node.counters().force_command.ahead, 1u);
  EXPECT_EQ(bench.node.counters().force_command.accepted, 0u);

  // the next answer in time acts
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  EXPECT_TRUE(bench.ticks[2].is_answered);
}

// 1 N, then 1.5 N the other way: 2.5 N; the lease ends, a drop of 1.5 N − f_co
TEST(DeviceNode, CountsTheLargestJumpFromTickToTick) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  EXPECT_EQ(bench.node.counters().largest_jump_newton, 1.0);
  bench.answer_with(Vector3(-1.5, 0, 0));
  bench.tick();
  bench.on_state = nullptr;
  for (int i = 0; i < 5; ++i) bench.tick();

  EXPECT_EQ(bench.node.counters().largest_jump_newton, 2.5);
}

// The process is stopped inside the wait; the node then finds the answer but must not use it.
TEST(DeviceNode, AnAnswerThatIsReadTooLateIsDropped) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.reply_delay = 100us;
  bench.stall_in_wait = 5ms;

  bench.tick();

  EXPECT_FALSE(bench.ticks[0].is_answered);
  EXPECT_EQ(bench.ticks[0].force_on_hand_newton.norm(), 0.0);
}

// The clamp has paid for what acts before it until then, and no longer.
TEST(DeviceNode, AnAnswerIsUsedUntilTheDeadlineThatItNames) {
  for (const Duration within : {300us, 100us}) {
    Bench bench(device_config());
    bench.answer_with(Vector3(1, 0, 0));
    bench.reply_delay = 200us;
    bench.begins_within = within;

    bench.tick();

    EXPECT_EQ(bench.ticks[0].is_answered, within > bench.reply_delay);
    EXPECT_EQ(bench.ticks[0].force_on_hand_newton.norm(), within > bench.reply_delay ? 1.0 : 0.0);
    EXPECT_EQ(bench.node.counters().late_switches, 0u);
  }
}

TEST(DeviceNode, AnAnswerThatBeginsToActAfterTheDeadlineThatItNamesIsWithdrawn) {
  for (const Duration within : {300us, 100us}) {
    Bench bench(device_config());
    bench.answer_with(Vector3(1, 0, 0));
    bench.begins_within = within;
    bench.device.before_switch = [&] { bench.clock.advance(200us); };

    bench.tick();

    EXPECT_EQ(bench.node.counters().late_switches, within < 200us ? 1u : 0u);
    EXPECT_EQ(bench.ticks[0].is_answered, within > 200us);
  }
}

// Preempted between the check of the deadline (0.5 ms) and the switch: the stamp of the switch, 1.3
// ms after the reading, shows that the answer began to act too late.
TEST(DeviceNode, AnAnswerThatBeginsToActAfterTheDeadlineIsWithdrawnAtOnceAndCounted) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();  // acts from 0, lease until 2 ms
  bench.answer_with(Vector3(2, 0, 0));
  bench.device.before_switch = [&] { bench.clock.advance(1300us); };
  bench.tick();  // reading at 1 ms, switch at 2.3 ms
  bench.device.before_switch = nullptr;

  EXPECT_EQ(bench.device.releases, 1);
  EXPECT_EQ(bench.device.motor_force_newton(bench.clock.now()), Vector3(0, 0, 0));
  const DeviceTick& tick = bench.ticks[1];
  EXPECT_FALSE(tick.is_answered);
  EXPECT_EQ(tick.guard, GuardState::kLimp);
  EXPECT_EQ(tick.force_on_hand_newton, Vector3(0, 0, 0));
  EXPECT_EQ(tick.switched_at, TimePoint(2300us));
  EXPECT_EQ(bench.node.counters().late_switches, 1u);
  EXPECT_EQ(bench.node.counters().max_force_newton, 2.0) << "it has acted";
  EXPECT_FALSE(bench.node.has_fault());

  // answers that come in time act again, without a limp start
  bench.tick();
  EXPECT_EQ(bench.ticks[2].force_on_hand_newton, Vector3(2, 0, 0));
  EXPECT_EQ(bench.node.counters().late_switches, 1u);
}

// The release takes 20 µs, in which the late answer acts; the encoder is not read at its end.
TEST(DeviceNode, TheEchoReportsALateAnswerWithoutAPositionAtItsEnd) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.answer_with(Vector3(2, 0, 0));
  bench.device.before_switch = [&] { bench.clock.advance(700us); };
  bench.device.before_release = [&] { bench.clock.advance(20us); };
  bench.tick();  // reading at 1 ms, switch at 1.7 ms, release at 1.72 ms
  bench.device.before_switch = nullptr;
  bench.device.before_release = nullptr;
  bench.tick();
  EXPECT_EQ(bench.ticks[1].switched_at, TimePoint(1720us));

  const DeviceState& state = bench.states[2];
  ASSERT_EQ(state.applied_count, 3u);
  expect_segment(state.applied[0], Vector3(1, 0, 0), 1000us, 1700us);
  EXPECT_TRUE(state.applied[0].has_position_at_end);
  expect_segment(state.applied[1], Vector3(2, 0, 0), 1700us, 1720us);
  EXPECT_FALSE(state.applied[1].has_position_at_end);
  expect_segment(state.applied[2], Vector3::Zero(), 1720us, 2000us);
  EXPECT_TRUE(state.applied[2].has_position_at_end);
  EXPECT_EQ(bench.node.counters().max_force_newton, 2.0) << "it acted, if only for 20 µs";
}

TEST(DeviceNode, AMissedTickAfterALateAnswerDoesNotBringItBack) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.device.before_switch = [&] { bench.clock.advance(700us); };
  bench.tick();
  bench.device.before_switch = nullptr;
  bench.on_state = nullptr;
  bench.tick();

  EXPECT_EQ(bench.ticks[2].force_on_hand_newton, Vector3(0, 0, 0));
  EXPECT_NE(bench.ticks[2].guard, GuardState::kLeased);
}

TEST(DeviceNode, ASlowDeviceGetsNoForceUntilASwitchIsInTime) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.device.before_switch = [&] { bench.clock.advance(700us); };
  for (int i = 0; i < 50; ++i) bench.tick();
  EXPECT_EQ(bench.node.counters().late_switches, 5u);
  EXPECT_EQ(bench.ticks.back().force_on_hand_newton, Vector3(0, 0, 0));
  bench.device.before_switch = nullptr;
  bench.tick();
  EXPECT_EQ(bench.ticks.back().force_on_hand_newton, Vector3(0, 0, 0));
  for (int i = 0; i < 200; ++i) bench.tick();
  EXPECT_EQ(bench.ticks.back().force_on_hand_newton, Vector3(1, 0, 0));
}

// The fallback is not paid for by the clamp: friction absorbs it whenever it begins.
TEST(DeviceNode, AFallbackIsNeverLate) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.on_state = nullptr;
  bench.device.before_switch = [&] { bench.clock.advance(700us); };
  for (int i = 0; i < 5; ++i) bench.tick();

  EXPECT_GT(bench.node.counters().fallback_ticks, 0u);
  EXPECT_EQ(bench.node.counters().late_switches, 0u);
  EXPECT_EQ(bench.device.releases, 0);
}

TEST(DeviceNode, AnswersToAnotherTickOrSessionAreDropped) {
  Bench bench(device_config());
  bench.on_state = [&](const DeviceState& state) {
    bench.send_answer(state.header.session_id, state.header.sequence + 1, Vector3(1, 0, 0));
  };
  bench.tick();
  bench.on_state = [&](const DeviceState& state) {
    bench.send_answer(state.header.session_id + 1, state.header.sequence, Vector3(1, 0, 0));
  };
  bench.tick();

  EXPECT_FALSE(bench.ticks[0].is_answered);
  EXPECT_FALSE(bench.ticks[1].is_answered);
  EXPECT_EQ(bench.node.counters().limp_ticks, 2u);
}

// The loss counts once mofc_node has answered, however it is lost: also while it is restarted.
TEST(DeviceNode, TicksBeforeTheFirstAnswerAreCountedApart) {
  Bench bench(device_config());
  for (int i = 0; i < 3; ++i) bench.tick();
  EXPECT_EQ(bench.node.counters().start_up_ticks, 3u);
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.on_state = nullptr;
  for (int i = 0; i < 200; ++i) bench.tick();

  EXPECT_EQ(bench.node.counters().start_up_ticks, 3u);
  EXPECT_GT(bench.node.counters().limp_ticks, 3u + 100u);
}

TEST(DeviceNode, ReadingsWithTheStampOfTheOneBeforeAreCounted) {
  Bench bench(device_config());
  bench.device.position_m = Vector3(0.01, 0, 0);
  bench.device.stamp = TimePoint(0ms);
  for (int i = 0; i < 4; ++i) bench.tick();
  bench.device.stamp.reset();
  for (int i = 0; i < 4; ++i) bench.tick();

  EXPECT_EQ(bench.node.counters().repeated_readings, 3u);
  EXPECT_FALSE(bench.node.has_fault());
}

TEST(DeviceNode, TheLongestRowOfSkippedTicksIsKept) {
  Bench bench(device_config());
  for (const std::uint64_t index : {0U, 1U, 2002U, 2003U, 2006U}) {
    const TimePoint at = TimePoint(1ms * index);
    bench.clock.sleep_until(at);
    bench.step({.index = index, .scheduled_at = at, .now = at});
  }
  EXPECT_EQ(bench.node.counters().longest_skip_ticks, 2000u);
  EXPECT_EQ(bench.node.counters().loop.skipped_ticks, 2002u);
}

// The lease ends at the third reading: the node lets go there, and renews the fallback each tick.
TEST(DeviceNode, WithoutAnAnswerTheLeaseRunsOnUntouchedThenFallbackIsRenewed) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();  // switch at 0, lease until 2 ms
  bench.on_state = nullptr;
  bench.tick();  // decided at 1.5 ms: leased
  EXPECT_EQ(bench.device.writes.size(), 1u);
  bench.tick();  // at 2 and 2.5 ms: fallback
  bench.tick();  // at 3.5 ms: again

  EXPECT_EQ(bench.ticks[1].guard, GuardState::kLeased);
  EXPECT_EQ(bench.ticks[1].force_on_hand_newton, Vector3(1, 0, 0));
  EXPECT_EQ(bench.ticks[2].guard, GuardState::kFallback);
  ASSERT_EQ(bench.device.writes.size(), 4u);
  EXPECT_EQ(bench.device.writes[1].force_on_hand_newton, Vector3(0.1, 0, 0));
  EXPECT_EQ(bench.device.writes[1].at, TimePoint(2ms));
  EXPECT_EQ(bench.device.writes[2].at, TimePoint(2500us));
  EXPECT_EQ(bench.device.writes[2].until, TimePoint(4500us));
  EXPECT_EQ(bench.device.writes[3].at, TimePoint(3500us));
}

DeviceConfig elastic_config() {
  DeviceConfig config = device_config();
  config.longest_lease = 10ms;
  return config;
}

// 1 N until 3.3 ms; the answer to the reading at 3 ms comes 0.4 ms later: lets go in between, with
// a reading, and takes the answer all the same.
TEST(DeviceNode, WhileItWaitsItLetsGoAtTheEndOfTheLeaseAndStillTakesTheAnswer) {
  Bench bench(elastic_config());
  bench.answer_with(Vector3(1, 0, 0), 3300us);
  bench.tick();
  bench.on_state = nullptr;
  bench.tick();
  bench.tick();
  bench.reply_delay = 400us;
  bench.answer_with(Vector3(2, 0, 0), 3300us);
  bench.tick();
  bench.tick();

  EXPECT_TRUE(bench.ticks[3].is_answered);
  ASSERT_GE(bench.device.writes.size(), 3u);
  EXPECT_EQ(bench.device.writes[1].at, TimePoint(3300us));
  EXPECT_EQ(bench.device.writes[1].force_on_hand_newton, Vector3(0.1, 0, 0));
  EXPECT_EQ(bench.device.writes[2].at, TimePoint(3400us));
  EXPECT_EQ(bench.device.writes[2].force_on_hand_newton, Vector3(2, 0, 0));
  const DeviceState& state = bench.states[4];
  ASSERT_EQ(state.applied_count, 3u);
  expect_segment(state.applied[0], Vector3(1, 0, 0), 3000us, 3300us);
  EXPECT_TRUE(state.applied[0].has_position_at_end);
  expect_segment(state.applied[1], Vector3(0.1, 0, 0), 3300us, 3400us);
  expect_segment(state.applied[2], Vector3(2, 0, 0), 3400us, 4000us);
}

// Lease until 2.7 ms: between the deadline at 2.5 ms and the reading at 3 ms nobody would read.
TEST(DeviceNode, ALeaseThatWouldEndUnreadIsGivenUpAtTheDeadline) {
  Bench bench(elastic_config());
  bench.answer_with(Vector3(1, 0, 0), 2700us);
  bench.tick();
  bench.on_state = nullptr;
  bench.tick();
  bench.tick();
  bench.tick();

  EXPECT_EQ(bench.ticks[1].guard, GuardState::kLeased);
  EXPECT_EQ(bench.ticks[2].guard, GuardState::kFallback);
  EXPECT_EQ(bench.device.writes[1].at, TimePoint(2500us));
  for (const DeviceState& state : bench.states) {
    for (std::uint32_t k = 0; k < state.applied_count; ++k) {
      EXPECT_TRUE(state.applied[k].has_position_at_end);
    }
  }
}

// --- the echo ---------------------------------------------------------------------------------

TEST(DeviceNode, EchoesBothForcesOfAnIntervalWithThePositionAtTheSwitch) {
  Bench bench(device_config());
  bench.reply_delay = 300us;
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.answer_with(Vector3(2, 0, 0));
  bench.tick();
  bench.tick();

  // the hand moves at 1 m/s: each position identifies its time
  const DeviceState& state = bench.states[2];
  ASSERT_EQ(state.applied_count, 2u);
  expect_segment(state.applied[0], Vector3(1, 0, 0), 1000us, 1300us);
  EXPECT_NEAR(state.applied[0].hand_position_at_end_m.x(), 1300e-6, 1e-12);
  expect_segment(state.applied[1], Vector3(2, 0, 0), 1300us, 2000us);
  EXPECT_EQ(state.applied[1].hand_position_at_end_m, state.hand_position_m);
}

// Lockstep without delay: the switch is the reading, so there is one segment per interval.
TEST(DeviceNode, AReplyAtTheSameInstantLeavesOneSegment) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.tick();

  EXPECT_EQ(bench.ticks[0].switched_at, bench.ticks[0].sampled_at);
  ASSERT_EQ(bench.states[1].applied_count, 1u);
  expect_segment(bench.states[1].applied[0], Vector3(1, 0, 0), 0us, 1000us);
  EXPECT_TRUE(bench.states[1].applied[0].has_position_at_end);
}

// Stalled for 7 ms: the force ended by itself at 2 ms, where the encoder was not read.
TEST(DeviceNode, AForceThatRanOutIsEchoedWithItsEndAndTheRestAsZero) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.clock.advance(7ms);
  bench.tick();

  const DeviceState& state = bench.states[1];
  ASSERT_EQ(state.applied_count, 2u);
  expect_segment(state.applied[0], Vector3(1, 0, 0), 0ms, 2ms);
  EXPECT_FALSE(state.applied[0].has_position_at_end);
  expect_segment(state.applied[1], Vector3::Zero(), 2ms, 7ms);
  EXPECT_TRUE(state.applied[1].has_position_at_end);
}

// One force runs out before the switch, its successor before the reading.
TEST(DeviceNode, TwoForcesThatRanOutAreBothEchoed) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();  // lease until 2 ms
  bench.clock.advance(1500us);
  bench.on_state = nullptr;
  bench.stall_in_wait = 5ms;  // from 1.5 ms: fallback at 6.5 ms, lease until 8.5 ms
  bench.tick();
  bench.clock.advance(10ms);
  bench.tick();

  // from the reading at 0, the last one that was answered
  const DeviceState& state = bench.states[2];
  ASSERT_EQ(state.applied_count, 5u);
  expect_segment(state.applied[0], Vector3(1, 0, 0), 0us, 1500us);
  expect_segment(state.applied[1], Vector3(1, 0, 0), 1500us, 2000us);
  expect_segment(state.applied[2], Vector3::Zero(), 2000us, 6500us);
  expect_segment(state.applied[3], Vector3(0.1, 0, 0), 6500us, 8500us);
  expect_segment(state.applied[4], Vector3::Zero(), 8500us, 16'500us);
  EXPECT_TRUE(state.applied[2].has_position_at_end);
  EXPECT_FALSE(state.applied[3].has_position_at_end);
}

TEST(DeviceNode, ReportsTheActingForceAndTheEndOfItsLease) {
  Bench bench(elastic_config());
  bench.answer_with(Vector3(1, 0, 0), 2700us);
  bench.tick();
  bench.tick();

  EXPECT_EQ(bench.states[0].acting_force_on_hand_newton, Vector3(0, 0, 0));
  EXPECT_EQ(bench.states[0].acting_until, bench.states[0].header.sampled_at);
  EXPECT_EQ(bench.states[1].acting_force_on_hand_newton, Vector3(1, 0, 0));
  EXPECT_EQ(bench.states[1].acting_until, TimePoint(2700us));
}

// Answers are lost from 1 ms on: every state reports all since 0. One comes after its deadline: it
// does not act, but acknowledges its reading.
TEST(DeviceNode, ReportsEveryForceUntilItsReadingIsAnsweredEvenIfTooLate) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.on_state = nullptr;
  for (int i = 0; i < 3; ++i) bench.tick();
  EXPECT_EQ(bench.states[3].applied[0].from, TimePoint(0ms));

  bench.reply_delay = 600us;
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();  // reading at 4 ms, answered at 4.6 ms
  EXPECT_EQ(bench.states[4].applied[0].from, TimePoint(0ms));
  bench.clock.sleep_until(TimePoint(4600us));
  bench.deliver();
  bench.on_state = nullptr;
  bench.tick();  // takes it
  bench.tick();
  EXPECT_FALSE(bench.ticks[5].is_answered);
  EXPECT_EQ(bench.states[6].applied[0].from, TimePoint(4ms));
}

// A reading that lies in the future, or another session: nothing is forgotten.
TEST(DeviceNode, AFalseAcknowledgementIsIgnored) {
  Bench bench(device_config());
  bench.on_state = [&](const DeviceState&) {
    bench.states.back().header.sampled_at += 1h;
    bench.send_answer(Bench::kSession, 99, Vector3(1, 0, 0));
    bench.states.back().header.sampled_at -= 1h;
  };
  for (int i = 0; i < 3; ++i) bench.tick();
  bench.on_state = [&](const DeviceState& state) {
    bench.send_answer(Bench::kSession + 1, state.header.sequence, Vector3(1, 0, 0));
  };
  for (int i = 0; i < 3; ++i) bench.tick();

  EXPECT_EQ(bench.states[5].applied[0].from, TimePoint(0ms));
}

// 40 ticks of fallback, two segments each: the oldest are forgotten, the rest stays contiguous.
TEST(DeviceNode, KeepsTheNewestForcesOfALongSilence) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.on_state = nullptr;
  for (int i = 0; i < 40; ++i) bench.tick();

  const DeviceState& state = bench.states.back();
  ASSERT_EQ(state.applied_count, kMaxAppliedForces);
  for (std::uint32_t k = 1; k < state.applied_count; ++k) {
    EXPECT_EQ(state.applied[k].from, state.applied[k - 1].until);
  }
  EXPECT_EQ(state.applied[kMaxAppliedForces - 1].until, state.header.sampled_at);
}

// Stalled for 7 ms with a latch: the force ended by itself at 2 ms, and the position is known.
TEST(DeviceNode, ALatchedPositionEndsAForceThatRanOut) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.device.latched =
      DeviceSample{.hand_position_m = Vector3(2e-3, 0, 0), .sampled_at = TimePoint(2ms)};
  bench.clock.advance(7ms);
  bench.tick();

  const DeviceState& state = bench.states[1];
  ASSERT_EQ(state.applied_count, 2u);
  expect_segment(state.applied[0], Vector3(1, 0, 0), 0ms, 2ms);
  EXPECT_TRUE(state.applied[0].has_position_at_end);
  EXPECT_EQ(state.applied[0].hand_position_at_end_m, Vector3(2e-3, 0, 0));
  expect_segment(state.applied[1], Vector3::Zero(), 2ms, 7ms);
}

// 50 mm in 2 ms are 25 m/s; and a latch older than the last reading belongs to another force.
TEST(DeviceNode, ALatchedPositionIsJudgedLikeAnyReading) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.device.latched =
      DeviceSample{.hand_position_m = Vector3(0.05, 0, 0), .sampled_at = TimePoint(2ms)};
  bench.clock.advance(7ms);
  bench.tick();
  EXPECT_EQ(bench.node.counters().last_fault, FaultReason::kPositionJumped);

  Bench stale(device_config());
  stale.answer_with(Vector3(1, 0, 0));
  stale.tick();
  stale.device.latched = DeviceSample{.sampled_at = TimePoint(-1ms)};
  stale.clock.advance(7ms);
  stale.tick();
  EXPECT_FALSE(stale.states[1].applied[0].has_position_at_end);
  EXPECT_FALSE(stale.node.has_fault());
}

// --- faults -----------------------------------------------------------------------------------

TEST(DeviceNode, AReadFailureIsLatchedAndLimpUntilReset) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.device.fails_to_read = true;
  bench.tick();
  bench.device.fails_to_read = false;
  bench.tick();

  EXPECT_TRUE(bench.node.has_fault());
  EXPECT_EQ(bench.device.releases, 1);
  EXPECT_EQ(bench.states.size(), 1u);
  EXPECT_EQ(bench.node.counters().device_faults, 1u);

  EXPECT_EQ(bench.node.counters().last_fault, FaultReason::kReadFailed);

  bench.node.acknowledge();
  bench.tick();  // at 3 ms

  EXPECT_FALSE(bench.node.has_fault());
  ASSERT_EQ(bench.states.size(), 2u);
  EXPECT_EQ(bench.states[1].header.sequence, 3u);
  // what the encoder did meanwhile is not known: the echo begins anew, a gap to mofc_node
  EXPECT_EQ(bench.states[1].applied_count, 0u);
}

// 1 N at 0 ms with a lease of 2 ms; the next tick comes at 10 ms and fails; then one at 11 ms.
TEST(DeviceNode, EveryRecordTellsWhatActedSinceTheOneBefore) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0), 2ms);
  bench.tick();
  bench.on_state = {};
  bench.clock.advance(10ms);
  bench.device.position_m = Vector3(0, 0, kNaN);
  bench.tick();
  bench.clock.advance(1ms);
  bench.tick();

  EXPECT_EQ(bench.ticks.at(0).acted_count, 0u);
  const DeviceTick& after_hole = bench.ticks.at(1);
  ASSERT_EQ(after_hole.guard, GuardState::kFault);
  ASSERT_EQ(after_hole.acted_count, 2u);
  expect_segment(after_hole.acted[0], Vector3(1, 0, 0), 0ms, 2ms);
  EXPECT_FALSE(after_hole.acted[0].has_position_at_end);
  expect_segment(after_hole.acted[1], Vector3::Zero(), 2ms, 10ms);
  // motors released
  const DeviceTick& in_fault = bench.ticks.at(2);
  ASSERT_EQ(in_fault.acted_count, 1u);
  expect_segment(in_fault.acted[0], Vector3::Zero(), 10ms, 11ms);
}

TEST(DeviceNode, ANonFiniteReadingIsAFault) {
  Bench bench(device_config());
  bench.device.position_m = Vector3(0, kNaN, 0);

  bench.tick();

  EXPECT_EQ(bench.node.counters().last_fault, FaultReason::kReadingNotFinite);
  EXPECT_TRUE(bench.node.has_fault());
  EXPECT_TRUE(bench.states.empty());
  // telemetry stays finite
  EXPECT_EQ(bench.ticks.at(0).guard, GuardState::kFault);
  EXPECT_EQ(bench.ticks.at(0).measured_hand_position_m, Vector3(0, 0, 0));
}

TEST(DeviceNode, ANonFiniteReadingAtTheSwitchIsAFault) {
  Bench bench(device_config());
  bench.on_state = [&](const DeviceState& state) {
    bench.device.position_m = Vector3(0, 0, kNaN);
    bench.send_answer(state.header.session_id, state.header.sequence, Vector3(1, 0, 0));
  };

  bench.tick();

  EXPECT_EQ(bench.node.counters().last_fault, FaultReason::kReadingNotFinite);
  EXPECT_EQ(bench.device.motor_force_newton(bench.clock.now()), Vector3(0, 0, 0));
  EXPECT_EQ(bench.ticks.at(0).force_on_hand_newton, Vector3(0, 0, 0));
}

// v_fault 10 m/s, 1 ms: 10 mm, and √3 · 55 µm = 95.3 µm of rounding.
TEST(DeviceNode, AnEncoderJumpBeyondWhatAHandCanDoIsAFault) {
  for (const double moved_m : {10.09e-3, 10.10e-3}) {
    Bench bench(device_config());
    bench.answer_with(Vector3(1, 0, 0));
    bench.device.position_m = Vector3(0, 0, 0);
    bench.tick();
    bench.device.position_m = Vector3(0, moved_m, 0);
    bench.tick();

    const bool is_jump = moved_m > 10.0953e-3;
    EXPECT_EQ(bench.node.has_fault(), is_jump) << moved_m;
    EXPECT_EQ(bench.states.size(), is_jump ? 1u : 2u);
    EXPECT_EQ(bench.device.motor_force_newton(bench.clock.now()),
              is_jump ? Vector3(0, 0, 0) : Vector3(1, 0, 0));
    // the record shows the jump
    EXPECT_EQ(bench.ticks.at(1).measured_hand_position_m.y(), moved_m);
    if (is_jump) {
      EXPECT_EQ(bench.node.counters().last_fault, FaultReason::kPositionJumped);
    }
  }
}

// Stopped for 300 ms a hand may be 0.5 m further on, 1.7 m/s; 4 m would be 13 m/s.
TEST(DeviceNode, AfterAStopOfTheProcessAJumpIsMeasuredByTheTimeThatPassed) {
  for (const double moved_m : {0.5, 4.0}) {
    Bench bench(device_config());
    bench.device.position_m = Vector3(0, 0, 0);
    bench.tick();
    bench.clock.advance(300ms);
    bench.device.position_m = Vector3(moved_m, 0, 0);
    bench.tick();

    EXPECT_EQ(bench.node.has_fault(), moved_m > 3.0) << moved_m;
  }
}

TEST(DeviceNode, AJumpAtTheSwitchIsAFault) {
  Bench bench(device_config());
  bench.device.position_m = Vector3(0, 0, 0);
  bench.on_state = [&](const DeviceState& state) {
    bench.device.position_m = Vector3(0.001, 0, 0);  // in no time
    bench.send_answer(state.header.session_id, state.header.sequence, Vector3(1, 0, 0));
  };

  bench.tick();

  EXPECT_EQ(bench.node.counters().last_fault, FaultReason::kPositionJumped);
  EXPECT_EQ(bench.device.motor_force_newton(bench.clock.now()), Vector3(0, 0, 0));
}

TEST(DeviceNode, AfterAResetTheDeviceContinuesFromWhereItIs) {
  Bench bench(device_config());
  bench.device.position_m = Vector3(0, 0, 0);
  bench.tick();
  bench.device.position_m = Vector3(1, 0, 0);
  bench.tick();
  bench.device.position_m = Vector3(2, 0, 0);
  bench.node.acknowledge();
  bench.tick();

  EXPECT_FALSE(bench.node.has_fault());
  EXPECT_EQ(bench.states.back().hand_position_m, Vector3(2, 0, 0));
  EXPECT_EQ(bench.node.counters().fault_resets, 1u);
}

TEST(DeviceNode, TheRecordOfATickSaysWhenItsReadingWasTaken) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  for (int i = 0; i < 3; ++i) bench.tick();
  EXPECT_EQ(bench.ticks.back().sampled_at, TimePoint(2ms));
}

TEST(DeviceNode, AResetWithoutAFaultDoesNothing) {
  Bench bench(device_config());
  bench.tick();
  bench.node.acknowledge();
  bench.device.position_m = Vector3(1, 0, 0);
  bench.tick();

  EXPECT_TRUE(bench.node.has_fault());
  EXPECT_EQ(bench.node.counters().fault_resets, 0u);
}

TEST(DeviceNode, EveryTickOfALatchedFaultLeavesARecordAndNoForceActs) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.device.orientation = Quaternion(0.6, 0.8, 0, 0);
  bench.tick();
  bench.device.fails_to_apply = true;
  for (int i = 0; i < 5; ++i) bench.tick();

  ASSERT_EQ(bench.ticks.size(), 6u);
  for (std::size_t i = 1; i < 6; ++i) {
    const DeviceTick& tick = bench.ticks[i];
    EXPECT_EQ(tick.sequence, i);
    EXPECT_EQ(tick.sampled_at, TimePoint(i * 1ms));
    EXPECT_EQ(tick.guard, GuardState::kFault);
    EXPECT_EQ(tick.force_on_hand_newton, Vector3(0, 0, 0));
    EXPECT_NEAR(tick.measured_hand_position_m.x(), 1e-3 * static_cast<double>(i), 1e-12);
    EXPECT_EQ(tick.measured_tool_position_world_m, tick.measured_hand_position_m);
    EXPECT_EQ(tick.measured_tool_orientation_world.coeffs(), Quaternion(0.6, 0.8, 0, 0).coeffs());
  }
  const DeviceCounters c = bench.node.counters();
  EXPECT_EQ(c.fault_ticks, 5u);
  EXPECT_EQ(c.device_faults, 1u);
  EXPECT_EQ(c.answered_ticks + c.leased_ticks + c.fallback_ticks + c.limp_ticks + c.fault_ticks,
            c.loop.ticks);
}

TEST(DeviceNode, ACommandThatIsNotFiniteGivesNoForceAndIsCounted) {
  Bench bench(device_config());
  bench.answer_with(Vector3(kNaN, 0, 0));

  bench.tick();

  EXPECT_FALSE(bench.node.has_fault());
  EXPECT_EQ(bench.ticks.at(0).force_on_hand_newton, Vector3(0, 0, 0));
  EXPECT_EQ(bench.node.counters().non_finite_commands, 1u);
}

TEST(DeviceNode, AWriteFailureIsAFault) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.device.fails_to_apply = true;

  bench.tick();

  EXPECT_EQ(bench.node.counters().last_fault, FaultReason::kWriteFailed);
  EXPECT_TRUE(bench.node.has_fault());
  EXPECT_EQ(bench.device.releases, 1);
}

TEST(DeviceNode, AFaultTellsWhatTheDriverKnowsOfIt) {
  for (const auto& [error, reason] : {std::pair{DeviceError::kTimeout, FaultReason::kDeviceSilent},
                                      {DeviceError::kUnplugged, FaultReason::kDeviceGone},
                                      {DeviceError::kCorrupt, FaultReason::kDeviceCorrupt}}) {
    Bench bench(device_config());
    bench.tick();
    bench.device.fails_to_read = true;
    bench.device.error = error;
    bench.tick();
    EXPECT_EQ(bench.node.counters().last_fault, reason);
  }
}

TEST(DeviceNode, AReleaseIsRepeatedEveryTickUntilTheDeviceConfirmsIt) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.device.fails_to_read = true;
  bench.device.confirms_release = false;
  for (int i = 0; i < 10; ++i) bench.tick();

  EXPECT_EQ(bench.device.releases, 10) << "as the fault was latched, and in each tick after it";
  EXPECT_TRUE(bench.node.counters().is_release_unconfirmed);
  EXPECT_EQ(bench.device.reopenings, 0) << "the connection is there";
  bench.node.acknowledge();
  EXPECT_TRUE(bench.node.has_fault()) << "no reset while the motors may push";

  bench.device.confirms_release = true;
  for (int i = 0; i < 10; ++i) bench.tick();
  EXPECT_FALSE(bench.node.counters().is_release_unconfirmed);
  EXPECT_EQ(bench.device.releases, 12);
  EXPECT_EQ(bench.device.motor_force_newton(bench.clock.now()), Vector3(0, 0, 0));
}

TEST(DeviceNode, ALostConnectionIsOpenedAgainWhileTheMotorsMayPush) {
  Bench bench(device_config());
  bench.tick();
  bench.device.fails_to_read = true;
  bench.device.confirms_release = false;
  bench.device.phase_now = DevicePhase::kClosed;
  for (int i = 0; i < 1200; ++i) bench.tick();
  EXPECT_EQ(bench.device.reopenings, 3) << "twice a second";

  bench.device.confirms_release = true;
  bench.device.reopenings = 0;
  for (int i = 0; i < 1200; ++i) bench.tick();
  EXPECT_EQ(bench.device.reopenings, 0) << "not once it was confirmed";
  EXPECT_TRUE(bench.node.has_fault()) << "that needs a person";
}

TEST(DeviceNode, AnAnswerThatCameTooLateAndIsNotReleasedIsAFault) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.device.before_switch = [&] { bench.clock.advance(600us); };
  bench.device.confirms_release = false;

  bench.tick();

  EXPECT_EQ(bench.node.counters().last_fault, FaultReason::kWriteFailed);
  EXPECT_FALSE(bench.node.stop());
  bench.device.confirms_release = true;
  EXPECT_TRUE(bench.node.stop());
}

TEST(DeviceNode, AReleaseThatFailsAfterALateAnswerIsAFaultOfItsKind) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.device.before_switch = [&] { bench.clock.advance(600us); };
  bench.device.confirms_release = false;
  bench.device.error = DeviceError::kCorrupt;
  bench.tick();
  EXPECT_EQ(bench.node.counters().last_fault, FaultReason::kDeviceCorrupt);
}

TEST(DeviceNode, AFaultStaysUntilTheDeviceOpensAgain) {
  Bench bench(device_config());
  bench.tick();
  bench.device.fails_to_read = true;
  bench.tick();
  bench.device.fails_to_read = false;
  bench.device.reopens = false;
  bench.node.acknowledge();
  EXPECT_TRUE(bench.node.has_fault());

  bench.device.reopens = true;
  bench.node.acknowledge();
  EXPECT_FALSE(bench.node.has_fault());
}

// Motors with steps of 0.25 N, that round towards zero.
TEST(DeviceNode, TheEchoTellsWhatTheMotorsMadeOfAForce) {
  Bench bench(device_config());
  bench.device.motors = [](const Vector3& force) {
    return Vector3(0.25 * std::trunc(4.0 * force.x()), 0, 0);
  };
  bench.answer_with(Vector3(0.9, 0, 0));
  bench.tick();
  bench.tick();

  EXPECT_EQ(bench.ticks.front().force_on_hand_newton, Vector3(0.75, 0, 0));
  EXPECT_EQ(bench.states.back().applied[0].force_on_hand_newton, Vector3(0.75, 0, 0));
}

TEST(DeviceNode, AfterAFaultTheForceGrowsFromZero) {
  DeviceConfig config = device_config();
  config.start_ramp = 10ms;
  Bench bench(config);
  bench.answer_with(Vector3(1, 0, 0));
  for (int i = 0; i < 20; ++i) bench.tick();
  EXPECT_EQ(bench.ticks.back().force_on_hand_newton.x(), 1.0);
  bench.device.fails_to_read = true;
  bench.tick();
  bench.device.fails_to_read = false;
  bench.node.acknowledge();
  bench.tick();

  EXPECT_EQ(bench.ticks.back().force_on_hand_newton.x(), 0.0);
}

TEST(DeviceNode, AForceNeedsTheDeadManButtonEndsWithItAndGrowsAgainFromZero) {
  DeviceConfig config = device_config();
  config.start_ramp = 10ms;
  config.dead_man_button = 1;
  Bench bench(config);
  bench.answer_with(Vector3(1, 0, 0));
  const auto force_after = [&](std::uint32_t buttons, int ticks) {
    bench.device.buttons = buttons;
    for (int i = 0; i < ticks; ++i) bench.tick();
    return bench.ticks.back().force_on_hand_newton.x();
  };
  EXPECT_EQ(force_after(1, 20), 0.0);  // another button
  EXPECT_EQ(force_after(2, 20), 1.0);
  EXPECT_EQ(force_after(0, 1), 0.0);
  EXPECT_EQ(bench.device.motor_force_newton(bench.clock.now()), Vector3(0, 0, 0))
      << "in the tick that reads it, whatever lease the force had";
  EXPECT_EQ(force_after(0, 72), 0.0);
  EXPECT_EQ(bench.ticks.back().guard, GuardState::kLimp);
  EXPECT_EQ(bench.node.counters().dead_man_ticks, 93U);
  EXPECT_EQ(bench.node.counters().answered_ticks, 20U);
  EXPECT_EQ(force_after(2, 1), 0.0);
  EXPECT_EQ(force_after(2, 20), 1.0);
}

/// The largest force that the motors were given after the first `writes` of them [N].
double newton_since(const Bench& bench, std::size_t writes) {
  double newton = 0.0;
  for (std::size_t i = writes; i < bench.device.writes.size(); ++i) {
    newton = std::max(newton, bench.device.writes[i].force_on_hand_newton.norm());
  }
  return newton;
}

// The lease was over, so that nothing had to end: the fallback began for one tick.
TEST(DeviceNode, NoForceBeginsInTheTickThatReadsTheDeadManButtonReleased) {
  for (const bool has_watchdog : {true, false}) {
    DeviceConfig config = device_config();
    config.dead_man_button = 0;
    config.accepts_no_motor_watchdog = true;
    Bench bench(config);
    bench.device.has_watchdog(has_watchdog);
    bench.answer_with(Vector3(1, 0, 0), 2ms);
    bench.device.buttons = 1;
    for (int i = 0; i < 100; ++i) bench.tick();
    ASSERT_EQ(bench.ticks.back().force_on_hand_newton.x(), 1.0);
    bench.clock.advance(30ms);
    bench.device.buttons = 0;
    const std::size_t writes = bench.device.writes.size();
    for (int i = 0; i < 5; ++i) bench.tick();
    EXPECT_EQ(newton_since(bench, writes), 0.0);
    EXPECT_EQ(bench.ticks.back().guard, GuardState::kLimp);
  }
}

TEST(DeviceNode, NoForceBeginsInTheTickThatFindsThePositionsStandingStill) {
  DeviceConfig config = device_config();
  Bench bench(config, false);
  bench.device.position_m = Vector3(0.01, 0, 0);
  bench.answer_with(Vector3(1, 0, 0), 2ms);
  bench.node.acknowledge();
  for (int i = 0; i < 25; ++i) bench.tick();
  ASSERT_EQ(bench.node.counters().frozen_ticks, 0U);
  ASSERT_EQ(bench.ticks.back().force_on_hand_newton.x(), 1.0);
  bench.clock.advance(20ms);
  const std::size_t writes = bench.device.writes.size();
  for (int i = 0; i < 5; ++i) bench.tick();
  EXPECT_GE(bench.node.counters().frozen_ticks, 5U);
  EXPECT_EQ(newton_since(bench, writes), 0.0);
}

// The echo ends the force where the motors ended it.
TEST(DeviceNode, TheEchoTellsWhereTheDeadManButtonEndedAForce) {
  DeviceConfig config = device_config();
  config.longest_lease = 1h;
  config.dead_man_button = 0;
  Bench bench(config);
  bench.answer_with(Vector3(1, 0, 0));
  bench.device.buttons = 1;
  for (int i = 0; i < 3; ++i) bench.tick();
  bench.device.buttons = 0;
  bench.tick();  // at 3 ms
  bench.tick();

  const DeviceState& state = bench.states.back();
  EXPECT_EQ(state.acting_force_on_hand_newton, Vector3(0, 0, 0));
  double force_s = 0.0;
  for (std::size_t i = 0; i < state.applied_count; ++i) {
    const AppliedForce& segment = state.applied[i];
    if (segment.force_on_hand_newton.norm() > 0.0)
      force_s = to_seconds(segment.until - TimePoint());
  }
  EXPECT_LE(force_s, 3e-3);
}

// --- the way to a force -------------------------------------------------------------------------

TEST(DeviceNode, ARealDeviceGivesNoForceBeforeAPersonHasAcknowledgedIt) {
  Bench bench(device_config(), false);
  bench.answer_with(Vector3(1, 0, 0));
  for (int i = 0; i < 5000; ++i) bench.tick();  // time does nothing
  EXPECT_EQ(bench.node.phase(), DevicePhase::kCalibrated);
  EXPECT_EQ(bench.node.counters().max_force_newton, 0.0);
  EXPECT_EQ(bench.states.size(), 5000U) << "the hand is followed";

  bench.node.acknowledge();
  bench.tick();
  EXPECT_EQ(bench.node.phase(), DevicePhase::kEnabled);
  EXPECT_EQ(bench.ticks.back().force_on_hand_newton.x(), 1.0);
}

TEST(DeviceNode, ASimulatedDeviceNeedsNoAcknowledgement) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  EXPECT_EQ(bench.node.phase(), DevicePhase::kEnabled);
  bench.tick();
  EXPECT_EQ(bench.ticks.back().force_on_hand_newton.x(), 1.0);
}

TEST(DeviceNode, APressOfTheDeadManButtonAcknowledgesButNotOneThatWasHeldBefore) {
  DeviceConfig config = device_config();
  config.dead_man_button = 0;
  Bench bench(config, false);
  bench.answer_with(Vector3(1, 0, 0));
  const auto force_after = [&](std::uint32_t buttons, int ticks) {
    bench.device.buttons = buttons;
    for (int i = 0; i < ticks; ++i) bench.tick();
    return bench.ticks.back().force_on_hand_newton.x();
  };
  EXPECT_EQ(force_after(1, 100), 0.0) << "a button that is stuck acknowledges nothing";
  EXPECT_EQ(force_after(0, 1), 0.0);
  EXPECT_EQ(force_after(1, 1), 1.0);

  // a fault: the hand goes on holding the button
  bench.device.fails_to_read = true;
  EXPECT_EQ(force_after(1, 1), 0.0);
  bench.device.fails_to_read = false;
  EXPECT_EQ(force_after(0, 5), 0.0);
  EXPECT_EQ(force_after(1, 5), 0.0) << "a press clears no fault";
  EXPECT_EQ(bench.node.phase(), DevicePhase::kFaulted);
}

TEST(DeviceNode, AfterAFaultARealDeviceNeedsAnAcknowledgementAgain) {
  Bench bench(device_config(), false);
  bench.answer_with(Vector3(1, 0, 0));
  bench.node.acknowledge();
  bench.tick();
  bench.device.fails_to_read = true;
  bench.tick();
  bench.device.fails_to_read = false;
  for (int i = 0; i < 100; ++i) bench.tick();
  EXPECT_EQ(bench.node.phase(), DevicePhase::kFaulted);

  bench.node.acknowledge();
  EXPECT_EQ(bench.node.phase(), DevicePhase::kEnabled) << "the device says that it is calibrated";
  bench.tick();
  EXPECT_EQ(bench.ticks.back().force_on_hand_newton.x(), 1.0);
}

// At a page: what is seen there is older than the device, and may be of before the last fault.
TEST(DeviceNode, AnAcknowledgementFromADistanceCountsOnlyWhileTheDeviceIsAsItWasSeen) {
  Bench bench(device_config(), false);
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  const auto phase_after = [&](DevicePhase phase, std::uint64_t faults) {
    bench.node.acknowledge({.phase = phase, .device_faults = faults});
    bench.tick();
    return bench.node.phase();
  };
  EXPECT_EQ(phase_after(DevicePhase::kFaulted, 0), DevicePhase::kCalibrated);
  EXPECT_EQ(phase_after(DevicePhase::kCalibrated, 1), DevicePhase::kCalibrated);
  EXPECT_EQ(phase_after(DevicePhase::kUnknown, 0), DevicePhase::kCalibrated);
  EXPECT_EQ(bench.node.counters().page_acknowledgements, 0U);
  EXPECT_EQ(phase_after(DevicePhase::kCalibrated, 0), DevicePhase::kEnabled);
  EXPECT_EQ(bench.ticks.back().force_on_hand_newton.x(), 1.0);
  EXPECT_EQ(phase_after(DevicePhase::kEnabled, 0), DevicePhase::kEnabled) << "waits for nothing";

  const auto fault = [&] {
    bench.device.fails_to_read = true;
    bench.tick();
    bench.device.fails_to_read = false;
    bench.tick();
  };
  fault();
  EXPECT_EQ(phase_after(DevicePhase::kFaulted, 1), DevicePhase::kEnabled);
  fault();
  EXPECT_EQ(phase_after(DevicePhase::kFaulted, 1), DevicePhase::kFaulted) << "the fault before";
  EXPECT_EQ(bench.ticks.back().force_on_hand_newton, Vector3(0, 0, 0));
  EXPECT_EQ(bench.node.counters().page_acknowledgements, 2U);
  EXPECT_EQ(bench.node.counters().page_acknowledgements_refused, 5U);
}

TEST(DeviceNode, AnAcknowledgementFromADistanceIsNoDeadManButton) {
  DeviceConfig config = device_config();
  config.dead_man_button = 0;
  Bench bench(config, false);
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.node.acknowledge({.phase = DevicePhase::kCalibrated, .device_faults = 0});
  for (int i = 0; i < 100; ++i) bench.tick();
  EXPECT_EQ(bench.node.counters().max_force_newton, 0.0);
  bench.device.buttons = 1;
  bench.tick();
  EXPECT_EQ(bench.ticks.back().force_on_hand_newton.x(), 1.0);
}

// A calibration makes the place where the handle is its home: a person puts it there only after the
// prompt, which follows the reset of the fault.
TEST(DeviceNode, ADeviceThatLostItsCalibrationTakesItAndThenNeedsAnAcknowledgement) {
  Bench bench(device_config(), false);
  bench.answer_with(Vector3(1, 0, 0));
  bench.node.acknowledge();
  bench.tick();
  bench.device.fails_to_read = true;
  bench.device.error = DeviceError::kNotReady;
  bench.tick();
  EXPECT_EQ(bench.node.counters().last_fault, FaultReason::kDeviceNotReady);
  bench.device.fails_to_read = false;
  bench.device.phase_now = DevicePhase::kConnected;
  bench.device.takes_calibration = false;
  const std::size_t sent = bench.states.size();
  const auto ticks = [&] {
    for (int i = 0; i < 10; ++i) bench.tick();
    return bench.node.phase();
  };

  EXPECT_EQ(ticks(), DevicePhase::kFaulted);
  bench.node.acknowledge();
  EXPECT_EQ(ticks(), DevicePhase::kConnected);
  EXPECT_EQ(bench.device.calibrations, 0) << "nobody was asked for it yet";
  EXPECT_EQ(bench.node.vain_acknowledgements(), 0U);
  bench.node.acknowledge();
  EXPECT_EQ(ticks(), DevicePhase::kConnected);
  EXPECT_EQ(bench.ticks.back().guard, GuardState::kLimp);
  EXPECT_EQ(bench.states.size(), sent) << "positions that cannot be relied on are not sent";
  EXPECT_EQ(bench.device.calibrations, 1);
  EXPECT_EQ(bench.node.vain_acknowledgements(), 1U) << "the device refused its calibration";

  bench.device.takes_calibration = true;
  bench.node.acknowledge();
  EXPECT_EQ(ticks(), DevicePhase::kCalibrated);
  EXPECT_EQ(bench.ticks.back().force_on_hand_newton.x(), 0.0) << "that was for the calibration";
  bench.node.acknowledge();
  EXPECT_EQ(ticks(), DevicePhase::kEnabled);
  EXPECT_EQ(bench.ticks.back().force_on_hand_newton.x(), 1.0);
  EXPECT_EQ(bench.node.vain_acknowledgements(), 1U);
  // which is told by what it waited for; the fault has its own count
  EXPECT_EQ(bench.node.counters().uncalibrated_ticks, 20U);
  EXPECT_EQ(bench.node.counters().unacknowledged_ticks, 10U);
  EXPECT_EQ(bench.node.counters().checking_ticks, 0U);
  EXPECT_EQ(bench.node.counters().fault_ticks, 11U);
}

// As a hAPI board after a power cycle: its set-up is the first message that it answers.
TEST(DeviceNode, ADeviceThatIsSilentUntilItIsCalibratedConfirmsItsReleaseThen) {
  Bench bench(device_config(), false);
  bench.answer_with(Vector3(1, 0, 0));
  bench.node.acknowledge();
  bench.tick();
  bench.device.fails_to_read = true;
  bench.device.confirms_release = false;
  bench.device.reopens = false;
  bench.tick();
  bench.node.acknowledge();
  bench.tick();
  EXPECT_EQ(bench.node.phase(), DevicePhase::kFaulted) << "it is not known to need a calibration";
  EXPECT_EQ(bench.node.vain_acknowledgements(), 1U);

  bench.device.phase_now = DevicePhase::kConnected;
  bench.node.acknowledge();
  EXPECT_EQ(bench.node.phase(), DevicePhase::kFaulted) << "others answer without one";
  bench.device.answers_uncalibrated(false);
  bench.node.acknowledge();
  bench.tick();
  EXPECT_EQ(bench.node.phase(), DevicePhase::kConnected);
  EXPECT_EQ(bench.device.calibrations, 0);
  EXPECT_TRUE(bench.node.counters().is_release_unconfirmed);
  bench.device.fails_to_read = false;
  bench.device.confirms_release = true;
  bench.node.acknowledge();
  EXPECT_FALSE(bench.node.counters().is_release_unconfirmed);
  bench.tick();
  EXPECT_EQ(bench.node.phase(), DevicePhase::kCalibrated);
  EXPECT_EQ(bench.states.back().applied_count, 0U) << "the echo begins anew";
  bench.node.acknowledge();
  bench.tick();
  EXPECT_EQ(bench.node.phase(), DevicePhase::kEnabled);
  EXPECT_EQ(bench.node.counters().device_faults, 1U);
}

// The device has its calibration again when the person acknowledges the fault.
TEST(DeviceNode, ADeviceThatLostItsCalibrationIsNotEnabledByTheResetOfTheFault) {
  struct CalibratesItself : ScriptedDevice {
    explicit CalibratesItself(const Clock& clock) : ScriptedDevice(clock, false) {}
    [[nodiscard]] bool reopen(Duration /*within*/) noexcept override {
      phase_now = DevicePhase::kCalibrated;
      return true;
    }
  };
  DeviceNodeBench<CalibratesItself> bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.node.acknowledge();
  bench.tick();
  bench.device.fails_to_read = true;
  bench.tick();
  bench.device.fails_to_read = false;
  bench.device.phase_now = DevicePhase::kConnected;
  bench.node.acknowledge();
  EXPECT_EQ(bench.node.phase(), DevicePhase::kCalibrated);
  bench.node.acknowledge();
  EXPECT_EQ(bench.node.phase(), DevicePhase::kEnabled);
}

// Its emulated kin answered no more, and six signals did not help: the port was that of before.
TEST(DeviceNode, AnAcknowledgementReachesADeviceThatWasLostBeforeItsCalibration) {
  Bench bench(device_config(), false);
  bench.device.phase_now = DevicePhase::kConnected;
  bench.device.takes_calibration = false;
  bench.tick();
  bench.node.acknowledge();
  EXPECT_EQ(bench.device.reopenings, 1);
  bench.device.takes_calibration = true;
  bench.node.acknowledge();
  EXPECT_EQ(bench.device.reopenings, 1);
  EXPECT_EQ(bench.node.phase(), DevicePhase::kCalibrated);
}

// A force of an earlier process, which was killed: these motors have no watchdog.
struct Earlier {
  DevicePhase phase;
  int silent_for;  ///< releases
};
struct PushedDevice : ScriptedDevice {
  PushedDevice(const Clock& clock, const Earlier& earlier) : ScriptedDevice(clock, false) {
    has_watchdog(false);
    phase_now = earlier.phase;
    writes.push_back({clock.now(), Vector3(1, 0, 0), TimePoint::max()});
    before_release = [this, earlier] { confirms_release = releases >= earlier.silent_for; };
  }
};

TEST(DeviceNode, AForceThatIsThereAtTheStartEndsBeforeTheFirstTick) {
  for (const DevicePhase phase : {DevicePhase::kConnected, DevicePhase::kCalibrated}) {
    for (const int silent_for : {0, 2}) {
      DeviceNodeBench<PushedDevice> bench(device_config(), Earlier{phase, silent_for});
      EXPECT_EQ(bench.device.motor_force_newton(bench.clock.now()), Vector3(0, 0, 0));
      bench.tick();
      EXPECT_FALSE(bench.node.counters().is_release_unconfirmed);
      EXPECT_EQ(bench.node.phase(), phase);
    }
  }
}

TEST(DeviceNode, WhoIsSilentAtTheStartMayPushUnlessItWaitsForItsCalibration) {
  DeviceNodeBench<PushedDevice> bench(device_config(), Earlier{DevicePhase::kCalibrated, 1000});
  bench.tick();
  EXPECT_TRUE(bench.node.counters().is_release_unconfirmed);
  EXPECT_EQ(bench.node.phase(), DevicePhase::kFaulted);

  DeviceNodeBench<PushedDevice> fresh(device_config(), Earlier{DevicePhase::kConnected, 1000});
  fresh.tick();
  EXPECT_FALSE(fresh.node.counters().is_release_unconfirmed);
  EXPECT_EQ(fresh.node.phase(), DevicePhase::kConnected);
}

// --- motors without a watchdog ------------------------------------------------------------------

struct EndlessDevice : ScriptedDevice {
  explicit EndlessDevice(const Clock& clock, bool is_simulated = true)
      : ScriptedDevice(clock, is_simulated) {
    has_watchdog(false);
  }
};
using EndlessBench = DeviceNodeBench<EndlessDevice>;

TEST(DeviceNode, MotorsThatEndNoForceGetNoneAboveTheFrictionUnlessTheSessionAcceptsThat) {
  DeviceConfig config = device_config();
  EndlessBench bench(config);
  bench.answer_with(Vector3(2, 0, 0));
  bench.tick();
  EXPECT_EQ(bench.device.motor_force_newton(bench.clock.now()), Vector3(0.1, 0, 0));
  EXPECT_FALSE(bench.node.counters().accepts_no_motor_watchdog);

  config.accepts_no_motor_watchdog = true;
  EndlessBench accepted(config);
  accepted.answer_with(Vector3(2, 0, 0));
  accepted.tick();
  EXPECT_EQ(accepted.device.motor_force_newton(accepted.clock.now()), Vector3(2, 0, 0));
  EXPECT_TRUE(accepted.node.counters().accepts_no_motor_watchdog);
}

TEST(FrictionLimit, NamesWhatHoldsTheForceAndWhatToDo) {
  const ManualClock clock;
  const EndlessDevice device(clock);
  DeviceConfig config = device_config();  // f_co 0.1 N
  DeviceSpecification specification = device.specification();
  const auto limit = [&](const std::string& driver) {
    return *friction_limit(config, specification, driver);
  };
  EXPECT_EQ(limit("hapi").newton, 0.1);
  EXPECT_FALSE(limit("hapi").is_below_friction);

  specification.held_force_ratio = 2.5;
  EXPECT_DOUBLE_EQ(limit("hapi").newton, 0.04);
  EXPECT_TRUE(limit("hapi").is_below_friction);
  EXPECT_THAT(limit("hapi").why, testing::HasSubstr("divided by 2.5"));

  specification.held_force_ratio = std::numeric_limits<double>::infinity();
  EXPECT_EQ(limit("hapi").newton, 0.0);
  EXPECT_TRUE(limit("hapi").is_below_friction);
  EXPECT_THAT(limit("hapi").why, testing::HasSubstr("singular place of the arm"));
  EXPECT_EQ(limit("hapi").remedy, "give a smaller device.hapi.mount.workspace_half_extent_m");
  EXPECT_THAT(limit("plugin").remedy, testing::HasSubstr("device.plugin.options"));

  specification.held_force_ratio = 2.5;
  config.peak_force_newton = 0.03;
  EXPECT_EQ(limit("hapi").newton, 0.03);
  EXPECT_FALSE(limit("hapi").is_below_friction) << "the session's peak force is smaller";

  config.accepts_no_motor_watchdog = true;
  EXPECT_FALSE(friction_limit(config, specification, "hapi"));
  specification.held_force_ratio = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(friction_limit(config, specification, "plugin")) << "unknown, and accepted";
  specification.turning_per_m = std::numeric_limits<double>::infinity();
  EXPECT_EQ(limit("hapi").newton, 0.0) << "nobody can accept a singular place";
  EXPECT_EQ(largest_force_newton(config, specification), 0.0);
}

// The lease ended at 2 ms, the next reading is at 7 ms: mofc_node finds a gap, and the force ends.
TEST(DeviceNode, AfterAStallTheEchoOfAnEndlessForceBeginsAnew) {
  DeviceConfig config = device_config();
  config.accepts_no_motor_watchdog = true;
  EndlessBench bench(config);
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.on_state = nullptr;
  bench.clock.advance(7ms);
  bench.tick();

  EXPECT_EQ(bench.states[1].applied_count, 0u);
  EXPECT_EQ(bench.states[1].acting_force_on_hand_newton, Vector3(0, 0, 0));
  bench.tick();
  ASSERT_GE(bench.states[2].applied_count, 1u);
  EXPECT_EQ(bench.states[2].applied[0].from, TimePoint(7ms));
}

// The hand stays where it is; its friction earned 1 mJ before. 1 N acted for 20 ms and may have
// ended at any time: v_max/2 · 20 ms · 1 N, less the way there and back.
TEST(DeviceNode, WhatAnEndlessForceMayHaveDrawnInAStallIsADebt) {
  DeviceConfig config = device_config();
  config.accepts_no_motor_watchdog = true;
  config.monitor = {.is_on = true, .v_max_m_per_s = 0.5};
  config.profile.position_resolution_m = 0.0;
  EndlessBench bench(config);
  for (int i = 0; i < 100; ++i) {
    bench.device.position_m = Vector3(1e-4 * i, 0, 0);
    bench.tick();
  }
  const double before_joule = bench.node.monitor_joule();
  ASSERT_GT(before_joule, 1e-3);
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  ASSERT_EQ(bench.device.motor_force_newton(bench.clock.now()), Vector3(1, 0, 0));
  bench.clock.advance(20ms);
  bench.tick();

  EXPECT_NEAR(bench.node.monitor_joule(), before_joule - 5e-3 + 0.1 * 10e-3, 1e-4);
  EXPECT_LT(bench.node.monitor_joule(), 0.0);
  EXPECT_LE(bench.device.motor_force_newton(bench.clock.now()).norm(), 0.1 + 1e-12);
}

// The clock of everything here stands still while the machine sleeps.
TEST(DeviceNode, ASleepOfTheMachineIsAFaultThatReleasesTheMotors) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.node.suspended(0ms);
  bench.tick();
  EXPECT_FALSE(bench.node.has_fault());

  bench.node.suspended(3s);
  bench.tick();
  EXPECT_EQ(bench.node.counters().last_fault, FaultReason::kSuspended);
  EXPECT_EQ(bench.device.motor_force_newton(bench.clock.now()), Vector3(0, 0, 0));
  EXPECT_EQ(bench.node.phase(), DevicePhase::kFaulted);

  bench.node.acknowledge();
  bench.tick();
  EXPECT_TRUE(bench.ticks.back().is_answered);
}

TEST(TickWatch, TellsOnceThatTheTicksStandStill) {
  TickWatch watch;
  TimePoint now{};
  const auto pass = [&](std::uint64_t ticks, Duration step, int looks) {
    int told = 0;
    for (int i = 0; i < looks; ++i) told += watch.hangs(ticks, now += step) ? 1 : 0;
    return told;
  };
  using std::chrono::milliseconds;
  EXPECT_EQ(pass(7, milliseconds(20), 100), 0);
  EXPECT_EQ(pass(7, milliseconds(20), 500), 1);
  EXPECT_EQ(pass(8, milliseconds(20), 50), 0) << "it goes on";
  EXPECT_EQ(pass(8, milliseconds(20), 500), 1) << "and hangs again";
  // the whole process was stopped, or slept: the time jumps, the ticks could not
  EXPECT_EQ(pass(9, std::chrono::hours(1), 10), 0);
  EXPECT_EQ(pass(10, milliseconds(20), 1), 0);
}

TEST(SuspendWatch, TellsASleepFromAThreadThatWaited) {
  SuspendWatch watch({.at_least = 10s, .at_most = 10s + 5us});
  EXPECT_EQ(watch.slept({.at_least = 10s, .at_most = 10s + 2us}), 0ms);
  // preempted between the two clocks
  EXPECT_EQ(watch.slept({.at_least = 10s - 400ms, .at_most = 10s + 1us}), 0ms);
  EXPECT_EQ(watch.slept({.at_least = 10s, .at_most = 10s + 400ms}), 0ms);
  EXPECT_NEAR(to_seconds(watch.slept({.at_least = 13s, .at_most = 13s})), 3.0, 1e-3);
  EXPECT_EQ(watch.slept({.at_least = 13s, .at_most = 13s + 2us}), 0ms);
  EXPECT_EQ(SuspendWatch().slept(), 0ms) << "of this machine, awake";
}

TEST(DeviceNode, CountsWhetherTheMotorsEndAForceByThemselves) {
  Bench bench(device_config());
  EXPECT_FALSE(bench.node.counters().has_no_motor_watchdog);
  bench.device.has_watchdog(false);
  EXPECT_TRUE(bench.node.counters().has_no_motor_watchdog);
}

TEST(DeviceNode, StopAndDestructionReleaseTheMotors) {
  ManualClock clock;
  ScriptedDevice device(clock);
  MemoryLink<DeviceState> states(clock);
  MemoryLink<ForceCommand> commands(clock);
  Inbox<ForceCommand> inbox(commands, clock);
  test::TickVector sink;
  {
    DeviceNode node(device_config(), device, clock, states, inbox, sink, 1);
    static_cast<void>(node.stop());
    EXPECT_EQ(device.releases, 1);
  }
  EXPECT_EQ(device.releases, 2);
}

// --- limits, counters, promises ----------------------------------------------------------------

TEST(DeviceNode, ThePeakOfTheDeviceLimitsThatOfTheSession) {
  DeviceConfig config = device_config();
  config.peak_force_newton = 100.0;  // the scripted device: 3.3 N
  Bench bench(config);
  bench.answer_with(Vector3(50, 0, 0));

  bench.tick();
  bench.tick();

  EXPECT_NEAR(bench.ticks[0].force_on_hand_newton.x(), 3.3, 1e-12);
  EXPECT_TRUE(bench.ticks[0].is_peak_limited);
  EXPECT_NEAR(bench.states[1].applied[0].force_on_hand_newton.x(), 3.3, 1e-12);
  EXPECT_EQ(bench.node.counters().peak_limited_ticks, 2u);
  EXPECT_NEAR(bench.node.counters().max_force_newton, 3.3, 1e-12);
}

TEST(DeviceNode, CountsItsTicksByWhatTheMotorsDid) {
  Bench bench(device_config());
  bench.tick();  // limp
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.tick();  // answered twice, lease until 4 ms
  bench.on_state = nullptr;
  bench.tick();  // leased
  bench.tick();  // fallback at 4.5 ms
  for (int i = 0; i < 100; ++i) bench.tick();

  const DeviceCounters c = bench.node.counters();
  EXPECT_EQ(c.loop.ticks, 105u);
  EXPECT_EQ(c.answered_ticks, 2u);
  EXPECT_EQ(c.leased_ticks, 1u);
  // decided at n + 0.5 ms; limp from 2 + 70 ms of silence on: fallback or fading for n = 4 … 71
  EXPECT_EQ(c.fallback_ticks, 68u);
  EXPECT_EQ(c.limp_ticks, 1u + 33u);
  EXPECT_EQ(c.force_command.accepted, 2u);
  EXPECT_EQ(c.fault_ticks, 0u);
  EXPECT_EQ(c.peak_limited_ticks, 0u);
  EXPECT_EQ(c.max_force_newton, 1.0);
}

// The switch takes 0.1 ms; without an answer there is none.
TEST(DeviceNode, TheRecordSaysWhenTheForceWasDecided) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.device.before_switch = [&] { bench.clock.advance(100us); };
  bench.tick();
  EXPECT_EQ(bench.ticks[0].switched_at, TimePoint(100us));
  bench.on_state = nullptr;
  bench.tick();
  EXPECT_EQ(bench.ticks[1].guard, GuardState::kLeased);
  EXPECT_EQ(bench.ticks[1].switched_at, TimePoint(1500us));

  // a tick that began 2 ms after it was woken
  Bench late(device_config());
  late.clock.advance(3ms);
  late.step({.index = 0, .scheduled_at = TimePoint(1ms), .now = TimePoint(1ms)});
  EXPECT_EQ(late.ticks[0].sampled_at, TimePoint(3ms));
  late.device.fails_to_read = true;
  late.clock.advance(2ms);
  const TimePoint now = late.clock.now();
  late.step({.index = 1, .scheduled_at = TimePoint(2ms), .now = TimePoint(2ms)});
  EXPECT_EQ(late.ticks[1].switched_at, now);
}

TEST(DeviceNode, AForceThatDidNotActIsNotRecordedAsLimited) {
  for (const bool is_late : {true, false}) {
    Bench bench(device_config());
    bench.answer_with(Vector3(5, 0, 0));
    bench.device.fails_to_apply = !is_late;
    if (is_late) bench.device.before_switch = [&] { bench.clock.advance(1ms); };
    bench.tick();
    EXPECT_FALSE(bench.ticks[0].is_peak_limited);
    EXPECT_EQ(bench.ticks[0].force_on_hand_newton, Vector3(0, 0, 0));
  }
}

TEST(DeviceNode, AFallbackWithinATickThatCannotBeWrittenIsAFault) {
  Bench bench(elastic_config());
  bench.answer_with(Vector3(1, 0, 0), 3300us);
  bench.tick();
  bench.on_state = nullptr;
  bench.tick();
  bench.tick();
  bench.device.before_switch = [&] {
    bench.device.fails_to_apply = bench.clock.now() == TimePoint(3300us);
  };
  bench.reply_delay = 400us;
  bench.answer_with(Vector3(2, 0, 0), 3300us);
  bench.tick();
  EXPECT_EQ(bench.node.counters().last_fault, FaultReason::kWriteFailed);
  EXPECT_EQ(bench.ticks[3].force_on_hand_newton, Vector3(0, 0, 0));
}

TEST(DeviceNode, AStopIsEchoedByALaterStep) {
  Bench bench(device_config());
  bench.answer_with(Vector3(1, 0, 0));
  bench.tick();
  bench.clock.advance(200us);
  EXPECT_TRUE(bench.node.stop());
  bench.tick();
  const DeviceState& state = bench.states[1];
  ASSERT_EQ(state.applied_count, 2u);
  expect_segment(state.applied[0], Vector3(1, 0, 0), 0us, 200us);
  EXPECT_FALSE(state.applied[0].has_position_at_end);
  expect_segment(state.applied[1], Vector3::Zero(), 200us, 1000us);
}

TEST(DeviceNode, AnOrientationThatIsNotFiniteIsAFault) {
  Bench bench(device_config());
  bench.device.orientation = Quaternion(kNaN, 0, 0, 0);
  bench.tick();
  EXPECT_EQ(bench.node.counters().last_fault, FaultReason::kReadingNotFinite);
}

TEST(DeviceNode, OnlyTheConfiguredButtonIsTheClutch) {
  DeviceConfig config = device_config();
  Bench none(config);
  none.device.buttons = ~0U;
  none.tick();
  EXPECT_FALSE(none.states[0].is_clutched);
  config.workspace.clutch_button = 1;
  Bench second(config);
  second.device.buttons = 1;
  second.tick();
  EXPECT_FALSE(second.states[0].is_clutched);
  second.device.buttons = 2;
  second.tick();
  EXPECT_TRUE(second.states[1].is_clutched);
  // also in the record of a fault
  second.device.fails_to_apply = true;
  second.answer_with(Vector3(1, 0, 0));
  second.tick();
  second.tick();
  EXPECT_EQ(second.ticks[3].guard, GuardState::kFault);
  EXPECT_TRUE(second.ticks[3].is_clutched);
}

TEST(DeviceNode, TheTrueStateIsRecordedInAFaultToo) {
  DeviceConfig config = device_config();
  config.v_fault_m_per_s = 1e-6;
  config.profile.position_resolution_m = 0.0;
  SimulatedDeviceConfig simulated;
  simulated.position_resolution_m = 0.0;
  DeviceNodeBench<SimulatedDevice> bench(
      config, simulated,
      HandConfig{.path = SinusoidPath{.amplitude_m = Vector3(0.01, 0, 0),
                                      .frequency_hz = Vector3(1, 0, 0)}},
      1);
  for (int i = 0; i < 20; ++i) bench.tick();
  ASSERT_TRUE(bench.node.has_fault());
  for (const DeviceTick& tick : bench.ticks) {
    EXPECT_TRUE(tick.true_tool_position_world_m.allFinite()) << tick.sequence;
  }
}

TEST(DeviceNode, TheFirstReadingIsNoMotion) {
  Bench bench(device_config());
  bench.device.position_m = Vector3(0.5, 0, 0);
  bench.clock.advance(1ms);
  bench.tick();
  EXPECT_EQ(bench.node.counters().too_fast_readings, 0u);
}

TEST(DeviceNode, CountsTheReadingsOfACoarseEncoder) {
  DeviceConfig config = device_config();
  config.profile.position_resolution_m = 1e-5;
  Bench bench(config);
  for (int i = 0; i < 200; ++i) {
    bench.device.position_m = Vector3(1e-4 * (i % 2), 0, 0);
    bench.tick();
  }
  EXPECT_GT(bench.node.counters().coarse_readings, 10u);
}

TEST(DeviceNode, CountsLatenessAndSkippedAppointments) {
  Bench bench(device_config());
  bench.step({.index = 10, .scheduled_at = TimePoint{}, .now = TimePoint{}});
  bench.clock.advance(5ms);
  bench.step({.index = 14, .scheduled_at = TimePoint(4ms), .now = TimePoint(5ms)});

  EXPECT_EQ(bench.node.counters().loop.skipped_ticks, 3u);
  EXPECT_EQ(bench.node.counters().loop.worst_lateness, Duration(1ms));
  EXPECT_EQ(bench.ticks[1].lateness, Duration(1ms));
  bench.clock.advance(1ms);
  bench.step({.index = 15, .scheduled_at = bench.clock.now(), .now = bench.clock.now()});
  EXPECT_EQ(bench.node.counters().loop.worst_lateness, Duration(1ms));
}

TEST(DeviceNode, TheRecordHasTheTrueStateOfASimulatedDeviceInTheToolsFrame) {
  DeviceConfig config = device_config();
  config.workspace.scale_ratio = 3.0;
  DeviceNodeBench<SimulatedDevice> bench(
      config, SimulatedDeviceConfig{},
      HandConfig{.path = SinusoidPath{.amplitude_m = Vector3(0.01, 0, 0),
                                      .frequency_hz = Vector3(1, 0, 0)}},
      1);
  for (int i = 0; i < 200; ++i) bench.tick();

  const DeviceTick& tick = bench.ticks.back();
  EXPECT_GT(tick.true_energy_joule, 0.0);
  EXPECT_EQ(tick.minimum_true_energy_joule, 0.0);
  // the encoder rounds by 27.5 µm at most
  EXPECT_LE(
      (tick.true_tool_position_world_m - tick.measured_tool_position_world_m).cwiseAbs().maxCoeff(),
      3 * 27.6e-6);
  EXPECT_GT(tick.true_tool_velocity_world_m_per_s.x(), 0.01);
  EXPECT_EQ(bench.node.counters().minimum_true_energy_joule, 0.0);
}

TEST(DeviceNode, TheRecordOfOtherDevicesHasNoTrueState) {
  Bench bench(device_config());
  bench.tick();

  EXPECT_TRUE(std::isnan(bench.ticks[0].true_energy_joule));
  EXPECT_TRUE(std::isnan(bench.node.counters().minimum_true_energy_joule));
}

TEST(DeviceNode, StepDoesNotAllocate) {
  DeviceConfig config = device_config();
  DeviceNodeBench<SimulatedDevice> bench(config, SimulatedDeviceConfig{},
                                         HandConfig{.path = HostilePath{}}, 1);
  bench.reply_delay = 100us;
  bench.answer_with(Vector3(1, 0, 0));

  // answered, leased, fallback and fading in turn
  EXPECT_EQ(bench.allocations_of_ticks(), 0u);
  EXPECT_GT(bench.node.counters().fallback_ticks, 0u);
}

static_assert(noexcept(std::declval<DeviceNode&>().step(std::declval<const Tick&>())));

}  // namespace
}  // namespace palpate::device
