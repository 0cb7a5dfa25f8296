// SPDX-License-Identifier: Apache-2.0
#include "device_node/force_guard.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <limits>

#include "tests/support/guarded_motors.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;
using test::GuardedMotors;

constexpr double kDevicePeak_newton = 3.3;
const TimePoint kStart = time_at(100.0);

/// 1 kHz, leases of 2 ms, fallback for 20 ms, fade of 50 ms, f_co = 0.1 N.
DeviceConfig config() {
  DeviceConfig c;
  c.lease = 2ms;
  c.limp_after = 20ms;
  c.fade = 50ms;
  return c;
}

ForceCommand command(const Vector3& force_newton, Duration valid_for = 2ms) {
  ForceCommand command;
  command.force_on_hand_newton = force_newton;
  command.valid_for = valid_for;
  return command;
}

/// The next reading comes at once.
GuardedForce missed(GuardedMotors& guard, TimePoint now) { return guard.missed(now, now); }

TEST(LatestBeginning, IsTheAnswersOwnButNotAfterTheTicks) {
  ForceCommand answer = command(Vector3::UnitX());
  EXPECT_EQ(latest_beginning(answer, kStart, kStart + 800us), kStart + 800us);
  answer.begins_within = 1ns;
  EXPECT_EQ(latest_beginning(answer, kStart, kStart + 800us), kStart + 1ns);
  answer.begins_within = 700us;
  EXPECT_EQ(latest_beginning(answer, kStart, kStart + 800us), kStart + 700us);
  answer.begins_within = 900us;
  EXPECT_EQ(latest_beginning(answer, kStart, kStart + 800us), kStart + 800us);
}

TEST(ForceGuard, GivesNoForceBeforeTheFirstAnswer) {
  GuardedMotors guard(config(), kDevicePeak_newton);

  const GuardedForce out = missed(guard, kStart);

  EXPECT_EQ(out.state, GuardState::kLimp);
  EXPECT_EQ(out.force_on_hand_newton.norm(), 0.0);
}

// Motors that nobody ends hold a force until the next message, whatever lease a command names.
TEST(ForceGuard, GivesNoLeaseThatEndsBeforeTheNextMessageWhereNobodyEndsIt) {
  DeviceConfig longer = config();
  longer.longest_lease = 10ms;
  ForceGuard guard(longer, kDevicePeak_newton, false);

  EXPECT_EQ(guard.answered(command(Vector3(1, 0, 0), 100us), kStart, Vector3::Zero()).lease,
            Duration(2ms));
  EXPECT_EQ(guard.answered(command(Vector3(1, 0, 0), 5ms), kStart, Vector3::Zero()).lease,
            Duration(5ms));
  EXPECT_EQ(
      guard.answered(command(Vector3(1, 0, 0), 0us), kStart, Vector3::Zero()).force_on_hand_newton,
      Vector3(0, 0, 0));
}

TEST(ForceGuard, PassesAnAnswerOnWithItsLease) {
  GuardedMotors guard(config(), kDevicePeak_newton);

  const GuardedForce out = guard.answered(command(Vector3(1, -2, 0.5), 1500us), kStart);

  EXPECT_EQ(out.state, GuardState::kAnswered);
  EXPECT_EQ(out.force_on_hand_newton, Vector3(1, -2, 0.5));
  EXPECT_EQ(out.lease, Duration(1500us));
  EXPECT_FALSE(out.is_limited);
  EXPECT_TRUE(out.is_switch);
}

TEST(ForceGuard, LimitsALeaseToTheSessionsLongest) {
  DeviceConfig c = config();
  c.longest_lease = 10ms;
  GuardedMotors guard(c, kDevicePeak_newton);

  EXPECT_EQ(guard.answered(command(Vector3(1, 0, 0), 1h), kStart).lease, Duration(10ms));
}

TEST(ForceGuard, ACommandWithoutALeaseGivesNoForce) {
  GuardedMotors guard(config(), kDevicePeak_newton);

  const GuardedForce out = guard.answered(command(Vector3(1, 0, 0), Duration(-5)), kStart);

  EXPECT_EQ(out.force_on_hand_newton.norm(), 0.0);
  EXPECT_EQ(out.lease, Duration(0));
}

