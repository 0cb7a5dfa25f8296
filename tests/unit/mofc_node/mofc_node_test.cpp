// SPDX-License-Identifier: Apache-2.0
// mofc_node's own rules: relay, staleness, sessions, the same-tick wait. Manual clock, memory
// links.
#include "mofc_node/mofc_node.h"
#include "mofc_node/silence_fade.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "common/core/memory_link.h"
#include "mofc_node/make_controller.h"
#include "mofc_node/model_probe.h"
#include "mofc_node/motion_deadband.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/hostile/costly_descriptions.h"

namespace palpate::mofc {
namespace {

using namespace std::chrono_literals;

class KeepAll final : public TickSink<MofcTick> {
 public:
  void keep(const MofcTick& tick) noexcept override { ticks.push_back(tick); }
  std::vector<MofcTick> ticks;
};

/// A mofc_node; the test plays the device and the physics.
class MofcNodeTest : public testing::Test {
 protected:
  static MofcConfig mofc_config() {
    MofcConfig config;
    config.controller = ControllerKind::kNone;
    config.interaction = InteractionUse::kHeld;
    config.stale_after = 6ms;
    config.fade = 50ms;
    config.velocity_estimator = DifferenceVelocity{};
    return config;
  }
  static ClampedDevice clamped_device() { return {.lease = 2ms}; }

  explicit MofcNodeTest(const MofcConfig& mofc = mofc_config(),
                        const ClampedDevice& device = clamped_device())
      : node_(mofc, device, clock_, motion_link_, interaction_in_, records_, 77) {
    interaction_link_.on_wait = [this](TimePoint deadline) { clock_.sleep_until(deadline); };
  }

  ForceCommand tick(std::uint64_t device_session = 1) {
    Received<DeviceState> state;
    state.value.header = {device_session, sequence_, clock_.now()};
    state.value.hand_position_m = position_m_;
    state.value.tool_position_world_m = position_m_;
    state.value.is_clutched = is_clutched_;
    state.value.monitor_energy_joule = monitor_energy_joule_;
    if (sequence_ > 0) {
      state.value.applied[0] = {echoed_newton_, clock_.now() - lost_for_, clock_.now(), position_m_,
                                true};
      state.value.applied_count = 1;
    }
    state.received_at = clock_.now();
    ForceCommand command = node_.answer(state);
    node_.finish_turn();
    ++sequence_;
    return command;
  }

  /// Answers the newest state, or the one named; one that is not sent yet as the next tick.
  void physics_sends(const Vector3& force_newton, std::uint64_t device_session = 1,
                     std::optional<std::uint64_t> device_sequence = std::nullopt) {
    Interaction interaction;
    interaction.header = {9, physics_sequence_++, clock_.now()};
    interaction.device_session_id = device_session;
    interaction.device_sequence = device_sequence.value_or(sequence_ - 1);
    interaction.device_sampled_at =
        clock_.now() - (interaction.device_sequence >= sequence_ ? 0ms : 3ms);
    interaction.force_on_tool_newton = force_newton;
    interaction.contact_count = contacts_;
    ASSERT_EQ(interaction_link_.send(interaction), SendResult::kSent);
  }

  ToolMotion last_motion() {
    ToolMotion motion;
    TimePoint at;
    while (motion_link_.receive(motion, at)) {
    }
    return motion;
  }

