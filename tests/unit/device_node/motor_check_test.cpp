// SPDX-License-Identifier: Apache-2.0
// The check of the motors and the watch on readings that stand still, on the simulated device with
// and without hands, whose motors have another sign, gain or axis than they say.
#include "device_node/motor_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/core/clock.h"
#include "common/core/random.h"
#include "device_node/monitor/frozen_watch.h"
#include "device_node/simulation/hand.h"
#include "device_node/simulation/simulated_device.h"
#include "tests/property/seeds.h"
#include "tests/support/alloc_guard.h"

namespace palpate::test {
namespace {

using namespace std::chrono_literals;
using device::MotorCheck;
using device::MotorVerdict;

/// How a motor does what it is told.
using Motors = std::function<Vector3(const Vector3&)>;
Motors times(double gain) {
  return [gain](const Vector3& force) { return Vector3(gain * force); };
}

struct Checked {
  MotorVerdict verdict = MotorVerdict::kChecking;
  double gain = 0.0;
  double seconds = 0.0;
  double largest_newton = 0.0;
  double furthest_m = 0.0;      ///< from where it was at first
  double received_joule = 0.0;  ///< by the hand, at most
};

struct Setting {
  HandConfig hand = {};
  SimulatedDeviceConfig simulated = {};
  double rate_hz = 1000.0;
  double limit_newton = 3.3;
  Duration latency{};  ///< of the readings
  bool freezes = false;
  std::function<int(int tick)> skipped = {};  ///< ticks after this one
  std::optional<DeviceProfile> profile = {};
};

Checked check(const Setting& setting, const Motors& motors, std::uint64_t seed = 1) {
  ManualClock clock;
  device::SimulatedDevice arm(setting.simulated, setting.hand, clock, seed);
  const DeviceProfile profile = setting.profile.value_or(
      DeviceProfile{.viscous_newton_s_per_m = setting.simulated.viscous_newton_s_per_m,
                    .coulomb_newton = setting.simulated.coulomb_newton,
                    .position_resolution_m = setting.simulated.position_resolution_m});
  MotorCheck checks({.rate_hz = setting.rate_hz,
                     .profile = profile,
                     .limit_newton = setting.limit_newton,
                     .latency = setting.latency});
  Checked result;
  std::vector<Vector3> late;
  device::DeviceSample sample;
  std::optional<Vector3> first;
  std::uint64_t allocated = 0;
  int tick = 0;
  while (checks.verdict() == MotorVerdict::kChecking && result.seconds < 60.0) {
    EXPECT_TRUE(arm.read(sample));
    late.push_back(sample.hand_position_m);
    if (!first) first = sample.hand_position_m;
    const auto lag =
        static_cast<std::size_t>(std::lround(to_seconds(setting.latency) * setting.rate_hz));
    const Vector3 seen =
        setting.freezes ? *first : late[late.size() > lag ? late.size() - 1 - lag : 0];
    const AllocGuard guard;
    const Vector3 push = checks.next(sample.sampled_at, seen);
    checks.applied(push);
    allocated += guard.count();
    device::DeviceSample passed;
    EXPECT_TRUE(arm.apply(motors(push), 1h, passed));
    const int periods = 1 + (setting.skipped ? setting.skipped(tick++) : 0);
    for (int i = 0; i < periods; ++i) {
      clock.advance(from_seconds(1.0 / setting.rate_hz));
      result.seconds += 1.0 / setting.rate_hz;
    }
    result.largest_newton = std::max(result.largest_newton, push.norm());
    result.furthest_m = std::max(result.furthest_m, (sample.hand_position_m - *first).norm());
  }
  EXPECT_EQ(allocated, 0U);
  result.verdict = checks.verdict();
  result.gain = checks.gain_at_least();
  result.received_joule = -arm.true_state().minimum_energy_joule;
  return result;
}

HandConfig hand_of(double mass_kg, double stiffness, double damping) {
  return {
      .mass_kg = mass_kg, .stiffness_newton_per_m = stiffness, .damping_newton_s_per_m = damping};
}

// --- sign

TEST(MotorCheck, AFreeArmAndHandsThatHoldItPass) {
  for (const auto& [name, hand] : {std::pair<std::string, HandConfig>{"nobody", device::nobody()},
                                   {"the usual hand", HandConfig{}},
                                   {"a firm hand", hand_of(0.1, 2000.0, 40.0)},
                                   {"a stiff one", hand_of(0.02, 4000.0, 30.0)},
                                   {"a heavy one", hand_of(0.5, 300.0, 3.0)}}) {
    const Checked checked = check({.hand = hand}, times(1.0));
    EXPECT_EQ(checked.verdict, MotorVerdict::kGood) << name;
    EXPECT_LT(checked.gain, 1.5) << name;
    EXPECT_LE(checked.largest_newton, 0.1 + MotorCheck::kBeyondFriction_newton + 1e-9);
    EXPECT_LT(checked.furthest_m, 5e-3) << name;
    EXPECT_LT(checked.seconds, 5.0) << name;
  }
}

TEST(MotorCheck, AReversedSignIsSeenWhoeverHoldsTheArm) {
  for (const auto& [name, hand] : {std::pair<std::string, HandConfig>{"nobody", device::nobody()},
                                   {"the usual hand", HandConfig{}},
                                   {"a firm hand", hand_of(0.1, 2000.0, 40.0)},
                                   {"a stiff one", hand_of(0.02, 4000.0, 30.0)},
                                   {"a heavy one", hand_of(0.5, 300.0, 3.0)}}) {
    const Checked checked = check({.hand = hand}, times(-1.0));
    EXPECT_EQ(checked.verdict, MotorVerdict::kWrongWay) << name;
    EXPECT_LT(checked.seconds, 2.0) << "on the first axis: " << name;
  }
}

TEST(MotorCheck, OneReversedAxisAndSwappedAxesAreSeen) {
  const Motors one = [](const Vector3& f) { return Vector3(f.x(), f.y(), -f.z()); };
  EXPECT_EQ(check({}, one).verdict, MotorVerdict::kWrongWay);
  const Motors swapped = [](const Vector3& f) { return Vector3(f.y(), f.x(), f.z()); };
  EXPECT_EQ(check({}, swapped).verdict, MotorVerdict::kWrongWay);
}

/// The hand that plays the emulators of the sessions, and a coarse encoder.
TEST(MotorCheck, AHandThatMovesAllTheTimeHidesNoSign) {
  Setting setting;
  setting.simulated.position_resolution_m = 110e-6;
  setting.hand.path = SinusoidPath{.amplitude_m = Vector3(0.015, 0.004, 0.015),
                                   .frequency_hz = Vector3(0.05, 0.03, 0.7),
                                   .phase_rad = Vector3(-0.94, 0, 1.57)};
  EXPECT_EQ(check(setting, times(1.0)).verdict, MotorVerdict::kGood);
  EXPECT_EQ(check(setting, times(-1.0)).verdict, MotorVerdict::kWrongWay);
}

TEST(MotorCheck, RandomArmsAndHandsAreNeverTakenForTheOpposite) {
  std::uint64_t undecided = 0;
  const std::uint64_t seeds = 10;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    Random random(seed);
    Setting setting;
    setting.hand =
        hand_of(random.uniform(0.0, 0.4), random.uniform(0.0, 3000.0), random.uniform(1.0, 60.0));
    if (random.chance(0.5)) {
      setting.hand.path = SinusoidPath{.amplitude_m = random.uniform(0.0, 0.01) * Vector3::Ones(),
                                       .frequency_hz = Vector3(random.uniform(0.1, 1.5), 0.3, 0.9)};
    }
    setting.simulated.mass_kg = random.uniform(0.03, 0.3);
    setting.simulated.coulomb_newton = random.uniform(0.02, 0.4);
    setting.simulated.viscous_newton_s_per_m = random.uniform(0.02, 1.0);
    setting.simulated.position_resolution_m = random.uniform(0.0, 110e-6);
    setting.rate_hz = random.chance(0.3) ? 500.0 : 1000.0;
    setting.latency = random.chance(0.5) ? Duration{} : Duration(2ms);
    for (const double sign : {1.0, -1.0}) {
      const MotorVerdict verdict = check(setting, times(sign), seed).verdict;
      EXPECT_NE(verdict, sign > 0.0 ? MotorVerdict::kWrongWay : MotorVerdict::kGood) << seed;
      EXPECT_NE(verdict, MotorVerdict::kTooStrong) << seed;
      if (verdict == MotorVerdict::kNotSeen || verdict == MotorVerdict::kFrozen) ++undecided;
    }
  }
  EXPECT_LE(undecided, seeds / 5) << "of " << 2 * seeds;
}

// --- gain

TEST(MotorCheck, AGainOffByTwoIsSeenOnAFreeArm) {
  for (const double resolution_m : {0.0, 55e-6, 110e-6}) {
    Setting setting{.hand = device::nobody()};
    setting.simulated.position_resolution_m = resolution_m;
    const Checked right = check(setting, times(1.0));
    EXPECT_EQ(right.verdict, MotorVerdict::kGood);
    EXPECT_NEAR(right.gain, 1.0, 0.25) << resolution_m;
    const Checked twice = check(setting, times(2.0));
    EXPECT_EQ(twice.verdict, MotorVerdict::kTooStrong) << resolution_m << " " << twice.gain;
    EXPECT_NEAR(twice.gain, 2.0, 0.5);
    const Checked half = check(setting, times(0.5));
    EXPECT_EQ(half.verdict, MotorVerdict::kGood);
    EXPECT_NEAR(half.gain, 0.5, 0.15) << resolution_m;
  }
}

/// Motors that are far too strong are not let go on until the blocks are full.
// 3 ms are 17° at 16 Hz, which a mass of little friction shows as work that is too small.
TEST(MotorCheck, ADeclaredLatencyIsNotTakenForStrength) {
  const Setting late{.hand = hand_of(0.1, 0.0, 0.0), .latency = 3ms};

  const Checked good = check(late, times(1.0));

  EXPECT_EQ(good.verdict, MotorVerdict::kGood) << good.gain;
}

TEST(MotorCheck, APushThatMovesTheHandleTooFarEndsAtOnce) {
  Setting setting{.hand = device::nobody()};
  setting.simulated.mass_kg = 0.03;
  setting.profile = DeviceProfile{.viscous_newton_s_per_m = 0.02, .coulomb_newton = 0.1};
  const Checked right = check(setting, times(1.0));
  const Checked strong = check(setting, times(6.0));

  EXPECT_LT(right.furthest_m, MotorCheck::kFarthest_m);
  EXPECT_GT(right.seconds, 1.0);
  EXPECT_EQ(strong.verdict, MotorVerdict::kTooStrong);
  EXPECT_LT(strong.seconds, 0.2) << "before the first block is full";
  EXPECT_LT(strong.furthest_m, 2.0 * MotorCheck::kFarthest_m + 2e-3)
      << "the half wave before went up to as far, and a tick follows";
}

// A push that goes on while ticks are skipped moves the handle further, and so it is taken.
TEST(MotorCheck, SkippedTicksAreNotTakenForStrengthNorDoTheyHideIt) {
  for (const auto& [name, skipped] :
       {std::pair<std::string, std::function<int(int)>>{"every other tick", [](int) { return 1; }},
        {"3 of 4", [](int) { return 3; }},
        {"4 of them now and then", [](int tick) { return tick % 23 == 0 ? 4 : 0; }}}) {
    Setting setting{.hand = device::nobody(), .skipped = skipped};
    setting.simulated.mass_kg = 0.04;
    const Checked right = check(setting, times(1.0));
    EXPECT_EQ(right.verdict, MotorVerdict::kGood) << name;
    EXPECT_NEAR(right.gain, 1.0, 0.35) << name;
    EXPECT_EQ(check(setting, times(2.0)).verdict, MotorVerdict::kTooStrong) << name;
    EXPECT_EQ(check(setting, times(-1.0)).verdict, MotorVerdict::kWrongWay) << name;
  }
}

TEST(MotorCheck, EndsWhereItIsInterruptedAgainAndAgain) {
  const Checked checked =
      check({.skipped = [](int tick) { return tick % 100 == 0 ? 10 : 0; }}, times(1.0));
  EXPECT_EQ(checked.verdict, MotorVerdict::kInterrupted);
  EXPECT_LT(checked.seconds, 15.0);
  EXPECT_LE(checked.furthest_m, MotorCheck::kFarthest_m);
}

TEST(MotorCheck, OfAHeldArmTheGainIsALowerBound) {
  for (const double gain : {1.0, 2.0}) {
    const Checked held = check({.hand = hand_of(0.1, 2000.0, 40.0)}, times(gain));
    EXPECT_EQ(held.verdict, MotorVerdict::kGood);
    EXPECT_LE(held.gain, 1.1 * gain);
  }
}

// --- what a held hand receives

/// Of a spring, mass and damper b under g F sin ωt: at most g² F² t/(2b), at resonance; and where
/// the positions are seen, none of which may go further than 5 mm in half a wave, ½ ω g F 2.5 mm t.
TEST(MotorCheck, WhatAHeldHandReceivesDependsOnItsResonanceAndIsBounded) {
  struct Case {
    HandConfig hand;
    double gain;
    bool freezes;
    double received_joule;  // as docs/devices.md says
  };
  // with the arm of 45 g
  const HandConfig loose = hand_of(0.055, 300.0, 3.0);
  const HandConfig firm = hand_of(0.105, 1000.0, 6.0);
  const HandConfig resonant = hand_of(0.015, 600.0, 2.0);
  for (const auto& [hand, gain, freezes, received_joule] :
       {Case{loose, 1.0, false, 8.5e-3}, Case{firm, 1.0, false, 12.6e-3},
        Case{resonant, 1.0, false, 51e-3}, Case{loose, 1.0, true, 13.4e-3},
        Case{resonant, 1.0, true, 84e-3}, Case{loose, 2.0, true, 69e-3},
        Case{resonant, 2.0, true, 511e-3}, Case{resonant, 2.0, false, 6.3e-3}}) {
    SCOPED_TRACE(received_joule);
    const Checked checked = check({.hand = hand, .freezes = freezes}, times(gain));
    EXPECT_NEAR(checked.received_joule, received_joule, 0.03 * received_joule);
    const double push_newton = gain * checked.largest_newton;
    const double damping = hand.damping_newton_s_per_m + 0.1;
    double bound_joule = push_newton * push_newton * checked.seconds / (2.0 * damping);
    if (!freezes) {
      const double omega_rad_per_s = 2.0 * std::numbers::pi * 16.0;
      bound_joule = std::min(bound_joule, 0.25 * omega_rad_per_s * push_newton *
                                              MotorCheck::kFarthest_m * checked.seconds);
    }
    EXPECT_LE(checked.received_joule, bound_joule);
  }
}

// --- what it cannot see

TEST(MotorCheck, ReadingsThatRepeatAreFrozenAndMotorsWithoutSupplyAreNotSeen) {
  EXPECT_EQ(check({.freezes = true}, times(1.0)).verdict, MotorVerdict::kFrozen);
  Setting moving;
  moving.hand.path =
      SinusoidPath{.amplitude_m = Vector3::Constant(0.01), .frequency_hz = Vector3(0.5, 0.7, 0.3)};
  const Checked without = check(moving, times(0.0));
  EXPECT_EQ(without.verdict, MotorVerdict::kNotSeen);
  EXPECT_LT(without.seconds, 6.0);
}

TEST(MotorCheck, NoPushIsStrongerThanTheLimit) {
  const Checked checked = check({.limit_newton = 0.25}, times(1.0));
  EXPECT_LE(checked.largest_newton, 0.25);
  EXPECT_EQ(checked.verdict, MotorVerdict::kGood);
}

// --- readings that stand still

struct Watched {
  DeviceConfig config;
  Watched() {
    config.profile = {.coulomb_newton = 0.1, .position_resolution_m = 55e-6};
    config.monitor.v_max_m_per_s = 0.5;
  }
};

TEST(FrozenWatch, AForceThatPushesIntoReadingsThatRepeatIsSeenAfterAQuarterOfASecond) {
  device::FrozenWatch watch(Watched().config);
  const Vector3 at_m(0.01, 0, 0);
  int still = 0;
  for (; still < 1000 && !watch.is_frozen(); ++still) {
    EXPECT_TRUE(watch.read(TimePoint(still * 1ms), at_m, Vector3(0, 0, 0.5)));
  }
  EXPECT_EQ(still, 251);
  EXPECT_TRUE(watch.read(TimePoint(still * 1ms), at_m + Vector3(55e-6, 0, 0), Vector3::Zero()))
      << "a hand that had kept still";
  EXPECT_FALSE(watch.is_frozen());
}

TEST(FrozenWatch, AForceThatChangesIsSeenSooner) {
  device::FrozenWatch watch(Watched().config);
  int still = 0;
  for (; still < 1000 && !watch.is_frozen(); ++still) {
    static_cast<void>(watch.read(TimePoint(still * 1ms), Vector3::Zero(),
                                 Vector3(0, 0, still < 50 ? 0.5 : -0.5)));
  }
  EXPECT_EQ(still, 81);
}

TEST(FrozenWatch, AJumpAtItsEndShowsThatTheHandMoved) {
  device::FrozenWatch watch(Watched().config);
  int still = 0;
  for (; !watch.is_frozen(); ++still) {
    ASSERT_TRUE(watch.read(TimePoint(still * 1ms), Vector3::Zero(), Vector3(0, 0, 0.5)));
  }
  EXPECT_FALSE(watch.read(TimePoint(still * 1ms), Vector3(0, 0, 0.002), Vector3::Zero()));
}

TEST(FrozenWatch, AnArmAtRestAndOneThatMovesAreNotTakenForIt) {
  device::FrozenWatch watch(Watched().config);
  for (int i = 0; i < 5000; ++i) {
    ASSERT_TRUE(watch.read(TimePoint(i * 1ms), Vector3::Zero(), Vector3(0, 0, 0.1)));
    ASSERT_FALSE(watch.is_frozen()) << "at most f_co";
  }
  for (int i = 0; i < 5000; ++i) {
    // a hand that keeps still, and trembles by one step now and then
    const double step = (i / 100) % 2 == 0 ? 55e-6 : 0.0;
    ASSERT_TRUE(watch.read(TimePoint((5000 + i) * 1ms), Vector3(step, 0, 0), Vector3(0, 0, 2.0)));
    ASSERT_FALSE(watch.is_frozen());
  }
}

}  // namespace
}  // namespace palpate::test