TEST(ForceGuard, DoesNotWriteToTheMotorsWhileTheLeaseRuns) {
  GuardedMotors guard(config(), kDevicePeak_newton);
  (void)guard.answered(command(Vector3(1, 0, 0)), kStart);

  const GuardedForce out = missed(guard, kStart + 2ms - 1ns);

  EXPECT_EQ(out.state, GuardState::kLeased);
  EXPECT_EQ(out.force_on_hand_newton, Vector3(1, 0, 0));
  EXPECT_FALSE(out.is_switch);
}

// Lease until 2 ms: a reading at 2 ms still sees its force end, one at 2.1 ms would not.
TEST(ForceGuard, GivesUpALeaseThatWouldEndBeforeTheNextReading) {
  GuardedMotors guard(config(), kDevicePeak_newton);
  (void)guard.answered(command(Vector3(1, 0, 0)), kStart);

  EXPECT_EQ(guard.missed(kStart + 1500us, kStart + 2ms).state, GuardState::kLeased);
  const GuardedForce out = guard.missed(kStart + 1500us, kStart + 2100us);
  EXPECT_EQ(out.state, GuardState::kFallback);
  EXPECT_TRUE(out.is_switch);
  // and it stays given up
  EXPECT_EQ(guard.missed(kStart + 1600us, kStart + 1900us).state, GuardState::kFallback);
}

// f_co = 0.1 N of the profile, along (3, 4, 0)/5.
TEST(ForceGuard, FallsBackToCoulombFrictionInTheCommandsDirection) {
  GuardedMotors guard(config(), kDevicePeak_newton);
  (void)guard.answered(command(Vector3(1.5, 2, 0)), kStart);

  for (const Duration t : {Duration(2ms), Duration(3ms), Duration(20ms - 1ns)}) {
    const GuardedForce out = missed(guard, kStart + t);
    EXPECT_EQ(out.state, GuardState::kFallback);
    EXPECT_LT((out.force_on_hand_newton - Vector3(0.06, 0.08, 0)).norm(), 1e-15);
    EXPECT_EQ(out.lease, Duration(2ms));  // two periods
    EXPECT_TRUE(out.is_switch);
  }
}

TEST(ForceGuard, AFallbackIsNeverLargerThanTheCommand) {
  GuardedMotors guard(config(), kDevicePeak_newton);
  (void)guard.answered(command(Vector3(0.02, 0, 0)), kStart);

  EXPECT_EQ(missed(guard, kStart + 5ms).force_on_hand_newton, Vector3(0.02, 0, 0));
}

// Silent for 20 + 30 ms of the 50 ms fade: 0.1·(1 − 3/5) = 0.04 N.
TEST(ForceGuard, FadesToZeroAfterSilence) {
  GuardedMotors guard(config(), kDevicePeak_newton);
  (void)guard.answered(command(Vector3(1, 0, 0)), kStart);

  EXPECT_EQ(missed(guard, kStart + 20ms).state, GuardState::kFading);
  EXPECT_NEAR(missed(guard, kStart + 20ms).force_on_hand_newton.x(), 0.1, 1e-15);
  EXPECT_NEAR(missed(guard, kStart + 50ms).force_on_hand_newton.x(), 0.04, 1e-15);
  EXPECT_EQ(missed(guard, kStart + 70ms).state, GuardState::kLimp);
  EXPECT_EQ(missed(guard, kStart + 70ms).force_on_hand_newton.norm(), 0.0);
}

TEST(ForceGuard, AnAnswerEndsTheFallback) {
  GuardedMotors guard(config(), kDevicePeak_newton);
  (void)guard.answered(command(Vector3(1, 0, 0)), kStart);
  (void)missed(guard, kStart + 10ms);

  const GuardedForce out = guard.answered(command(Vector3(2, 0, 0)), kStart + 11ms);

  EXPECT_EQ(out.force_on_hand_newton, Vector3(2, 0, 0));
}

/// 2 N along x, answered every millisecond from `at` up to `until`: the force after the limits.
double x_answered_until(GuardedMotors& guard, Duration& at, Duration until) {
  for (; at < until; at += 1ms) (void)guard.answered(command(Vector3(2, 0, 0)), kStart + at);
  return guard.answered(command(Vector3(2, 0, 0)), kStart + until).force_on_hand_newton.x();
}