  ManualClock clock_;
  MemoryLink<ToolMotion> motion_link_{clock_};
  MemoryLink<Interaction> interaction_link_{clock_};
  Inbox<Interaction> interaction_in_{interaction_link_, clock_};
  KeepAll records_;
  MofcNode node_;
  std::uint64_t sequence_ = 0;
  std::uint64_t physics_sequence_ = 0;
  std::uint32_t contacts_ = 1;
  Vector3 position_m_ = Vector3::Zero();
  Vector3 echoed_newton_ = Vector3::Zero();
  bool is_clutched_ = false;
  Duration lost_for_ = 1ms;  // since the newest reading with an answer
  double monitor_energy_joule_ = std::numeric_limits<double>::infinity();
};

TEST_F(MofcNodeTest, RequestsNoForceBeforeThePhysicsSpeaks) {
  const ForceCommand command = tick();

  EXPECT_EQ(command.force_on_hand_newton, Vector3::Zero());
  EXPECT_EQ(records_.ticks.back().state, MofcState::kNoPhysics);
}

TEST_F(MofcNodeTest, AnswersTheVeryStateItWasGivenWithTheLeaseOfTheSession) {
  tick();
  const ForceCommand command = tick();

  EXPECT_EQ(command.answers_session_id, 1u);
  EXPECT_EQ(command.answers_sequence, 1u);
  EXPECT_EQ(command.answers_sampled_at, clock_.now());
  EXPECT_EQ(command.valid_for, Duration(2ms));
}

TEST_F(MofcNodeTest, RelaysTheMotionWithTheDevicesStampAndAVelocity) {
  tick();
  clock_.advance(1ms);
  position_m_ = {1e-4, 0, 0};
  tick();

  const ToolMotion motion = last_motion();
  EXPECT_EQ(motion.header.session_id, 77u);
  EXPECT_EQ(motion.header.sequence, 1u);
  EXPECT_EQ(motion.device_sequence, 1u);
  EXPECT_EQ(motion.device_sampled_at, TimePoint(1ms));
  // 0.1 mm in 1 ms
  EXPECT_NEAR(motion.tool_velocity_world_m_per_s.x(), 0.1, 1e-12);
}

TEST_F(MofcNodeTest, HoldsTheNewestForceAndRecordsItsAgeOnTheDevicesClock) {
  tick();
  clock_.advance(10ms);
  physics_sends({0, 0, 1.5});
  clock_.advance(1ms);

  const ForceCommand command = tick();

  EXPECT_EQ(command.force_on_hand_newton, Vector3(0, 0, 1.5));
  EXPECT_EQ(records_.ticks.back().force_age, Duration(4ms));
  EXPECT_EQ(records_.ticks.back().state, MofcState::kContact);
}

// the next answer uses it as if it had read it itself, but for when it came
TEST_F(MofcNodeTest, WhatIsReadAheadCountsForTheNextAnswer) {
  const auto answers_newest = [&](double newton) {
    Interaction interaction;
    interaction.header = {9, physics_sequence_++, clock_.now()};
    interaction.device_session_id = records_.ticks.back().device_session_id;
    interaction.device_sequence = records_.ticks.back().device_sequence;
    interaction.device_sampled_at = records_.ticks.back().device_sampled_at;
    interaction.force_on_tool_newton = {0, 0, newton};
    interaction.contact_count = 1;
    ASSERT_EQ(interaction_link_.send(interaction), SendResult::kSent);
  };
  node_.read_ahead();  // before the first state there is nothing to be read for
  tick();
  clock_.advance(500us);
  answers_newest(1.5);
  node_.read_ahead();
  Interaction left;
  TimePoint at;
  ASSERT_FALSE(interaction_link_.receive(left, at));
  clock_.advance(500us);
  EXPECT_EQ(tick().force_on_hand_newton.z(), 1.5);
  EXPECT_EQ(node_.counters().interaction.accepted, 1u);

  // a newer one that comes after that is used, too
  clock_.advance(500us);
  answers_newest(2.0);
  node_.read_ahead();
  answers_newest(3.0);
  clock_.advance(500us);
  EXPECT_EQ(tick().force_on_hand_newton.z(), 3.0);

  // stale 6 ms after it was read, not after the answer that used it
  clock_.advance(500us);
  answers_newest(3.0);
  node_.read_ahead();
  clock_.advance(6ms);
  EXPECT_EQ(tick().force_on_hand_newton.z(), 3.0);
  clock_.advance(1ms);
  EXPECT_LT(tick().force_on_hand_newton.z(), 3.0);

  // what answers another session does not count
  answers_newest(3.0);
  node_.read_ahead();
  EXPECT_EQ(tick(2).force_on_hand_newton, Vector3::Zero());
}

// stale at 6 ms of silence, fade over 50 ms: at 6 + 25 ms half is left, at 56 ms nothing
TEST_F(MofcNodeTest, FadesToZeroAfterSilence) {
  tick();
  physics_sends({0, 0, 2});
  EXPECT_EQ(tick().force_on_hand_newton.z(), 2.0);
  clock_.advance(6ms);
  EXPECT_EQ(tick().force_on_hand_newton.z(), 2.0);
  clock_.advance(25ms);
  EXPECT_NEAR(tick().force_on_hand_newton.z(), 1.0, 1e-12);
  EXPECT_EQ(records_.ticks.back().state, MofcState::kFading);
  clock_.advance(25ms);
  EXPECT_EQ(tick().force_on_hand_newton, Vector3::Zero());
  EXPECT_EQ(records_.ticks.back().state, MofcState::kNoPhysics);

  // speaks again: the force grows from zero over the fade, without a jump
  physics_sends({0, 0, 2});
  EXPECT_EQ(tick().force_on_hand_newton.z(), 0.0);
  clock_.advance(5ms);
  physics_sends({0, 0, 2});
  EXPECT_NEAR(tick().force_on_hand_newton.z(), 0.2, 1e-12);
  for (int i = 0; i < 10; ++i) {
    clock_.advance(5ms);
    physics_sends({0, 0, 2});
    tick();
  }
  EXPECT_EQ(records_.ticks.back().commanded_force_on_hand_newton.z(), 2.0);
}

// A press that lost its force, or in which mofc_node began, to its end and 0.1 s on; a tick of the
// device that is missing, and so long after it.
TEST_F(MofcNodeTest, CountsContactNearADisturbance) {
  tick();
  const auto run = [&](int ticks) {
    for (int i = 0; i < ticks; ++i) {
      clock_.advance(1ms);
      physics_sends({0, 0, contacts_ > 0 ? 2.0 : 0.0});
      tick();
    }
  };
  const auto leave_tissue = [&] {
    contacts_ = 0;
    run(200);
    contacts_ = 1;
  };
  run(150);
  EXPECT_EQ(node_.counters().disturbed_contact_ticks, 150u) << "it began in tissue";
  leave_tissue();
  run(50);
  EXPECT_EQ(node_.counters().contact_ticks, 200u);
  EXPECT_EQ(node_.counters().disturbed_contact_ticks, 150u);
  for (int i = 0; i < 20; ++i) {  // silent, and stale after 6 ms
    clock_.advance(1ms);
    tick();
  }
  EXPECT_GT(node_.counters().stale_ticks, 0u);
  const std::uint64_t silent = node_.counters().disturbed_contact_ticks;
  EXPECT_GT(silent, 160u);
  run(300);
  EXPECT_EQ(node_.counters().disturbed_contact_ticks, silent + 300);
  leave_tissue();
  run(200);
  const std::uint64_t after = node_.counters().disturbed_contact_ticks;
  EXPECT_EQ(after, silent + 300);
  lost_for_ = 2ms;  // what acted since the last answer
  clock_.advance(1ms);
  tick();
  lost_for_ = 1ms;
  run(200);
  EXPECT_EQ(node_.counters().disturbed_contact_ticks, after + 101);
  lost_for_ = 150ms;  // no force acts for so long
  clock_.advance(1ms);
  tick();
  lost_for_ = 1ms;
  run(300);
  EXPECT_EQ(node_.counters().disturbed_contact_ticks, after + 101 + 301);
  EXPECT_EQ(node_.counters().disturbed_clamped_ticks, 0u);
}

// physics that repeats its answer to an old motion counts as silent
TEST_F(MofcNodeTest, PhysicsThatAnswersNoNewMotionGoesStale) {
  tick();
  physics_sends({0, 0, 2});
  ASSERT_EQ(tick().force_on_hand_newton.z(), 2.0);
  const std::uint64_t answered = sequence_ - 2;
  for (int i = 0; i < 80; ++i) {
    clock_.advance(1ms);
    physics_sends({0, 0, 2}, 1, answered);
    tick();
  }

  EXPECT_EQ(records_.ticks.back().commanded_force_on_hand_newton, Vector3::Zero());
  EXPECT_EQ(records_.ticks.back().state, MofcState::kNoPhysics);
}

// as if it had seen the tool where it will be: refused, the earlier answer stays
TEST_F(MofcNodeTest, RefusesAndCountsAnAnswerToAStateThatTheDeviceHasNotSent) {
  tick();
  physics_sends({0, 0, 1});
  ASSERT_EQ(tick().force_on_hand_newton.z(), 1.0);

  physics_sends({0, 0, 2}, 1, sequence_ + 1);
  EXPECT_EQ(tick().force_on_hand_newton.z(), 1.0) << "ahead by one";
  clock_.advance(1ms);
  physics_sends({0, 0, 2}, 1, sequence_);
  clock_.advance(1ms);
  EXPECT_EQ(tick().force_on_hand_newton.z(), 1.0) << "its number, guessed; not its stamp";
  EXPECT_EQ(node_.counters().interaction.ahead, 2u);
  EXPECT_EQ(node_.counters().interaction.accepted, 1u);

  physics_sends({0, 0, 2});
  EXPECT_EQ(tick().force_on_hand_newton.z(), 2.0);
}

TEST_F(MofcNodeTest, ForgetsTheForceOfAnotherDeviceSession) {
  tick(1);
  physics_sends({0, 0, 2}, 1);
  ASSERT_EQ(tick(1).force_on_hand_newton.z(), 2.0);

  EXPECT_EQ(tick(2).force_on_hand_newton, Vector3::Zero()) << "answers session 1, not 2";
  physics_sends({0, 0, 1}, 2);
  EXPECT_EQ(tick(2).force_on_hand_newton.z(), 1.0);
}

TEST_F(MofcNodeTest, RendersNothingWhileClutched) {
  tick();
  physics_sends({0, 0, 2});
  is_clutched_ = true;

  EXPECT_EQ(tick().force_on_hand_newton, Vector3::Zero());
  EXPECT_EQ(records_.ticks.back().state, MofcState::kClutched);
}

// requested 2 N, the echo reports 1 N along it: 0.5
TEST_F(MofcNodeTest, TransparencyComparesTheEchoWithTheRequest) {
  tick();
  physics_sends({0, 0, 2});
  tick();
  clock_.advance(1ms);
  echoed_newton_ = {0, 0, 1};
  tick();

  const MofcCounters counters = node_.counters();
  ASSERT_EQ(counters.transparency_time_ns, 1'000'000u);
  EXPECT_NEAR(counters.transparency_integral_ns, 0.5e6, 1e-6);
  EXPECT_NEAR(counters.transparency(), 0.5, 1e-12);
}

class MofcNodeThins : public MofcNodeTest {
 protected:
  static MofcConfig thinning() {
    MofcConfig config = mofc_config();
    config.motion_deadband = MotionDeadband{.ratio = 0.1,
                                            .floor_m_per_s = 0.01,
                                            .floor_m = 1e-4,
                                            .floor_rad = 0.02,
                                            .keep_alive = 20ms};
    return config;
  }
  MofcNodeThins() : MofcNodeTest(thinning()) {}

