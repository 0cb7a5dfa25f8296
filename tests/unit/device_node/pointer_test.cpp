// SPDX-License-Identifier: Apache-2.0
// A hand that a pointer leads: which page may lead it, and its limits for any goal.
#include <gtest/gtest.h>

#include <cmath>

#include "device_node/simulation/hand.h"
#include "device_node/simulation/pointer_hold.h"
#include "device_node/simulation/simulated_device.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

HandTarget target_of(std::uint64_t viewer, std::uint64_t holder, std::uint64_t sequence,
                     bool is_released = false) {
  HandTarget target;
  target.header = {.session_id = viewer, .sequence = sequence};
  target.holder_id = holder;
  target.is_released = is_released;
  return target;
}

// --- who ----------------------------------------------------------------------------------------

TEST(PointerHold, OnePageHoldsTheHandAndOthersAreRefused) {
  PointerHold hold(2s);
  TimePoint now{1s};
  EXPECT_FALSE(hold.is_held(now));
  EXPECT_TRUE(hold.accept(target_of(1, 1, 0), now));
  EXPECT_TRUE(hold.is_held(now));

  EXPECT_FALSE(hold.accept(target_of(1, 2, 1), now));  // another page of the same viewer
  EXPECT_FALSE(hold.accept(target_of(2, 1, 0), now));  // another viewer, whose page is 1 too
  EXPECT_TRUE(hold.accept(target_of(1, 1, 2), now));
}

TEST(PointerHold, IsFreeOnceItsHolderReleasesIt) {
  PointerHold hold(2s);
  const TimePoint now{1s};
  ASSERT_TRUE(hold.accept(target_of(1, 1, 0), now));
  EXPECT_TRUE(hold.accept(target_of(1, 1, 1, true), now));  // its last target counts
  EXPECT_FALSE(hold.is_held(now));

  EXPECT_TRUE(hold.accept(target_of(1, 2, 2), now));
}

TEST(PointerHold, IsFreeOnceItsHolderIsSilentForTheTimeOut) {
  PointerHold hold(2s);
  const TimePoint now{1s};
  ASSERT_TRUE(hold.accept(target_of(1, 1, 0), now));

  EXPECT_FALSE(hold.accept(target_of(2, 1, 0), now + 2s - 1ns));
  EXPECT_TRUE(hold.is_held(now + 2s - 1ns));
  EXPECT_FALSE(hold.is_held(now + 2s));
  EXPECT_TRUE(hold.accept(target_of(2, 1, 1), now + 2s));
  EXPECT_FALSE(hold.accept(target_of(1, 1, 1), now + 2s));
}

TEST(PointerHold, APageThatDoesNotHoldTheHandCannotReleaseIt) {
  PointerHold hold(2s);
  const TimePoint now{1s};
  EXPECT_FALSE(hold.accept(target_of(1, 1, 0, true), now));
  ASSERT_TRUE(hold.accept(target_of(1, 1, 1), now));
  EXPECT_FALSE(hold.accept(target_of(1, 2, 2, true), now));
  EXPECT_TRUE(hold.is_held(now));
}

TEST(PointerHold, TargetsOutOfOrderAreDropped) {
  PointerHold hold(2s);
  const TimePoint now{1s};
  ASSERT_TRUE(hold.accept(target_of(1, 1, 5), now));
  EXPECT_FALSE(hold.accept(target_of(1, 1, 5), now));
  EXPECT_FALSE(hold.accept(target_of(1, 1, 4), now));
  EXPECT_TRUE(hold.accept(target_of(1, 1, 6), now));
}

// --- where --------------------------------------------------------------------------------------

HandConfig led_config() {
  HandConfig config;
  config.path = SinusoidPath{.center_m = Vector3(0, 0, 0.01),
                             .amplitude_m = Vector3(0.01, 0, 0.02),
                             .frequency_hz = Vector3(0.5, 0, 1.0),
                             .phase_rad = Vector3(0, 0, 1.0)};
  config.pointer =
      PointerConfig{.center_m = Vector3(0.01, 0, 0), .reach_m = 0.05, .speed_m_per_s = 0.2};
  return config;
}

constexpr double kUpdate_s = 50e-6;

TEST(LedHand, IsOnItsPathToTheBitUntilItIsLed) {
  HandConfig config = led_config();
  Hand led(config, {}, 1);
  config.pointer.reset();
  Hand plain(config, {}, 1);
  for (double t = 0.0; t < 0.1; t += kUpdate_s) {
    ASSERT_EQ(led.target(t, Vector3::Zero()).position_m,
              plain.target(t, Vector3::Zero()).position_m);
  }
}

TEST(LedHand, WithoutPermissionKeepsToItsPath) {
  HandConfig config = led_config();
  config.pointer.reset();
  Hand hand(config, {}, 1);
  Hand other(config, {}, 1);
  hand.lead_to(Vector3(0, 0, 0.03));
  for (double t = 0.0; t < 0.1; t += kUpdate_s) {
    ASSERT_EQ(hand.target(t, Vector3::Zero()).position_m,
              other.target(t, Vector3::Zero()).position_m);
  }
}