// Ramp of 100 ms: nothing at first, 30 % after 30 ms, all after 100 ms.
TEST(ForceGuard, ALimpStartGrowsFromZero) {
  DeviceConfig c = config();
  c.start_ramp = 100ms;
  GuardedMotors guard(c, kDevicePeak_newton);
  Duration at = 0ms;

  EXPECT_EQ(x_answered_until(guard, at, 0ms), 0.0);
  EXPECT_NEAR(x_answered_until(guard, at, 30ms), 0.6, 1e-12);
  EXPECT_NEAR(x_answered_until(guard, at, 80ms), 1.6, 1e-12);
  EXPECT_EQ(x_answered_until(guard, at, 100ms), 2.0);
}

TEST(ForceGuard, LeavingLimpAgainIsALimpStart) {
  DeviceConfig c = config();
  c.start_ramp = 10ms;
  GuardedMotors guard(c, kDevicePeak_newton);
  Duration at = 0ms;
  EXPECT_EQ(x_answered_until(guard, at, 10ms), 2.0);

  at = 10ms + 70ms;  // limp_after + fade of silence: limp, even if nobody looked
  EXPECT_EQ(x_answered_until(guard, at, at), 0.0);
  EXPECT_EQ(x_answered_until(guard, at, at + 10ms), 2.0);
  guard.reset();
  EXPECT_EQ(x_answered_until(guard, at, at), 0.0);
}

// 20 ms without an answer, lease 2 ms: nothing acts for 18 ms, and the force grows over 18 ms.
TEST(ForceGuard, AfterAShortSilenceTheForceGrowsOverTheTimeForWhichItWasGone) {
  DeviceConfig c = config();
  c.start_ramp = 100ms;
  GuardedMotors guard(c, kDevicePeak_newton);
  Duration at = 0ms;
  EXPECT_EQ(x_answered_until(guard, at, 120ms), 2.0);

  at = 140ms;
  EXPECT_EQ(x_answered_until(guard, at, 140ms), 0.0);
  EXPECT_NEAR(x_answered_until(guard, at, 149ms), 1.0, 1e-12);
  EXPECT_EQ(x_answered_until(guard, at, 158ms), 2.0);
}

// A lease of 10 ms that ended a period ago: the force is back at once. 1 ns later: over that ms.
TEST(ForceGuard, AHoleUpToAPeriodLongerThanItsLeaseNeedsNoRamp) {
  for (const Duration late : {Duration(0), Duration(1)}) {
    DeviceConfig c = config();
    c.start_ramp = 100ms;
    c.longest_lease = 10ms;
    GuardedMotors guard(c, kDevicePeak_newton);
    Duration at = 0ms;
    EXPECT_EQ(x_answered_until(guard, at, 120ms), 2.0);
    (void)guard.answered(command(Vector3(2, 0, 0), 10ms), kStart + 120ms);

    const GuardedForce out = guard.answered(command(Vector3(2, 0, 0)), kStart + 131ms + late);
    EXPECT_EQ(out.force_on_hand_newton.x(), late == Duration(0) ? 2.0 : 0.0);
  }
}

TEST(ForceGuard, TheSmallerPeakHoldsAndTheDirectionIsKept) {
  DeviceConfig c = config();
  c.peak_force_newton = 5.0;
  GuardedMotors by_device(c, kDevicePeak_newton);
  c.peak_force_newton = 2.0;
  GuardedMotors by_session(c, kDevicePeak_newton);

  const GuardedForce a = by_device.answered(command(Vector3(30, 0, -40)), kStart);
  const GuardedForce b = by_session.answered(command(Vector3(30, 0, -40)), kStart);

  EXPECT_LT((a.force_on_hand_newton - Vector3(1.98, 0, -2.64)).norm(), 1e-12);
  EXPECT_LT((b.force_on_hand_newton - Vector3(1.2, 0, -1.6)).norm(), 1e-12);
  EXPECT_TRUE(a.is_limited);
}

/// 100 N/s: 0.1 N more per period of 1 ms.
DeviceConfig slewing() {
  DeviceConfig c = config();
  c.slew_newton_per_s = 100.0;
  return c;
}