  std::vector<ToolMotion> motions() {
    std::vector<ToolMotion> all;
    ToolMotion motion;
    TimePoint at;
    while (motion_link_.receive(motion, at)) all.push_back(motion);
    return all;
  }
  void ticks_at(const Vector3& position_m, int count) {
    position_m_ = position_m;
    for (int i = 0; i < count; ++i) {
      tick();
      clock_.advance(1ms);
    }
  }
};

// ticks 0, 20 and 40 of 41; the rest is suppressed and no sequence number is missing
TEST_F(MofcNodeThins, TheMotionOfARestingToolIsSentOncePerKeepAlive) {
  ticks_at(Vector3::Zero(), 41);

  const std::vector<ToolMotion> sent = motions();
  ASSERT_EQ(sent.size(), 3u);
  EXPECT_EQ(sent[1].device_sequence, 20u);
  EXPECT_EQ(sent[2].device_sequence, 40u);
  EXPECT_EQ(sent[2].header.sequence, 2u);
  EXPECT_EQ(node_.counters().motions_suppressed, 38u);
}

// floors: 0.1 mm and 10 mm/s
TEST_F(MofcNodeThins, AMotionIsSentWhenPositionOrVelocityHasChangedByMoreThanTheFloor) {
  ticks_at(Vector3::Zero(), 2);
  ASSERT_EQ(motions().size(), 1u);
  ticks_at({9e-6, 0, 0}, 1);
  EXPECT_TRUE(motions().empty()) << "9 mm/s and 0.009 mm";
  ticks_at({9e-5, 0, 0}, 1);
  EXPECT_EQ(motions().size(), 1u) << "81 mm/s";
  ticks_at({9e-5, 0, 0}, 1);
  EXPECT_EQ(motions().size(), 1u) << "it rests again";
}

TEST_F(MofcNodeThins, AChangeOfVelocityCountsAgainstTheVelocity) {
  const MotionDeadband deadband = *thinning().motion_deadband;
  ToolMotion sent;
  sent.tool_velocity_world_m_per_s = {0.2, 0, 0};
  ToolMotion present = sent;
  present.tool_velocity_world_m_per_s.x() = 0.22;
  EXPECT_FALSE(is_worth_sending(sent, present, deadband)) << "0.020 ≤ 10 % of 0.22";
  present.tool_velocity_world_m_per_s.x() = 0.23;
  EXPECT_TRUE(is_worth_sending(sent, present, deadband)) << "0.030 > 0.023";
}

TEST_F(MofcNodeThins, ButtonsAndOrientationCountToo) {
  const MotionDeadband deadband = *thinning().motion_deadband;
  const ToolMotion sent;
  ToolMotion pressed;
  pressed.buttons = 1;
  EXPECT_TRUE(is_worth_sending(sent, pressed, deadband));
  ToolMotion turned;
  turned.tool_orientation_world = Eigen::AngleAxisd(0.019, Vector3::UnitX());
  EXPECT_FALSE(is_worth_sending(sent, turned, deadband));
  turned.tool_orientation_world = Eigen::AngleAxisd(0.021, Vector3::UnitX());
  EXPECT_TRUE(is_worth_sending(sent, turned, deadband));
}

TEST_F(MofcNodeThins, TheMotionOfANewDeviceSessionIsSentAtOnce) {
  ticks_at(Vector3::Zero(), 2);
  motions();
  tick(2);
  EXPECT_EQ(motions().size(), 1u);
}

// the link holds 256: a motion that it does not take is tried again in the next tick
TEST_F(MofcNodeThins, AMotionThatTheLinkDidNotTakeDoesNotCountAsSent) {
  for (int i = 0; i < 256; ++i) motion_link_.send(ToolMotion{});
  ticks_at(Vector3::Zero(), 3);
  EXPECT_EQ(node_.counters().motions_dropped, 3u);
  motions();
  ticks_at(Vector3::Zero(), 2);
  EXPECT_EQ(motions().size(), 1u);
}

// The force left what needs no news after 500 ms of silence: it fades from there, not from 6 ms on.
TEST(SilenceFade, BeginsWhereTheForceNeedsNews) {
  SilenceFade fade(6ms, 50ms);
  const Vector3 force(0, 0, 2);
  TimePoint now(1s);
  const auto step = [&](Duration silence, bool needs_no_news) {
    now += 1ms;
    return fade.step(force, silence, needs_no_news, Duration::zero(), now);
  };
  for (int i = 0; i < 500; ++i) {
    const auto output = step(i * 1ms, true);
    ASSERT_EQ(output.phase, SilenceFade::Phase::kPresent) << i;
    ASSERT_EQ(output.force_newton, force) << i;
  }
  EXPECT_NEAR(step(500ms, false).force_newton.z(), 2.0 * 49 / 50, 1e-12);
  EXPECT_NEAR(step(501ms, false).force_newton.z(), 2.0 * 48 / 50, 1e-12);
  for (int i = 2; i < 50; ++i) static_cast<void>(step(500ms + i * 1ms, false));
  EXPECT_EQ(step(550ms, false).phase, SilenceFade::Phase::kFadedOut);
  // back, but no faster than it came
  EXPECT_NEAR(step(551ms, true).force_newton.norm(), 0.0, 1e-12);
  EXPECT_NEAR(step(552ms, true).force_newton.z(), 2.0 / 50, 1e-12);
}

class MofcNodeScaled : public MofcNodeTest {
 protected:
  static ClampedDevice scaled() {
    ClampedDevice device = clamped_device();
    device.workspace.force_ratio = 0.25;
    return device;
  }
  MofcNodeScaled() : MofcNodeTest(mofc_config(), scaled()) {}
};

TEST_F(MofcNodeScaled, ScalesTheForceOnTheToolToTheHand) {
  tick();
  physics_sends({0, 0, 2});

  EXPECT_EQ(tick().force_on_hand_newton.z(), 0.5);
}

class MofcNodeWaits : public MofcNodeTest {
 protected:
  static MofcConfig waiting() {
    MofcConfig config = mofc_config();
    config.wait_for_physics = 15ms;
    config.stale_after = 120ms;
    return config;
  }
  MofcNodeWaits() : MofcNodeTest(waiting()) {}
};

TEST_F(MofcNodeWaits, AnswersFromThePhysicsOfThisVeryTick) {
  tick();
  physics_sends({0, 0, 2}, 1, sequence_);

  EXPECT_EQ(tick().force_on_hand_newton.z(), 2.0);
  // the first tick, before the physics spoke, was late
  EXPECT_EQ(node_.counters().late_physics_ticks, 1u);
}

TEST_F(MofcNodeWaits, CommandsNoMoreThanFrictionAbsorbsWhenThePhysicsIsLate) {
  tick();
  physics_sends({0, 0, 2}, 1, sequence_);
  tick();

  const ForceCommand late = tick();  // nobody answered this one

  EXPECT_NEAR(late.force_on_hand_newton.norm(), 0.1, 1e-12);
  EXPECT_EQ(node_.counters().late_physics_ticks, 2u);
}

class MofcNodeGuards : public MofcNodeTest {
 protected:
  static MofcConfig clamping() {
    MofcConfig config = mofc_config();
    config.controller = ControllerKind::kMofc;
    config.mode = MofcMode::kVector;
    return config;
  }
  MofcNodeGuards() : MofcNodeTest(clamping()) {}