TEST(LedHand, GoesToItsGoalAndStays) {
  Hand hand(led_config(), {}, 1);
  static_cast<void>(hand.target(0.3, Vector3::Zero()));
  const Vector3 goal_m(0.02, 0.01, -0.01);
  hand.lead_to(goal_m);
  Target target;
  // within 0.06 m: 0.3 s at full speed and some time constants of 50 ms
  for (double t = 0.3 + kUpdate_s; t < 1.5; t += kUpdate_s)
    target = hand.target(t, Vector3::Zero());
  EXPECT_LT((target.position_m - goal_m).norm(), 1e-6);
  EXPECT_LT(target.velocity_m_per_s.norm(), 1e-4);

  for (double t = 1.5; t < 5.0; t += 1e-3) target = hand.target(t, Vector3::Zero());
  EXPECT_LT((target.position_m - goal_m).norm(), 1e-9);
}

TEST(LedHand, StartsWhereThePathWasWithoutAJump) {
  Hand hand(led_config(), {}, 1);
  const Vector3 on_path_m = hand.target(0.3, Vector3::Zero()).position_m;
  hand.lead_to(Vector3(-0.03, 0, 0));
  const Target first = hand.target(0.3 + kUpdate_s, Vector3::Zero());
  EXPECT_LT((first.position_m - on_path_m).norm(), 0.2 * kUpdate_s + 1e-12);
}

TEST(LedHand, IsNeverFasterNorFartherThanItsLimitsForAnyGoal) {
  const HandConfig config = led_config();
  Hand hand(config, {}, 1);
  Vector3 previous_m = hand.target(0.0, Vector3::Zero()).position_m;
  Random random(5);
  double t = 0.0;
  for (int goal = 0; goal < 200; ++goal) {
    // up to a kilometre away, the most that the wire accepts
    hand.lead_to(random.direction() * std::pow(10.0, random.uniform(-3.0, 3.0)));
    for (int i = 0; i < 200; ++i) {
      t += kUpdate_s;
      const Target target = hand.target(t, Vector3::Zero());
      ASSERT_LE((target.position_m - config.pointer->center_m).norm(), 0.05 + 1e-12);
      ASSERT_LE((target.position_m - previous_m).norm() / kUpdate_s, 0.2 + 1e-6);
      ASSERT_LE(target.velocity_m_per_s.norm(), 0.2 + 1e-12);
      previous_m = target.position_m;
    }
  }
}

// From 6 cm away, within the limits of a pointer, to where the path is by then.
TEST(LedHand, ReturnsToItsPathWhenItIsLetGo) {
  const HandConfig config = led_config();
  Hand hand(config, {}, 1);
  HandConfig without = config;
  without.pointer.reset();
  Hand plain(without, {}, 1);
  double t = 0.0;
  Vector3 previous_m = hand.target(t, Vector3::Zero()).position_m;
  const auto step = [&] {
    t += kUpdate_s;
    const Target target = hand.target(t, Vector3::Zero());
    EXPECT_LE((target.position_m - previous_m).norm() / kUpdate_s, 0.2 + 2e-7 / kUpdate_s);
    EXPECT_LE((target.position_m - config.pointer->center_m).norm(), 0.05 + 1e-12);
    previous_m = target.position_m;
    return target;
  };
  hand.lead_to(Vector3(-0.03, 0.02, -0.02));
  while (t < 1.0) step();
  hand.let_go();
  while (t < 1.5) step();
  hand.lead_to(Vector3(0.02, 0, 0));  // taken again on its way
  while (t < 2.5) step();
  EXPECT_LT((previous_m - Vector3(0.02, 0, 0)).norm(), 1e-6);
  hand.let_go();
  while (t < 4.0) step();

  for (int i = 0; i < 1000; ++i) {
    const Target target = step();
    const Target wanted = plain.target(t, Vector3::Zero());
    // one of them was turned on from another place
    ASSERT_LT((target.position_m - wanted.position_m).norm(), 1e-15);
    ASSERT_LT((target.velocity_m_per_s - wanted.velocity_m_per_s).norm(), 1e-14);
  }
}

TEST(LedHand, StaysOnItsPathIfItIsLetGoWithoutHavingBeenLed) {
  Hand hand(led_config(), {}, 1);
  Hand plain(led_config(), {}, 1);
  hand.let_go();
  for (double t = 0.0; t < 0.1; t += kUpdate_s) {
    ASSERT_EQ(hand.target(t, Vector3::Zero()).position_m,
              plain.target(t, Vector3::Zero()).position_m);
  }
}

TEST(LedHand, MovesASimulatedDeviceOnTheThreadThatReadsIt) {
  ManualClock clock;
  HandGoals goals(8);
  HandConfig config;
  config.pointer = PointerConfig{};
  SimulatedDevice device({}, config, clock, 1, &goals);
  ASSERT_TRUE(goals.push(HandGoal{.position_m = {0, 0, 0.05}, .buttons = 2}));
  ASSERT_TRUE(goals.push(HandGoal{.position_m = {0.02, 0, 0}, .buttons = 4}));  // the newest counts

  DeviceSample sample;
  for (int tick = 0; tick < 3000; ++tick) {
    clock.advance(1ms);
    ASSERT_TRUE(device.read(sample));
  }

  // the spring of 150 N/m overcomes 0.1 N of friction down to 0.7 mm
  EXPECT_LT((sample.hand_position_m - Vector3(0.02, 0, 0)).norm(), 1e-3);
  EXPECT_EQ(sample.buttons, 4U);

  ASSERT_TRUE(goals.push(std::nullopt));
  clock.advance(1ms);
  ASSERT_TRUE(device.read(sample));
  EXPECT_EQ(sample.buttons, 0U) << "a page that lets go presses nothing";
}

}  // namespace
}  // namespace palpate::device