TEST(ForceGuard, GrowthIsLimitedAndDecreaseIsNot) {
  GuardedMotors guard(slewing(), kDevicePeak_newton);
  const auto x_after = [&](Duration t, double newton) {
    return guard.answered(command(Vector3(newton, 0, 0)), kStart + t).force_on_hand_newton.x();
  };

  EXPECT_NEAR(x_after(0ms, 1.0), 0.1, 1e-15);
  EXPECT_NEAR(x_after(1ms, 1.0), 0.2, 1e-15);
  EXPECT_NEAR(x_after(1500us, 1.0), 0.25, 1e-15);
  EXPECT_EQ(x_after(2500us, 0.03), 0.03);
}

// +1 N acting gives nothing along −x: the turned force starts from zero. Sideways likewise.
TEST(ForceGuard, ATurnedForceGrowsFromWhatAlreadyActsAlongIt) {
  GuardedMotors guard(slewing(), kDevicePeak_newton);
  for (int i = 0; i < 10; ++i) {
    (void)guard.answered(command(Vector3(1, 0, 0)), kStart + i * 1ms);
  }

  const GuardedForce turned = guard.answered(command(Vector3(-1, 0, 0)), kStart + 10ms);

  EXPECT_NEAR(turned.force_on_hand_newton.x(), -0.1, 1e-15);
  EXPECT_TRUE(turned.is_limited);
}

TEST(ForceGuard, AfterItsLeaseAForceGrowsFromZero) {
  GuardedMotors guard(slewing(), kDevicePeak_newton);
  for (int i = 0; i < 10; ++i) {
    (void)guard.answered(command(Vector3(1, 0, 0)), kStart + i * 1ms);
  }

  const GuardedForce after_gap = guard.answered(command(Vector3(1, 0, 0)), kStart + 12ms);

  EXPECT_NEAR(after_gap.force_on_hand_newton.x(), 0.1, 1e-15);
}

// The lease ends while the answer is awaited, which then comes at once: it may grow by a period.
TEST(ForceGuard, AFallbackOnTheWayDoesNotHoldTheGrowthBack) {
  GuardedMotors guard(slewing(), kDevicePeak_newton);
  (void)guard.answered(command(Vector3(1, 0, 0)), kStart);
  (void)guard.missed(kStart + 1ms, kStart + 2ms);

  const GuardedForce after = guard.answered(command(Vector3(1, 0, 0)), kStart + 1ms);

  EXPECT_NEAR(after.force_on_hand_newton.x(), 0.2, 1e-15);
}

TEST(ForceGuard, ANonFiniteCommandGivesNoForceAndIsCounted) {
  GuardedMotors guard(config(), kDevicePeak_newton);
  const double inf = std::numeric_limits<double>::infinity();

  EXPECT_EQ(guard.answered(command(Vector3(0, kNaN, 0)), kStart).force_on_hand_newton.norm(), 0.0);
  EXPECT_EQ(guard.answered(command(Vector3(inf, 0, 0)), kStart).force_on_hand_newton.norm(), 0.0);
  EXPECT_EQ(guard.non_finite_commands(), 2u);
}

// Silence of limp_after + fade = 70 ms, to the nanosecond: a limp start over all of start_ramp. One
// less: the force was gone for 68 ms only, since its lease of 2 ms ended.
TEST(ForceGuard, ALimpStartBeginsExactlyWhereTheFadeEnds) {
  for (const Duration early : {Duration(0), Duration(1)}) {
    DeviceConfig c = config();
    c.start_ramp = 100ms;
    GuardedMotors guard(c, kDevicePeak_newton);
    Duration at = 0ms;
    EXPECT_EQ(x_answered_until(guard, at, 120ms), 2.0);

    at = 120ms + 70ms - early;
    EXPECT_EQ(x_answered_until(guard, at, at), 0.0);
    EXPECT_NEAR(x_answered_until(guard, at, at + 34ms), early == Duration(0) ? 0.68 : 1.0, 1e-6);
  }
}

// An answer that acts for ½ ms only: the next one, a lease and a period later, needs no ramp.
TEST(ForceGuard, AShortLeaseIsNoSilence) {
  DeviceConfig c = config();
  c.start_ramp = 100ms;
  GuardedMotors guard(c, kDevicePeak_newton);
  Duration at = 0ms;
  EXPECT_EQ(x_answered_until(guard, at, 120ms), 2.0);
  (void)guard.answered(command(Vector3(2, 0, 0), 500us), kStart + 121ms);

  EXPECT_EQ(guard.answered(command(Vector3(2, 0, 0)), kStart + 124ms).force_on_hand_newton.x(),
            2.0);
}