  /// After a motion that has earned credit: the next state, 1 ms later, with an echo of one
  /// stretch.
  void echo_after_motion(Duration from, Duration until) {
    tick();
    clock_.advance(1ms);
    position_m_ = {0.05, 0, 0};
    tick();
    ASSERT_GT(records_.ticks.back().ledger_energy_joule, 1e-3);

    Received<DeviceState> state;
    state.value.header = {1, sequence_, clock_.now() + 1ms};
    state.value.hand_position_m = position_m_;
    state.value.applied[0] = {Vector3::Zero(), clock_.now() + from, clock_.now() + until,
                              position_m_, true};
    state.value.applied_count = 1;
    (void)node_.answer(state);
    node_.finish_turn();
  }
};

// the same echo with a new header: nobody knows what acted since
TEST_F(MofcNodeGuards, AnEchoThatEndsBeforeItsReadingIsAGap) {
  ASSERT_NO_FATAL_FAILURE(echo_after_motion(-1ms, 0ms));
  EXPECT_EQ(records_.ticks.back().ledger_energy_joule, 0.0);
}

TEST_F(MofcNodeGuards, AnEchoFromTheFutureIsAGap) {
  ASSERT_NO_FATAL_FAILURE(echo_after_motion(0ms, 2ms));
  EXPECT_EQ(records_.ticks.back().ledger_energy_joule, 0.0);
  EXPECT_EQ(node_.counters().ledger_resets, 2u) << "and the first state of the session";
}

// What the monitor would reduce is not commanded at all.
TEST_F(MofcNodeGuards, CountsOnNoMoreThanTheMonitorDoes) {
  tick();
  clock_.advance(1ms);
  position_m_ = {0.05, 0, 0};
  monitor_energy_joule_ = 0.2e-3;
  tick();
  EXPECT_EQ(records_.ticks.back().ledger_energy_joule, 0.2e-3);
  clock_.advance(1ms);
  monitor_energy_joule_ = std::numeric_limits<double>::infinity();
  tick();
  EXPECT_GT(records_.ticks.back().ledger_energy_joule, 1e-3) << "its own count goes on";
}

// Two readings with equal stamps: no time has passed, so nothing is unknown.
TEST_F(MofcNodeGuards, TwoReadingsWithEqualStampsAreNoGap) {
  tick();
  clock_.advance(1ms);
  position_m_ = {0.05, 0, 0};
  tick();
  const double before_joule = records_.ticks.back().ledger_energy_joule;
  ASSERT_GT(before_joule, 1e-3);
  const std::uint64_t resets = node_.counters().ledger_resets;

  Received<DeviceState> again;
  again.value.header = {1, sequence_++, clock_.now()};
  again.value.hand_position_m = position_m_;
  (void)node_.answer(again);
  node_.finish_turn();
  EXPECT_EQ(records_.ticks.back().ledger_energy_joule, before_joule);

  // and the next echo continues it
  clock_.advance(1ms);
  tick();
  EXPECT_GE(records_.ticks.back().ledger_energy_joule, before_joule);
  EXPECT_EQ(node_.counters().ledger_resets, resets);
}

TEST_F(MofcNodeGuards, AnEmptyEchoWithALaterStampIsAGap) {
  tick();
  clock_.advance(1ms);
  position_m_ = {0.05, 0, 0};
  tick();
  ASSERT_GT(records_.ticks.back().ledger_energy_joule, 1e-3);

  clock_.advance(1ms);
  Received<DeviceState> empty;
  empty.value.header = {1, sequence_++, clock_.now()};
  empty.value.hand_position_m = position_m_;
  (void)node_.answer(empty);
  node_.finish_turn();

  EXPECT_EQ(records_.ticks.back().ledger_energy_joule, 0.0);
}

// from rest there is no energy to draw on: f_max = f_co = 0.1 N
TEST_F(MofcNodeGuards, ClampsToFrictionWhileTheLedgerIsEmpty) {
  tick();
  physics_sends({0, 0, 2});

  EXPECT_NEAR(tick().force_on_hand_newton.z(), 0.1, 1e-12);
  EXPECT_TRUE(records_.ticks.back().is_clamped);
  EXPECT_EQ(node_.counters().clamped_ticks, 1u);
}

// Nothing but friction bears a force while the account is below 0, which is told apart from an
// account that is empty.
TEST_F(MofcNodeGuards, AForceThatADebtHoldsToFrictionIsCounted) {
  tick();
  physics_sends({0, 0, 2});
  tick();
  EXPECT_EQ(node_.counters().clamped_ticks, 1u);
  EXPECT_EQ(node_.counters().debt_ticks, 0u);
  monitor_energy_joule_ = -1e-6;
  EXPECT_NEAR(tick().force_on_hand_newton.z(), 0.1, 1e-12);
  EXPECT_LT(records_.ticks.back().ledger_energy_joule, 0.0);
  EXPECT_EQ(node_.counters().debt_ticks, 1u);
  physics_sends({0, 0, 0.05});  // friction bears it all
  tick();
  EXPECT_EQ(node_.counters().debt_ticks, 1u);
}

/// 1 mm of free motion per state: each state reports the last `reported` of them.
DeviceState moving_state(std::uint64_t k, std::uint64_t reported) {
  const auto at = [](std::uint64_t i) { return TimePoint(static_cast<std::int64_t>(i) * 1ms); };
  const auto x = [](std::uint64_t i) { return Vector3(1e-3 * static_cast<double>(i), 0, 0); };
  DeviceState state;
  state.header = {1, k, at(k)};
  state.hand_position_m = x(k);
  for (std::uint64_t i = k - reported; i < k; ++i) {
    state.applied[state.applied_count++] = {Vector3::Zero(), at(i), at(i + 1), x(i + 1), true};
  }
  return state;
}

class MofcNodeEcho : public MofcNodeGuards {
 protected:
  double ledger_joule_after(std::initializer_list<std::pair<std::uint64_t, std::uint64_t>> states) {
    for (const auto& [k, reported] : states) {
      (void)node_.answer({.value = moving_state(k, reported)});
      node_.finish_turn();
    }
    return records_.ticks.back().ledger_energy_joule;
  }
};

// every state arrives: 5 mm
TEST_F(MofcNodeEcho, StatesThatWereLostAreBookedFromTheNextOne) {
  const double all_joule = ledger_joule_after({{0, 0}, {1, 1}, {2, 1}, {3, 1}, {4, 1}, {5, 1}});
  MofcNode other(clamping(), clamped_device(), clock_, motion_link_, interaction_in_, records_, 78);
  for (const auto& [k, reported] : {std::pair{0U, 0U}, {1U, 1U}, {5U, 4U}}) {
    (void)other.answer({.value = moving_state(k, reported), .skipped_before = k == 5 ? 3U : 0U});
    other.finish_turn();
  }

  EXPECT_EQ(records_.ticks.back().ledger_energy_joule, all_joule);
  EXPECT_EQ(other.counters().ledger_resets, 1u);  // of the session
}

// the answers were lost: the device reports again what is booked already
TEST_F(MofcNodeEcho, WhatWasReportedBeforeIsNotBookedTwice) {
  const double once_joule = ledger_joule_after({{0, 0}, {1, 1}, {2, 1}, {3, 1}});
  MofcNode other(clamping(), clamped_device(), clock_, motion_link_, interaction_in_, records_, 78);
  for (const auto& [k, reported] : {std::pair{0U, 0U}, {1U, 1U}, {2U, 2U}, {3U, 3U}}) {
    (void)other.answer({.value = moving_state(k, reported)});
    other.finish_turn();
  }

  EXPECT_EQ(records_.ticks.back().ledger_energy_joule, once_joule);
  EXPECT_EQ(other.counters().ledger_resets, 1u);
}

TEST_F(MofcNodeEcho, AnEchoThatBeginsTooLateIsAGap) {
  EXPECT_EQ(ledger_joule_after({{0, 0}, {1, 1}, {5, 3}}), 0.0);
  EXPECT_EQ(node_.counters().ledger_resets, 2u);
  // and the next one continues it
  EXPECT_GT(ledger_joule_after({{6, 1}}), 0.0);
  EXPECT_EQ(node_.counters().ledger_resets, 2u);
}

TEST_F(MofcNodeEcho, AClockThatGoesBackIsAGap) {
  (void)ledger_joule_after({{0, 0}, {1, 1}, {5, 4}});
  EXPECT_EQ(ledger_joule_after({{3, 3}}), 0.0);
  EXPECT_EQ(node_.counters().ledger_resets, 2u);
}

// --- interaction: local -------------------------------------------------------------------------

class MofcNodeLocal : public MofcNodeTest {
 protected:
  static MofcConfig local_config() {
    MofcConfig config = mofc_config();
    config.interaction = InteractionUse::kLocal;
    config.handover_newton_per_s = 1e6;  // at once: 1000 N in a tick of 1 ms
    return config;
  }
  explicit MofcNodeLocal(const MofcConfig& config = local_config()) : MofcNodeTest(config) {}

