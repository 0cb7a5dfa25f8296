// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/event_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>

#include <sstream>

namespace palpate {
namespace {

using std::chrono::milliseconds;

TimePoint at(Duration since_start) { return TimePoint{} + since_start; }

class EventLogTest : public testing::Test {
 protected:
  EventLogTest() : logger_("node", std::make_shared<spdlog::sinks::ostream_sink_st>(text_)) {
    logger_.set_pattern("%l %v");
  }
  /// The lines since the last call.
  std::string lines() {
    std::string lines = text_.str();
    text_.str("");
    return lines;
  }

  std::ostringstream text_;
  spdlog::logger logger_;
};

TEST_F(EventLogTest, NothingHappenedIsNothingSaid) {
  EventLog<DeviceCounters> events(logger_);
  DeviceCounters counters;
  events.note(counters, at(milliseconds(0)));
  counters.limp_ticks = 500;  // limp is how a device starts
  counters.loop.ticks = 500;
  events.note(counters, at(milliseconds(500)));
  EXPECT_EQ(lines(), "");
}

TEST_F(EventLogTest, TellsFirstContactAndARestartedPeer) {
  EventLog<PhysicsCounters> events(logger_);
  PhysicsCounters counters;

  counters.tool_motion.sessions = 1;
  events.note(counters, at(milliseconds(0)));
  EXPECT_EQ(lines(), "info event=peer_up link=tool_motion\n");

  counters.tool_motion.accepted = 100;
  events.note(counters, at(milliseconds(100)));
  EXPECT_EQ(lines(), "");

  counters.tool_motion.sessions = 2;
  events.note(counters, at(milliseconds(200)));
  EXPECT_EQ(lines(), "warning event=peer_restarted link=tool_motion sessions=2\n");
}

TEST_F(EventLogTest, RejectionsAreThrottled) {
  EventLog<MofcCounters> events(logger_);
  MofcCounters counters;
  for (int ms = 0; ms <= 1000; ++ms) {
    counters.interaction.rejected += 1;
    events.note(counters, at(milliseconds(ms)));
  }
  EXPECT_EQ(lines(),
            "warning event=messages_rejected link=interaction count=1\n"
            "warning event=messages_rejected link=interaction count=1000\n");
}

TEST_F(EventLogTest, ADeviceFaultIsAnErrorWithItsReasonAndItsRemedyAndIsToldOnce) {
  EventLog<DeviceCounters> events(logger_);
  DeviceCounters counters;
  counters.device_faults = 1;
  counters.last_fault = FaultReason::kPositionJumped;
  events.note(counters, at(milliseconds(0)));
  EXPECT_EQ(lines(),
            "error event=device_fault reason=\"position jumped\" count=1 "
            "remedy=\"clear the cause, then send SIGUSR2 (event=acknowledge_with)\"\n");
  counters.fault_ticks = 500;
  events.note(counters, at(milliseconds(500)));
  EXPECT_EQ(lines(), "");

  counters.fault_resets = 1;
  events.note(counters, at(milliseconds(520)));
  EXPECT_EQ(lines(), "info event=device_fault_reset\n");
}

TEST_F(EventLogTest, MotorsThatMayStillPushAreAnErrorUntilTheyConfirmTheirRelease) {
  EventLog<DeviceCounters> events(logger_);
  DeviceCounters counters;
  counters.is_release_unconfirmed = true;
  for (int ms = 0; ms < 3; ++ms) events.note(counters, at(milliseconds(ms)));
  EXPECT_EQ(
      lines(),
      "error event=release_unconfirmed remedy=\"the motors may still push: take the hand off, "
      "switch off their supply\"\n");
  counters.is_release_unconfirmed = false;
  events.note(counters, at(milliseconds(4)));
  EXPECT_EQ(lines(), "info event=release_confirmed\n");
}

TEST_F(EventLogTest, ADeviceThatWaitsForAPersonSaysForWhat) {
  EventLog<DeviceCounters> events(logger_);
  DeviceCounters counters;
  const auto lines_in = [&](DevicePhase phase) {
    counters.phase = phase;
    events.note(counters, at(milliseconds(0)));
    events.note(counters, at(milliseconds(1)));
    return lines();
  };
  EXPECT_THAT(lines_in(DevicePhase::kConnected),
              testing::MatchesRegex("warning event=device_phase phase=connected remedy=\"calibrate "
                                    ".* then send SIGUSR2 .event=acknowledge_with.\"\n"));
  EXPECT_THAT(lines_in(DevicePhase::kCalibrated),
              testing::MatchesRegex("warning event=device_phase phase=calibrated remedy=\"no force "
                                    "yet.* SIGUSR2 .*\"\n"));
  EXPECT_EQ(lines_in(DevicePhase::kEnabled), "info event=device_phase phase=enabled\n");

  EventLog<DeviceCounters> simulated(logger_);
  simulated.note(counters, at(milliseconds(0)));
  EXPECT_EQ(lines(), "") << "enabled from its start";
}

TEST_F(EventLogTest, ACommandThatIsNotFiniteIsAnError) {
  EventLog<DeviceCounters> events(logger_);
  DeviceCounters counters;
  counters.non_finite_commands = 2;
  events.note(counters, at(milliseconds(0)));
  EXPECT_EQ(lines(), "error event=command_not_finite count=2\n");
}

TEST_F(EventLogTest, ALateSwitchIsAWarning) {
  EventLog<DeviceCounters> events(logger_);
  DeviceCounters counters;
  counters.late_switches = 1;
  events.note(counters, at(milliseconds(0)));
  EXPECT_EQ(lines(), "warning event=switch_late count=1\n");
}

TEST_F(EventLogTest, TellsWhatTheMonitorReducedAndWhichAssumptionsReadingsContradict) {
  EventLog<DeviceCounters> events(logger_);
  DeviceCounters counters;
  counters.monitor_reductions = 1;
  counters.too_fast_readings = 2;
  counters.coarse_readings = 3;
  counters.outside_readings = 4;
  events.note(counters, at(milliseconds(0)));
  EXPECT_EQ(lines(),
            "error event=monitor_reduced count=1\n"
            "warning event=hand_faster_than_assumed count=2\n"
            "warning event=encoder_coarser_than_profile count=3\n"
            "warning event=hand_outside_workspace count=4\n");
}

TEST_F(EventLogTest, AnAnswerAheadIsAWarningWithItsLink) {
  EventLog<DeviceCounters> events(logger_);
  DeviceCounters counters;
  counters.force_command.ahead = 3;
  events.note(counters, at(milliseconds(0)));
  EXPECT_EQ(lines(), "warning event=answers_ahead link=force_command count=3\n");
}

// 100 limp ticks at the start, then answers; 5 + 3 fallback ticks that flutter; quiet from 60 ms
// on.
TEST_F(EventLogTest, AFlutteringFallbackIsOneEpisode) {
  EventLog<DeviceCounters> events(logger_);
  DeviceCounters counters;
  counters.limp_ticks = 100;
  events.note(counters, at(milliseconds(0)));
  counters.answered_ticks = 20;
  events.note(counters, at(milliseconds(20)));
  ASSERT_EQ(lines(), "");

  counters.fallback_ticks = 5;
  events.note(counters, at(milliseconds(40)));
  EXPECT_EQ(lines(), "warning event=fallback_began\n");
  events.note(counters, at(milliseconds(50)));
  counters.fallback_ticks = 8;
  events.note(counters, at(milliseconds(60)));
  events.note(counters, at(milliseconds(1059)));
  EXPECT_EQ(lines(), "");

  events.note(counters, at(milliseconds(1060)));
  EXPECT_EQ(lines(), "info event=fallback_ended ticks=8\n");
}

TEST_F(EventLogTest, AFallbackThatEndsLimpHasNotEnded) {
  EventLog<DeviceCounters> events(logger_);
  DeviceCounters counters;
  counters.answered_ticks = 20;
  events.note(counters, at(milliseconds(0)));
  counters.fallback_ticks = 70;
  events.note(counters, at(milliseconds(100)));
  ASSERT_EQ(lines(), "warning event=fallback_began\n");

  for (int ms = 200; ms < 5000; ms += 20) {
    counters.limp_ticks += 20;
    events.note(counters, at(milliseconds(ms)));
  }

  EXPECT_EQ(lines(), "");
}

TEST_F(EventLogTest, TellsEachTroubleOfTheClamp) {
  EventLog<MofcCounters> events(logger_);
  MofcCounters counters;
  counters.late_physics_ticks = 2;
  counters.motions_dropped = 3;
  counters.ledger_resets = 1;
  counters.stale_ticks = 4;
  events.note(counters, at(milliseconds(0)));
  EXPECT_EQ(lines(),
            "warning event=physics_late count=2\n"
            "warning event=motions_dropped count=3\n"
            "info event=ledger_reset count=1\n"
            "warning event=interaction_stale_began\n");
}

TEST_F(EventLogTest, TellsALongDebtOnce) {
  EventLog<MofcCounters> events(logger_);
  MofcCounters counters;
  counters.debt_ticks = 900;
  events.note(counters, at(milliseconds(0)));
  EXPECT_EQ(lines(), "");
  counters.debt_ticks = 1'020;
  events.note(counters, at(milliseconds(100)));
  EXPECT_THAT(lines(), testing::StartsWith("warning event=energy_debt ticks=1020: "));
  counters.debt_ticks = 90'000;
  events.note(counters, at(milliseconds(90'000)));
  EXPECT_EQ(lines(), "");
}

TEST_F(EventLogTest, TellsSkippedTicks) {
  EventLog<PhysicsCounters> physics(logger_);
  PhysicsCounters physics_counters;
  physics_counters.loop.skipped_ticks = 2;
  physics.note(physics_counters, at(milliseconds(0)));
  EventLog<DeviceCounters> device(logger_);
  DeviceCounters device_counters;
  device_counters.loop.skipped_ticks = 3;
  device.note(device_counters, at(milliseconds(0)));

  EXPECT_EQ(lines(),
            "warning event=ticks_skipped count=2\n"
            "warning event=ticks_skipped count=3\n");
}

}  // namespace
}  // namespace palpate