// Silence from 120 ms, the lease over at 122; fallback of 0.1 N each ms, at last at 125 ms for 2
// ms. The answer at 126 ms starts from it, at 127 ms nothing acts any more; then over the 4 or 5 ms
// since 122.
TEST(ForceGuard, AfterAFallbackTheForceGrowsFromTheFallback) {
  for (const int ms : {126, 127}) {
    DeviceConfig c = config();
    c.start_ramp = 100ms;
    GuardedMotors guard(c, kDevicePeak_newton);
    Duration at = 0ms;
    EXPECT_EQ(x_answered_until(guard, at, 120ms), 2.0);
    for (int late = 122; late <= 125; ++late) (void)missed(guard, kStart + late * 1ms);

    const TimePoint now = kStart + ms * 1ms;
    const auto x_at = [&](TimePoint t) {
      return guard.answered(command(Vector3(2, 0, 0)), t).force_on_hand_newton.x();
    };
    EXPECT_NEAR(x_at(now), ms == 126 ? 0.1 : 0.0, 1e-12);
    EXPECT_NEAR(x_at(now + 2ms), 2.0 * 2.0 / (ms - 122), 1e-9);
  }
}

// 0.1 N in a period of 1 ms; at the very end of the lease nothing acts any more.
TEST(ForceGuard, AtTheEndOfItsLeaseAForceGrowsFromZero) {
  GuardedMotors guard(slewing(), kDevicePeak_newton);
  (void)guard.answered(command(Vector3(1, 0, 0)), kStart);
  (void)guard.answered(command(Vector3(1, 0, 0)), kStart + 1ms);

  EXPECT_NEAR(guard.answered(command(Vector3(1, 0, 0)), kStart + 3ms).force_on_hand_newton.x(), 0.1,
              1e-15);
}

TEST(ForceGuard, ASlewLimitBelowOneNewtonPerSecondHoldsToo) {
  DeviceConfig c = slewing();
  c.slew_newton_per_s = 0.5;
  GuardedMotors guard(c, kDevicePeak_newton);
  (void)guard.answered(command(Vector3::Zero()), kStart);

  const GuardedForce out = guard.answered(command(Vector3(1, 0, 0)), kStart + 1ms);
  EXPECT_NEAR(out.force_on_hand_newton.x(), 0.5e-3, 1e-15);
  EXPECT_TRUE(out.is_limited);
}

TEST(ForceGuard, AForceOfExactlyThePeakIsNotLimited) {
  GuardedMotors guard(config(), kDevicePeak_newton);
  EXPECT_FALSE(guard.answered(command(Vector3(0, kDevicePeak_newton, 0)), kStart).is_limited);
  EXPECT_TRUE(guard.answered(command(Vector3(0, 3.4, 0)), kStart).is_limited);
  EXPECT_FALSE(missed(guard, kStart + 1s).is_limited);
}

TEST(ForceGuard, ACommandWithoutALeaseIsNotCountedAsNotFinite) {
  GuardedMotors guard(config(), kDevicePeak_newton);
  (void)guard.answered(command(Vector3(1, 0, 0), Duration(0)), kStart);
  EXPECT_EQ(guard.non_finite_commands(), 0u);
}

TEST(ForceGuard, AfterAResetTheLeaseOfTheLastAnswerIsOver) {
  GuardedMotors guard(config(), kDevicePeak_newton);
  (void)guard.answered(command(Vector3(1, 0, 0)), kStart);
  guard.reset();

  const GuardedForce out = missed(guard, kStart + 1ms);
  EXPECT_EQ(out.state, GuardState::kLimp);
  EXPECT_EQ(out.force_on_hand_newton.norm(), 0.0);
}

// The motors were released at once: the next force grows from zero, though the lease of the one
// that was withdrawn would still run.
TEST(ForceGuard, AWithdrawnAnswerDoesNotAct) {
  for (const bool is_missed : {false, true}) {
    GuardedMotors guard(slewing(), kDevicePeak_newton);
    for (int i = 0; i < 10; ++i) {
      (void)guard.answered(command(Vector3(1, 0, 0)), kStart + i * 1ms);
    }
    guard.withdraw_answer();

    if (is_missed) {
      const GuardedForce out = missed(guard, kStart + 9ms + 500us);
      EXPECT_EQ(out.force_on_hand_newton.norm(), 0.0);
      EXPECT_EQ(out.state, GuardState::kFallback);
    }
    const GuardedForce next = guard.answered(command(Vector3(1, 0, 0)), kStart + 10ms);
    EXPECT_NEAR(next.force_on_hand_newton.x(), 0.1, 1e-15);
  }
}