  // A floor at z = 0 of 400 N/m and 20 N·s/m, seen from `tool_m` at the present instant.
  void physics_sends_model(const Vector3& tool_m, double stiffness = 400.0) {
    Interaction interaction;
    interaction.header = {9, physics_sequence_++, clock_.now()};
    interaction.device_session_id = 1;
    interaction.device_sequence = sequence_;
    interaction.device_sampled_at = clock_.now();
    interaction.tool_position_world_m = tool_m;
    interaction.listed_count = 1;
    interaction.contacts[0] = {
        .penetration_m = -tool_m.z(),
        .elastic_force_on_tool_newton = Vector3(0, 0, -stiffness * tool_m.z()),
        .d_force_d_position = Vector3(0, 0, -stiffness).asDiagonal(),
        .d_force_d_velocity = Vector3(0, 0, -20.0).asDiagonal(),
        .trust_radius_m = 1.0};
    ASSERT_EQ(interaction_link_.send(interaction), SendResult::kSent);
  }

  // Two ticks under an honest physics: the first has no time in which the force could rise.
  ForceCommand touched_at(double z_m) {
    position_m_ = {0, 0, z_m};
    physics_sends_model(position_m_);
    tick();
    clock_.advance(1ms);
    physics_sends_model(position_m_);
    return tick();
  }
};

// Model from 3 mm above the floor, then 2 mm deep, 5 mm in 5 ms: 400·2 mm + 20·1 m/s.
TEST_F(MofcNodeLocal, RendersAContactThatBeginsBetweenTwoMessages) {
  EXPECT_EQ(touched_at(0.003).force_on_hand_newton, Vector3::Zero());
  EXPECT_EQ(records_.ticks.back().state, MofcState::kFree);

  clock_.advance(5ms);  // shorter than the silence that is too long
  position_m_ = {0, 0, -0.002};
  const ForceCommand command = tick();

  EXPECT_NEAR(command.force_on_hand_newton.z(), 0.8 + 20.0 * 1.0, 1e-9);
  EXPECT_EQ(records_.ticks.back().state, MofcState::kContact);
  EXPECT_TRUE(records_.ticks.back().is_in_contact);
}

TEST_F(MofcNodeLocal, RendersNothingAfterLeavingTheTissueBetweenTwoMessages) {
  EXPECT_NEAR(touched_at(-0.002).force_on_hand_newton.z(), 0.8, 1e-12);

  clock_.advance(1ms);
  position_m_ = {0, 0, 0.001};
  EXPECT_EQ(tick().force_on_hand_newton, Vector3::Zero());
  EXPECT_FALSE(records_.ticks.back().is_in_contact);
}

TEST_F(MofcNodeLocal, FadesAModelThatIsTooOldHoweverTheHandMoves) {
  touched_at(-0.002);
  clock_.advance(7ms);  // stale after 6
  const double declared = tick().force_on_hand_newton.norm();
  clock_.advance(10ms);
  position_m_ = {0, 0, -0.02};  // ten times the force by the model

  const double newton = tick().force_on_hand_newton.norm();

  EXPECT_GT(newton, 0.0);
  EXPECT_LT(newton, declared);
}

TEST_F(MofcNodeLocal, RequestsNoForceWhileClutchedAndStartsAgainFromTheNewModel) {
  position_m_ = {0, 0, -0.002};
  physics_sends_model(position_m_);
  is_clutched_ = true;
  EXPECT_EQ(tick().force_on_hand_newton, Vector3::Zero());
  EXPECT_EQ(records_.ticks.back().state, MofcState::kClutched);

  is_clutched_ = false;
  clock_.advance(1ms);
  EXPECT_NEAR(tick().force_on_hand_newton.z(), 0.8, 1e-12);
}

/// Twice the motion at the tool, half of its force at the hand.
class MofcNodeWaves : public MofcNodeTest {
 protected:
  static MofcConfig waves() {
    MofcConfig config = mofc_config();
    config.controller = ControllerKind::kWaveVariables;
    config.interaction = InteractionUse::kLocal;
    config.rivals.wave_variables.impedance_newton_s_per_m = 2.0;
    return config;
  }
  static ClampedDevice scaled_device() {
    ClampedDevice device = clamped_device();
    device.workspace.scale_ratio = 2.0;
    device.workspace.force_ratio = 0.5;
    return device;
  }
  MofcNodeWaves() : MofcNodeTest(waves(), scaled_device()) {}