TEST(ForceGuard, BeforeTheFirstAnswerItIsLimpHoweverYoungTheClock) {
  GuardedMotors guard(config(), kDevicePeak_newton);
  EXPECT_EQ(missed(guard, time_at(0.005)).state, GuardState::kLimp);
}

// 0.1 N a millisecond towards 20 N: 0.1 k N after k answers, 3.3 N from the 33rd on.
TEST(ForceGuard, AGrowingForceEndsAtThePeak) {
  GuardedMotors guard(slewing(), kDevicePeak_newton);
  for (int k = 1; k <= 40; ++k) {
    const GuardedForce out = guard.answered(command(Vector3(0, 0, 20)), kStart + k * 1ms);
    EXPECT_NEAR(out.force_on_hand_newton.z(), std::min(0.1 * k, kDevicePeak_newton), 1e-12);
  }
}

// The push of the check of the motors is no force to grow from: the first answer makes a limp
// start.
TEST(ForceGuard, WhatActsBeforeTheFirstAnswerIsNoBeginning) {
  DeviceConfig c = config();
  c.start_ramp = 100ms;
  c.slew_newton_per_s = 100.0;
  ForceGuard guard(c, kDevicePeak_newton);
  const Vector3 push(0.4, 0, 0);
  EXPECT_EQ(guard.answered(command(Vector3(1, 0, 0)), kStart, push).force_on_hand_newton.norm(),
            0.0);
  EXPECT_NEAR(
      guard.answered(command(Vector3(1, 0, 0)), kStart + 10ms, push).force_on_hand_newton.x(), 0.4,
      1e-12)
      << "from then on it is";
}

// 1 N for 2 ms, reduced to 0.4 N for 1 ms: that acts, to the end of its own lease, and the growth
// of 0.1 N in the next millisecond begins there.
TEST(ForceGuard, WhatAnAnswerWasReducedToActsForTheReducedLease) {
  GuardedMotors guard(slewing(), kDevicePeak_newton);
  for (int i = 0; i < 10; ++i) {
    (void)guard.answered(command(Vector3(1, 0, 0)), kStart + i * 1ms);
  }
  const TimePoint now = kStart + 9ms;
  guard.reduced(
      {.force_on_hand_newton = {0.4, 0, 0}, .lease = 1ms, .state = GuardState::kAnswered});

  const GuardedForce leased = missed(guard, now + 1ms - 1ns);
  EXPECT_EQ(leased.state, GuardState::kLeased);
  EXPECT_EQ(leased.force_on_hand_newton, Vector3(0.4, 0, 0));
  GuardedMotors later = guard;
  EXPECT_NEAR(guard.answered(command(Vector3(1, 0, 0)), now + 1ms - 1ns).force_on_hand_newton.x(),
              0.5, 1e-6);
  EXPECT_EQ(missed(later, now + 1ms).state, GuardState::kFallback);
}

// A fallback of 0.1 N, reduced to 0.05 N, after an answer of 1 N: the next fallback is that of the
// answer again, and the answer after the reduced one grows from 0.05 N.
TEST(ForceGuard, AReducedFallbackLeavesTheLastAnswerAsItWas) {
  GuardedMotors guard(slewing(), kDevicePeak_newton);
  for (int i = 0; i < 10; ++i) {
    (void)guard.answered(command(Vector3(1, 0, 0)), kStart + i * 1ms);
  }
  GuardedForce fallback = missed(guard, kStart + 12ms);
  ASSERT_EQ(fallback.state, GuardState::kFallback);
  fallback.force_on_hand_newton *= 0.5;
  guard.reduced(fallback);

  GuardedMotors answered = guard;
  EXPECT_NEAR(missed(guard, kStart + 13ms).force_on_hand_newton.x(), 0.1, 1e-12);
  EXPECT_NEAR(answered.answered(command(Vector3(1, 0, 0)), kStart + 13ms).force_on_hand_newton.x(),
              0.15, 1e-12);
}

}  // namespace
}  // namespace palpate::device