  void physics_returns(std::uint64_t stream, double sum, std::uint64_t physics_session = 9) {
    Interaction interaction;
    interaction.header = {physics_session, physics_sequence_++, clock_.now()};
    interaction.device_session_id = 1;
    interaction.device_sequence = sequence_ - 1;
    interaction.device_sampled_at = clock_.now();
    interaction.wave = {
        .stream = stream, .sum = {0, 0, sum}, .energy_joule = 1.0, .impedance_newton_s_per_m = 2.0};
    ASSERT_EQ(interaction_link_.send(interaction), SendResult::kSent);
    clock_.advance(1ms);
  }
};

TEST_F(MofcNodeWaves, SendsTheWaveOfTheToolAndFeelsTheOneThatReturns) {
  tick();
  clock_.advance(1ms);
  position_m_ = {0, 0, -1e-3};
  EXPECT_EQ(tick().force_on_hand_newton, Vector3::Zero()) << "nothing has answered";
  const Wave sent = last_motion().wave;
  // at the hand √(2b) Δx = 2e-3 √W·s and its square / (2 T) = 2e-3 J; at the tool 4 times the
  // energy
  EXPECT_NEAR(sent.sum.z(), -4e-3, 1e-12);
  EXPECT_NEAR(sent.energy_joule, 8e-3, 1e-12);
  EXPECT_NEAR(sent.impedance_newton_s_per_m, 2.0, 1e-12);

  physics_returns(sent.stream, 4e-4);
  // 2e-4 √W·s at the hand: √(2b) w = 0.4 N, and it rests
  EXPECT_NEAR(tick().force_on_hand_newton.z(), 0.4, 1e-9);
  // the sums of another physics begin anew
  physics_returns(sent.stream, 2e-4, 10);
  EXPECT_NEAR(tick().force_on_hand_newton.z(), 0.2, 1e-9);
  // a wave of another stream is none
  physics_returns(sent.stream + 1, 9.0, 10);
  EXPECT_EQ(tick().force_on_hand_newton, Vector3::Zero());
}

TEST_F(MofcNodeWaves, AClutchBeginsANewStream) {
  tick();
  clock_.advance(1ms);
  tick();
  const Wave before = last_motion().wave;
  physics_returns(before.stream, 4e-4);
  is_clutched_ = true;
  EXPECT_EQ(tick().force_on_hand_newton, Vector3::Zero());
  EXPECT_FALSE(last_motion().wave.is_present());
  is_clutched_ = false;
  clock_.advance(1ms);
  position_m_ = {0, 0, 0.1};
  tick();
  clock_.advance(1ms);
  EXPECT_EQ(tick().force_on_hand_newton, Vector3::Zero()) << "what returned was of the old stream";
  const Wave after = last_motion().wave;
  EXPECT_NE(after.stream, before.stream);
  EXPECT_TRUE(after.sum.isZero(1e-12)) << "the way during the clutch is no motion of the tool";
}

class MofcNodeSlowHandover : public MofcNodeLocal {
 protected:
  static MofcConfig slow_config() {
    MofcConfig config = local_config();
    config.handover_newton_per_s = 100.0;
    return config;
  }
  MofcNodeSlowHandover() : MofcNodeLocal(slow_config()) {}
};

// The new model is 400 N/m stiffer, 2 mm deep: +0.8 N at 100 N/s takes 8 ticks of 1 ms.
TEST_F(MofcNodeSlowHandover, CrossesOverToAnotherModelAtTheConfiguredRate) {
  position_m_ = {0, 0, -0.002};
  for (int i = 0; i < 20; ++i) {  // 0.8 N from nothing takes 8 ticks too
    physics_sends_model(position_m_);
    tick();
    clock_.advance(1ms);
  }
  double before = 0.8;
  for (int i = 1; i <= 10; ++i) {
    physics_sends_model(position_m_, 800.0);
    const double newton = tick().force_on_hand_newton.z();
    EXPECT_NEAR(newton, std::min(1.6, 0.8 + 0.1 * i), 1e-9) << i;
    EXPECT_LE(newton - before, 0.1 + 1e-12);
    before = newton;
    clock_.advance(1ms);
  }
}

class MofcNodeInMode : public testing::TestWithParam<MofcMode> {};

// Free motion, contact, clamp, fade after silence, a gap, a force that ran out, a restarted physics
// and a restarted device.
TEST_P(MofcNodeInMode, AnswerAndFinishTurnDoNotAllocate) {
  ManualClock clock;
  MemoryLink<ToolMotion> motions(clock, 8);  // soon full: drops are part of it
  MemoryLink<Interaction> interactions(clock);
  Inbox<Interaction> interaction_in(interactions, clock);
  KeepAll records;
  records.ticks.reserve(2'000);
  MofcConfig config{.controller = ControllerKind::kMofc,
                    .mode = GetParam(),
                    .guard = {},
                    .stale_after = 6ms,
                    .fade = 50ms,
                    .velocity_estimator = KalmanVelocity{},
                    .motion_deadband = MotionDeadband{}};
  const ClampedDevice device{.lease = 2ms, .reply = 800us, .prompt = 500us};
  MofcNode node(config, device, clock, motions, interaction_in, records, 77);
  std::uint64_t allocations = 0;

  Received<DeviceState> state;
  Vector3 acting_newton = Vector3::Zero();
  for (std::uint64_t k = 0; k < 2'000; ++k) {
    clock.advance(1ms);
    DeviceState& s = state.value;
    s.header = {k < 1'500 ? 1U : 2U, k, clock.now()};
    s.hand_position_m = Vector3(0, 0, 0.005 * std::sin(0.02 * static_cast<double>(k)));
    s.tool_position_world_m = s.hand_position_m;
    s.is_clutched = k % 400 > 390;
    s.applied_count = k == 0 || k == 1'500 ? 0 : 2;
    s.applied[0] = {acting_newton, clock.now() - 1ms, clock.now() - 600us, s.hand_position_m,
                    k % 50 != 0};
    s.applied[1] = {0.5 * acting_newton, clock.now() - 600us, clock.now(), s.hand_position_m, true};
    if (k % 300 == 299) s.applied[0].from += 100us;  // a gap
    state.received_at = clock.now();
    const bool is_silent = k % 500 > 400;
    if (!is_silent) {
      Interaction interaction;
      interaction.header = {k < 1'000 ? 9U : 10U, k, clock.now()};
      interaction.device_session_id = s.header.session_id;
      interaction.device_sequence = k;
      interaction.device_sampled_at = clock.now();
      const double depth_m = std::max(0.0, -s.hand_position_m.z());
      interaction.force_on_tool_newton = Vector3(0, 0, 2'000.0 * depth_m);
      interaction.stored_energy_joule = 1'000.0 * depth_m * depth_m;
      interaction.contact_count = depth_m > 0.0 ? 1 : 0;
      interaction.tool_position_world_m = s.tool_position_world_m;
      interaction.listed_count = 1;
      interaction.contacts[0] = {
          .penetration_m = -s.hand_position_m.z(),
          .curvature_per_m = Vector3(20, 20, 0).asDiagonal(),
          .elastic_force_on_tool_newton = Vector3(0, 0, -2'000.0 * s.hand_position_m.z()),
          .d_force_d_position = Vector3(0, 0, -2'000.0).asDiagonal(),
          .trust_radius_m = 0.001};
      interactions.send(interaction);
    }

    const test::AllocGuard guard;
    const ForceCommand command = node.answer(state);
    node.finish_turn();
    node.read_ahead();
    allocations += guard.count();
    acting_newton = command.force_on_hand_newton;
  }

  EXPECT_EQ(allocations, 0u);
  const MofcCounters counters = node.counters();
  EXPECT_EQ(records.ticks.size(), 2'000u);
  EXPECT_GT(counters.contact_ticks, 0u);
  EXPECT_GT(counters.clamped_ticks, 0u);
  EXPECT_GT(counters.stale_ticks, 0u);
  EXPECT_GT(counters.ledger_resets, 2u);
  EXPECT_GT(counters.motions_dropped, 0u);
}

std::string name_of_mode(const testing::TestParamInfo<MofcMode>& info) {
  constexpr std::array kNames{"Paper", "Vector", "Guard"};
  return kNames.at(info.index);
}
INSTANTIATE_TEST_SUITE_P(Modes, MofcNodeInMode,
                         testing::Values(MofcMode::kPaper, MofcMode::kVector, MofcMode::kGuard),
                         name_of_mode);

TEST(MofcNodeWithStandby, TheStandbySpeaksBeforeTheForceFadesWithoutAllocation) {
  ManualClock clock;
  MemoryLink<ToolMotion> motions(clock, 8);
  MemoryLink<ToolMotion> standby_motions(clock, 8);
  MemoryLink<Interaction> interactions(clock);
  MemoryLink<Interaction> standby_interactions(clock);
  Inbox<Interaction> first_in(interactions, clock);
  Inbox<Interaction> standby_in(standby_interactions, clock);
  KeepAll records;
  records.ticks.reserve(400);
  MofcConfig config;
  config.stale_after = 150ms;
  config.standby_after = 75ms;
  config.fade = 50ms;
  const ClampedDevice device{.lease = 2ms};
  MofcNode node(config, device, clock, motions, first_in, records, 77,
                StandbyLinks{standby_motions, standby_in});
  std::uint64_t allocations = 0;
  Received<DeviceState> state;
  for (std::uint64_t k = 0; k < 400; ++k) {
    clock.advance(1ms);
    if (k > 0) {
      Interaction answer;
      answer.device_session_id = 1;
      answer.device_sequence = k - 1;
      answer.device_sampled_at = clock.now() - 1ms;
      answer.header = {9, k, clock.now()};
      if (k < 200) interactions.send(answer);  // then it is silent
      answer.header.session_id = 10;
      standby_interactions.send(answer);
      if (k % 2 == 0) node.read_ahead();
    }
    state.value.header = {1, k, clock.now()};
    state.received_at = clock.now();
    const test::AllocGuard guard;
    static_cast<void>(node.answer(state));
    node.finish_turn();
    allocations += guard.count();
  }
  EXPECT_EQ(allocations, 0u);
  EXPECT_EQ(node.counters().physics_term, 1u);
  EXPECT_EQ(node.counters().physics_switches, 1u);
  EXPECT_EQ(node.counters().stale_ticks, 0u);
  EXPECT_FALSE(records.ticks[200].is_from_standby);
  EXPECT_TRUE(records.ticks[280].is_from_standby);
  ToolMotion motion;
  TimePoint at;
  while (standby_motions.receive(motion, at)) {
  }
  EXPECT_EQ(motion.header.session_id, 77u);
}

// what a rogue describes costs each tick no more than its budget; the honest standby speaks
TEST(MofcNodeWithStandby, TheStandbySpeaksForAPhysicsThatCostsTooMuch) {
  ManualClock clock;
  MemoryLink<ToolMotion> motions(clock, 512);
  MemoryLink<ToolMotion> standby_motions(clock, 8);
  MemoryLink<Interaction> interactions(clock, 2048);
  MemoryLink<Interaction> standby_interactions(clock);
  Inbox<Interaction> first_in(interactions, clock);
  Inbox<Interaction> standby_in(standby_interactions, clock);
  KeepAll records;
  MofcConfig config;
  config.stale_after = 150ms;
  config.standby_after = 75ms;
  config.fade = 50ms;
  const ClampedDevice device{.lease = 2ms};
  MofcNode node(config, device, clock, motions, first_in, records, 77,
                StandbyLinks{standby_motions, standby_in});
  Random random(3);
  const test::CostlyPhysics rogue =
      test::costly_physics({.tiles = kTileSlots / kMaxDescribed}, 77, random);
  Received<DeviceState> state;
  std::uint64_t sent = 0;
  for (std::uint64_t k = 0; k < 300; ++k) {
    clock.advance(1ms);
    const auto send = [&](Interaction answer, std::uint64_t session, auto& to) {
      answer.device_session_id = 1;
      answer.device_sequence = k - 1;
      answer.device_sampled_at = clock.now() - 1ms;
      answer.header = {session, sent++, clock.now()};
      ASSERT_EQ(to.send(answer), SendResult::kSent);
    };
    if (k == 20) {
      for (const Interaction& message : rogue.messages) send(message, 9, interactions);
    }
    if (k > 0) {
      send(rogue.last, 9, interactions);
      send({}, 10, standby_interactions);
    }
    state.value.header = {1, k, clock.now()};
    state.received_at = clock.now();
    static_cast<void>(node.answer(state));
    node.finish_turn();
  }
  EXPECT_FALSE(records.ticks[20].is_from_standby);
  EXPECT_FALSE(records.ticks[60].is_from_standby);
  EXPECT_TRUE(records.ticks[100].is_from_standby);
  EXPECT_TRUE(records.ticks[299].is_from_standby);
  EXPECT_EQ(node.counters().physics_switches, 1u);
  // it is not offered a store any more
  ToolMotion motion;
  TimePoint at;
  while (motions.receive(motion, at)) {
  }
  EXPECT_EQ(motion.receipts.store_id, 0u);
}

// silent for longer than its force takes to fade: what it has described is forgotten
TEST_F(MofcNodeTest, DropsWhatAPhysicsThatIsGoneHasDescribed) {
  MofcConfig config = mofc_config();
  config.interaction = InteractionUse::kLocal;
  config.still_after = 20ms;
  MofcNode node(config, clamped_device(), clock_, motion_link_, interaction_in_, records_, 77);
  const auto run = [&](int ticks, bool has_physics) {
    for (int i = 0; i < ticks; ++i) {
      clock_.advance(1ms);
      if (has_physics && sequence_ > 0) {
        Interaction answer;
        answer.header = {9, physics_sequence_++, clock_.now()};
        answer.device_session_id = 1;
        answer.device_sequence = sequence_ - 1;
        answer.device_sampled_at = clock_.now() - 1ms;
        answer.surface.store_id = 77;
        answer.surface.number = physics_sequence_;
        answer.surface.has_description = true;
        answer.surface.description.version = 1;
        interaction_link_.send(answer);
      }
      Received<DeviceState> state;
      state.value.header = {1, sequence_++, clock_.now()};
      state.received_at = clock_.now();
      static_cast<void>(node.answer(state));
      node.finish_turn();
    }
  };
  run(20, true);
  EXPECT_EQ(last_motion().receipts.store_id, 77u);
  run(60, false);  // 20 ms and the fade
  EXPECT_EQ(last_motion().receipts.store_id, 77u);
  run(20, false);
  const ToolMotion motion = last_motion();
  EXPECT_EQ(motion.receipts.store_id, 78u);
  EXPECT_EQ(motion.receipts.newest, 0u);
}

/// The bound of a controller without any energy, per axis.
Vector3 f_max_at_first_newton(const MofcConfig& mofc, const ClampedDevice& device) {
  return make_controller(mofc, device)
      ->step({.hand_position_m = Vector3::Zero(),
              .applied = {},
              .requested_force_on_hand_newton = Vector3(9, 9, 9)})
      .f_max_newton;
}

// With an empty pool what is left is the Coulomb friction that the mode counts.
TEST(MakeController, EveryModeUsesTheFrictionOfTheProfile) {
  ClampedDevice device{.lease = 2ms};
  device.profile.coulomb_newton = 0.3;
  for (const MofcMode mode : {MofcMode::kPaper, MofcMode::kVector, MofcMode::kGuard}) {
    EXPECT_EQ(f_max_at_first_newton({.mode = mode, .guard = {}}, device), Vector3::Constant(0.3));
  }
  MofcConfig isotropic{.mode = MofcMode::kPaper, .guard = {}};
  isotropic.paper_friction = PaperFriction::kIsotropic;
  EXPECT_NEAR(f_max_at_first_newton(isotropic, device).y(), 0.3 / std::sqrt(3.0), 1e-15);

  const Vector3 per_axis(0.1, 0.2, 0.4);
  device.profile.per_axis = FrictionPerAxis{Vector3::Constant(0.1), per_axis};
  for (const MofcMode mode : {MofcMode::kPaper, MofcMode::kVector, MofcMode::kGuard}) {
    EXPECT_EQ(f_max_at_first_newton({.mode = mode, .guard = {}}, device), per_axis);
  }
}

// 10 mm in a wall of 100 N/m, in the local model of the last Interaction.
struct ProbedWall {
  ProbedWall() {
    interaction.tool_position_world_m = {0.02, 0, -0.01};
    interaction.listed_count = interaction.contact_count = 1;
    interaction.contacts[0] = {.penetration_m = 0.01,
                               .elastic_force_on_tool_newton = Vector3(0, 0, 1),
                               .d_force_d_position = Vector3(0, 0, -100).asDiagonal(),
                               .stored_energy_joule = 0.5 * 100 * 1e-4,
                               .trust_radius_m = 1.0,
                               .force_on_tool_newton = Vector3(0, 0, 1)};
    // the tool moves twice as far as the hand, which gets half the force
    state.hand_position_m = {0.001, 0, 0};
    state.tool_position_world_m = {0.03, 0, -0.01};
    workspace.scale_ratio = 2.0;
    workspace.force_ratio = 0.5;
  }
  Interaction interaction;
  DeviceState state;
  WorkspaceConfig workspace;
};

TEST(ModelProbe, AsksTheContactModelWhereTheHandIsNot) {
  ProbedWall wall;
  const ModelProbe probe(&wall.interaction, wall.state, wall.state.tool_position_world_m,
                         wall.workspace);

  const auto here = probe.at(wall.state.hand_position_m, Vector3::Zero());
  EXPECT_NEAR(here.force_on_hand_newton.z(), 0.5, 1e-12);
  EXPECT_NEAR(here.stored_energy_joule, 5e-3 * 0.5 / 2.0, 1e-12);
  // 1 mm deeper with the hand, 2 mm with the tool
  const auto deeper = probe.at({0.001, 0, -0.001}, Vector3::Zero());
  EXPECT_NEAR(deeper.force_on_hand_newton.z(), 0.6, 1e-12);
  EXPECT_EQ(probe.surface_normal(), Vector3::UnitZ());
  // physics_node had the tool 10 mm beside, the hand 5 mm
  EXPECT_NEAR((probe.evaluated_at_m() - Vector3(-0.004, 0, 0)).norm(), 0.0, 1e-12);
}

TEST(ModelProbe, WithoutTissueOrWithTheClutchHeldThereIsNoForce) {
  ProbedWall wall;
  const ModelProbe none(nullptr, wall.state, Vector3::Zero(), wall.workspace);
  EXPECT_EQ(none.at(Vector3::Zero(), Vector3::Zero()).force_on_hand_newton, Vector3::Zero());
  EXPECT_EQ(none.surface_normal(), Vector3::Zero());
  EXPECT_EQ(none.evaluated_at_m(), wall.state.hand_position_m);
  wall.state.is_clutched = true;
  const ModelProbe clutched(&wall.interaction, wall.state, wall.state.tool_position_world_m,
                            wall.workspace);
  EXPECT_EQ(clutched.at(wall.state.hand_position_m, Vector3::Zero()).force_on_hand_newton,
            Vector3::Zero());
}

// At rest in tissue that requests 9 N: what each controller of others answers at first.
TEST(MakeController, EveryControllerOfOthersIsMadeWithItsSettings) {
  const ClampedDevice device{.lease = 2ms};
  const auto first = [&](MofcConfig config, ControllerKind kind, bool has_net = false) {
    config.controller = kind;
    config.has_safety_net = has_net;
    return make_controller(config, device)
        ->step({.hand_position_m = Vector3::Zero(),
                .applied = {},
                .requested_force_on_hand_newton = Vector3(0, 0, 9)});
  };
  const MofcConfig plain;
  // no friction is credited yet
  EXPECT_EQ(first(plain, ControllerKind::kEnergyBounding).force_on_hand_newton.z(), 0.0);
  EXPECT_EQ(first(plain, ControllerKind::kForceBounding).force_on_hand_newton.z(), 0.0);
  // there is no channel
  EXPECT_EQ(first(plain, ControllerKind::kWaveVariables).force_on_hand_newton.z(), 0.0);
  // these have nothing against a first force
  for (const ControllerKind kind :
       {ControllerKind::kPassivityControl, ControllerKind::kMemoryBased,
        ControllerKind::kInputToState, ControllerKind::kTwoPort, ControllerKind::kEnergyTank,
        ControllerKind::kVirtualCoupling, ControllerKind::kLyapunov}) {
    EXPECT_EQ(first(plain, kind).force_on_hand_newton.z(), 9.0);
    EXPECT_NEAR(first(plain, kind, true).force_on_hand_newton.z(), 0.1, 1e-12);
  }
  EXPECT_EQ(first(plain, ControllerKind::kEnergyTank).ledger_energy_joule, 0.02);
  MofcConfig less;
  less.rivals.force_bounding.is_more_conservative = false;
  EXPECT_EQ(first(less, ControllerKind::kForceBounding).ledger_energy_joule, 0.0);
}

TEST(MakeController, ControllersOfOthersAreLoadedOnlyWhereASessionNamesOne) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");  // a process that has loaded nothing yet
  const auto has_loaded_them = [] {
    std::ifstream maps("/proc/self/maps");
    const std::string all{std::istreambuf_iterator<char>(maps), {}};
    return all.find("palpate_rivals.so") != std::string::npos;
  };
  EXPECT_EXIT(
      {
        const ClampedDevice device{.lease = 2ms};
        MofcConfig config;
        for (const MofcMode mode : {MofcMode::kPaper, MofcMode::kVector, MofcMode::kGuard}) {
          config.mode = mode;
          static_cast<void>(make_controller(config, device));
        }
        config.controller = ControllerKind::kNone;
        static_cast<void>(make_controller(config, device));
        const bool has_before = has_loaded_them();
        config.controller = ControllerKind::kTwoPort;
        static_cast<void>(make_controller(config, device));
        std::_Exit(!has_before && has_loaded_them() ? 0 : 1);
      },
      testing::ExitedWithCode(0), "");
}

static_assert(
    noexcept(std::declval<MofcNode&>().answer(std::declval<const Received<DeviceState>&>())));
static_assert(noexcept(std::declval<MofcNode&>().finish_turn()));

}  // namespace
}  // namespace palpate::mofc
