// SPDX-License-Identifier: Apache-2.0
// The monitor of the energy on its own. Friction 0.1 N·s/m and 0.1 N, exact encoder, v_max 0.5 m/s:
// D(F) = (F − 0.15 N) 0.5 m/s for F ≥ 0.2 N.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <limits>

#include "common/core/random.h"
#include "device_node/monitor/force_monitor.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

/// T_hold 2 ms, answers due within 0.5 ms.
DeviceConfig exact_config() {
  DeviceConfig config;
  config.reply = 500us;
  config.lease = 2ms;
  config.profile.position_resolution_m = 0.0;
  return config;
}

/// After 10 mm of free motion at 0.1 m/s: 0.1 N · 10 mm + 0.1 N·s/m · 0.1 m/s · 10 mm = 1.1 mJ.
class MonitorWith1100MicroJoule : public testing::Test {
 protected:
  MonitorWith1100MicroJoule() { move(100); }
  /// @param ticks  1 ms each, +x
  void move(int ticks) {
    for (int i = 0; i <= ticks; ++i) {
      if (i > 0) {
        now_ += 1ms;
        hand_m_.x() += 1e-4;
      }
      monitor_.read(now_, hand_m_);
    }
  }
  ForceMonitor monitor_{exact_config()};
  TimePoint now_{};
  Vector3 hand_m_ = Vector3::Zero();
};

TEST_F(MonitorWith1100MicroJoule, PassesWhatTheEnergyCoversUnchanged) {
  EXPECT_NEAR(monitor_.joule(), 1.1e-3, 1e-12);
  // 1 N: 0.425 W, 2.58 ms
  const auto covered = monitor_.cover({0, 1, 0}, 2500us);
  EXPECT_FALSE(covered.is_reduced);
  EXPECT_EQ(covered.force_on_hand_newton, Vector3(0, 1, 0));
  EXPECT_EQ(covered.lease, 2500us);
}

TEST_F(MonitorWith1100MicroJoule, ShortensALeaseThatIsTooLong) {
  const auto covered = monitor_.cover({0, 1, 0}, 10ms);
  EXPECT_TRUE(covered.is_reduced);
  EXPECT_EQ(covered.force_on_hand_newton, Vector3(0, 1, 0));
  EXPECT_NEAR(to_seconds(covered.lease), 1.1e-3 / 0.425, 1e-8);
}

// 1.1 mJ over the 2 ms of every command: 0.55 W, 1.25 N.
TEST_F(MonitorWith1100MicroJoule, ReducesAForceThatIsTooLarge) {
  const auto covered = monitor_.cover({0, 0, -20}, 10ms);
  EXPECT_TRUE(covered.is_reduced);
  EXPECT_EQ(covered.lease, 2ms);
  EXPECT_NEAR((covered.force_on_hand_newton - Vector3(0, 0, -1.25)).norm(), 0.0, 1e-9);
}

TEST_F(MonitorWith1100MicroJoule, PaysNothingTwiceInATick) {
  EXPECT_FALSE(monitor_.cover({0, 1, 0}, 2500us).is_reduced);
  const auto again = monitor_.cover({0, 1, 0}, 2500us);
  EXPECT_TRUE(again.is_reduced);
  EXPECT_LT(again.force_on_hand_newton.norm(), 0.4);
}

// 1 N may act for 0.5 ms more, until the answer's deadline: 0.2125 mJ.
TEST_F(MonitorWith1100MicroJoule, ReservesWhatTheActingForceMayStillDraw) {
  monitor_.switched(now_, hand_m_, {0, 1, 0}, 2ms);
  move(0);
  const auto covered = monitor_.cover({0, 0, -20}, 2ms);
  EXPECT_NEAR(covered.force_on_hand_newton.norm(), 0.15 + (1.1e-3 - 0.2125e-3) / 2e-3 / 0.5, 1e-9);
}

// An answer that acts within 0.2 ms or never: 0.085 mJ; the first deadline of a tick that is later
// than what was reserved changes nothing.
TEST_F(MonitorWith1100MicroJoule, ReservesNoMoreThanUntilTheAnswersOwnDeadline) {
  monitor_.switched(now_, hand_m_, {0, 1, 0}, 2ms);
  move(0);
  ForceMonitor later = monitor_;
  monitor_.begins_within(200us);
  later.begins_within(700us);
  EXPECT_NEAR(monitor_.cover({0, 0, -20}, 2ms).force_on_hand_newton.norm(),
              0.15 + (1.1e-3 - 0.085e-3) / 2e-3 / 0.5, 1e-9);
  EXPECT_NEAR(later.cover({0, 0, -20}, 2ms).force_on_hand_newton.norm(),
              0.15 + (1.1e-3 - 0.2125e-3) / 2e-3 / 0.5, 1e-9);
}

TEST_F(MonitorWith1100MicroJoule, ForgetsItsCreditButNoDebtWhenItDoesNotKnowWhatHappened) {
  monitor_.lost();
  move(0);
  EXPECT_EQ(monitor_.joule(), 0.0);

  // 1 N along 10 mm draws 10 mJ, less friction
  monitor_.switched(now_, hand_m_, {1, 0, 0}, 1h);
  move(100);
  const double debt = monitor_.joule();
  EXPECT_LT(debt, -8e-3);
  monitor_.lost();
  move(0);
  // and may have gone on to act until the deadline of the answer
  EXPECT_NEAR(monitor_.joule(), debt - 0.2125e-3, 1e-15);
}

TEST(Monitor, LetsTheFrictionsOwnForcePassWithoutCredit) {
  ForceMonitor monitor{exact_config()};
  monitor.read(TimePoint(1ms), Vector3::Zero());
  EXPECT_FALSE(monitor.cover({0.1, 0, 0}, 1h).is_reduced);
  EXPECT_TRUE(monitor.cover({0.11, 0, 0}, 1h).is_reduced);
}

// --- readings in steps of 1 mm --------------------------------------------------------------

/// With 5.9 mJ earned on 100 mm at 0.1 m/s.
class MonitorOfACoarseEncoder : public testing::Test {
 protected:
  MonitorOfACoarseEncoder() {
    for (int i = 0; i <= 100; ++i) {
      if (i > 0) now_ += 10ms;
      monitor_.read(now_, Vector3(1e-3 * i, 0, 0));
    }
  }
  static DeviceConfig config() {
    DeviceConfig config = exact_config();
    config.profile.position_resolution_m = 1e-3;
    return config;
  }
  /// 1 N acts for 1 ms: the account takes (q/2)(1 N + 1 N) = 1 mJ for the readings' error, while no
  /// hand draws more than 0.425 mJ.
  void act(ForceMonitor& monitor, double moved_m = 0.0) const {
    monitor.switched(now_, hand_m_, {0, 1, 0}, 10ms);
    monitor.read(now_ + 1ms, hand_m_ + Vector3(moved_m, 0, 0));
  }
  ForceMonitor monitor_{config()};
  TimePoint now_{};
  const Vector3 hand_m_{0.1, 0, 0};
};

TEST_F(MonitorOfACoarseEncoder, FallsByNoMoreThanTheForceCanDraw) {
  const double before = monitor_.joule();
  ASSERT_GT(before, 5e-3);
  act(monitor_);
  EXPECT_NEAR(monitor_.joule(), before - 0.425e-3, 1e-15);
}

TEST_F(MonitorOfACoarseEncoder, TrustsTheReadingsAloneIfTheHandWasTooFast) {
  const double before = monitor_.joule();
  const double as_fast_as_may_be = 0.5e-3 + std::sqrt(3.0) * 1e-3;
  ForceMonitor slower = monitor_;
  act(slower, as_fast_as_may_be - 1e-9);
  EXPECT_GT(slower.joule(), before - 0.426e-3);
  act(monitor_, as_fast_as_may_be + 1e-9);
  EXPECT_LT(monitor_.joule(), before - 0.7e-3);
}

// 0.575 mJ below what it counts on, the account would have to earn them once more.
TEST_F(MonitorOfACoarseEncoder, EarnsAfterAForceWhatOneThatBeginsEarns) {
  act(monitor_);
  monitor_.switched(now_ + 1ms, hand_m_, Vector3::Zero(), 10ms);
  monitor_.read(now_ + 2ms, hand_m_);
  const double before = monitor_.joule();
  ForceMonitor begun{config()};
  begun.read(now_ + 2ms, hand_m_);
  for (int i = 1; i <= 100; ++i) {
    const Vector3 there = hand_m_ - Vector3(1e-3 * i, 0, 0);
    monitor_.read(now_ + 2ms + i * 10ms, there);
    begun.read(now_ + 2ms + i * 10ms, there);
    ASSERT_NEAR(monitor_.joule(), before + begun.joule(), 1e-12);
  }
  EXPECT_GT(begun.joule(), 5e-3);
}

// --- forces that end ------------------------------------------------------------------------

// The force acts for 0.2 ms, less than the deadline of the answer: 0.085 mJ.
TEST_F(MonitorWith1100MicroJoule, ReservesNoMoreThanTheRestOfTheLease) {
  monitor_.switched(now_, hand_m_, {0, 1, 0}, 200us);
  move(0);
  const auto covered = monitor_.cover({0, 0, -20}, 2ms);
  EXPECT_NEAR(covered.force_on_hand_newton.norm(), 0.15 + (1.1e-3 - 0.085e-3) / 2e-3 / 0.5, 1e-9);
}

/// What 0.1 N·s/m and 0.1 N dissipate.
double friction_joule(double moved_m, double duration_s) {
  return 0.1 * moved_m + 0.1 * moved_m * moved_m / duration_s;
}

TEST_F(MonitorWith1100MicroJoule, BooksAForceFromTheSwitchOn) {
  monitor_.switched(now_ + 500us, hand_m_ + Vector3(2e-4, 0, 0), {1, 0, 0}, 10ms);
  monitor_.read(now_ + 1ms, hand_m_ + Vector3(3e-4, 0, 0));
  const double free = friction_joule(2e-4, 5e-4);
  const double acting = friction_joule(1e-4, 5e-4) - 1e-4;
  EXPECT_NEAR(monitor_.joule(), 1.1e-3 + free + acting, 1e-12);
}

TEST_F(MonitorWith1100MicroJoule, BooksALatchedEndExactly) {
  monitor_.switched(now_, hand_m_, {1, 0, 0}, 500us);
  monitor_.ended(hand_m_ + Vector3(1e-4, 0, 0));
  monitor_.read(now_ + 1ms, hand_m_ + Vector3(3e-4, 0, 0));
  const double acting = friction_joule(1e-4, 5e-4) - 1e-4;
  const double free = friction_joule(2e-4, 5e-4);
  EXPECT_NEAR(monitor_.joule(), 1.1e-3 + acting + free, 1e-12);
}

// Not read where it ended: the hand can have gone v_max · 0.2 ms along the force.
TEST_F(MonitorWith1100MicroJoule, BooksTheWorstOfAnUnreadEnd) {
  const double expected = 1.1e-3 - 0.5 * 2e-4 + friction_joule(3e-4, 1e-3);
  const auto joule_after = [&](Duration lease, Duration released) {
    ForceMonitor monitor = monitor_;
    monitor.switched(now_, hand_m_, {1, 0, 0}, lease);
    if (released > 0s) monitor.released(now_ + released);
    monitor.read(now_ + 1ms, hand_m_ + Vector3(3e-4, 0, 0));
    return monitor.joule();
  };
  EXPECT_NEAR(joule_after(200us, 0s), expected, 1e-12);
  EXPECT_NEAR(joule_after(10ms, 200us), expected, 1e-12);
  EXPECT_NEAR(joule_after(200us, 800us), expected, 1e-12);
}

// Too weak to draw as much: D(0.15 N) = 0.05²/0.4 W for 0.2 ms.
TEST_F(MonitorWith1100MicroJoule, AnUnreadEndCostsAtMostTheDrain) {
  monitor_.switched(now_, hand_m_, {0, 0.15, 0}, 200us);
  monitor_.read(now_ + 1ms, hand_m_);
  EXPECT_NEAR(monitor_.joule(), 1.1e-3 - 2e-4 * 0.05 * 0.05 / 0.4, 1e-12);
}

// Which a reading beyond the reach of any hand shows.
/// The same where forces go on until the next message.
class MonitorWithoutWatchdog : public MonitorWith1100MicroJoule {
 protected:
  MonitorWithoutWatchdog() {
    monitor_ = ForceMonitor(exact_config(), {.are_by_themselves = false, .reach_m = 0.1});
    now_ = {};
    move(100);
    before_joule_ = monitor_.joule();
    monitor_.switched(now_, hand_m_, {1, 0, 0}, 2ms);
  }
  double before_joule_;
};

// The hand goes along 1 N for 20 ms at 0.5 m/s: 10 mJ, less its friction of 1 mJ + 0.5 mJ.
TEST_F(MonitorWithoutWatchdog, BooksAForceThatOutlivedItsLeaseForAsLongAsItActed) {
  const double way_m = 0.5 * 20e-3;
  monitor_.read(now_ + 20ms, hand_m_ + Vector3(way_m, 0, 0), {.acting_newton = Vector3::Zero()});
  const double friction = 0.1 * way_m + 0.1 * 0.5 * way_m;
  EXPECT_NEAR(monitor_.joule(), before_joule_ - way_m + friction, 1e-9);

  // nothing beyond f_co until that is paid
  const auto covered = monitor_.cover({0, 1, 0}, 2ms);
  EXPECT_TRUE(covered.is_reduced);
  EXPECT_NEAR(covered.force_on_hand_newton.norm(), 0.1, 1e-9);
}

// Back where it was after 20 ms: it can have gone 5 mm along the force, which then ended.
TEST_F(MonitorWithoutWatchdog, BooksTheWorstTimeAtWhichItCanHaveEnded) {
  monitor_.read(now_ + 20ms, hand_m_, {.acting_newton = Vector3::Zero()});
  const double hidden_path_m = 2.0 * 5e-3;
  EXPECT_NEAR(monitor_.joule(), before_joule_ - 5e-3 + 0.1 * hidden_path_m, 1e-9);
}

TEST_F(MonitorWithoutWatchdog, AReadingWithinTheLeaseIsExact) {
  monitor_.read(now_ + 1ms, hand_m_ + Vector3(1e-4, 0, 0), {.acting_newton = Vector3(1, 0, 0)});
  EXPECT_NEAR(monitor_.joule(), before_joule_ - 1e-4 + 0.1 * 1e-4 + 0.1 * 0.1 * 1e-4, 1e-9);
}

// D(1 N) = 0.425 W. Released 30 ms after the last reading: 12.75 mJ, or 1 N · 100 mm if that is
// less.
TEST_F(MonitorWithoutWatchdog, AReleaseThatFailedIsPaidUntilItIsConfirmed) {
  monitor_.read(now_, hand_m_, {.acting_newton = Vector3(1, 0, 0)});  // keeps 0.5 ms of it
  const double kept_joule = 0.5e-3 * 0.425;
  ForceMonitor late = monitor_;
  ForceMonitor failed = monitor_;
  monitor_.released(now_ + 30ms);
  monitor_.lost();
  monitor_.read(now_ + 1s, hand_m_);
  EXPECT_NEAR(monitor_.joule(), before_joule_ - kept_joule - 12.75e-3, 1e-9);

  late.released(now_ + 10s);
  late.lost();
  late.read(now_ + 11s, hand_m_);
  EXPECT_NEAR(late.joule(), before_joule_ - kept_joule - 0.1, 1e-9);

  // and so is a force whose switch failed: D(2 N) = 0.925 W
  failed.failed({0, 2, 0});
  failed.released(now_ + 30ms);
  failed.lost();
  failed.read(now_ + 1s, hand_m_);
  EXPECT_NEAR(failed.joule(), before_joule_ - kept_joule - 12.75e-3 - 30e-3 * 0.925, 1e-9);
}

TEST_F(MonitorWithoutWatchdog, ASleepOfTheMachineCountsAsTime) {
  monitor_.read(now_, hand_m_, {.acting_newton = Vector3(1, 0, 0)});
  monitor_.slept(20ms);
  monitor_.released(now_ + 1ms);
  monitor_.lost();
  monitor_.read(now_ + 1s, hand_m_);
  EXPECT_NEAR(monitor_.joule(), before_joule_ - 21.5e-3 * 0.425, 1e-9);
}

// What the motors made beyond the 1 N that was covered is charged with its lease.
TEST_F(MonitorWith1100MicroJoule, ChargesWhatTheMotorsRoundUp) {
  static_cast<void>(monitor_.cover({0, 1, 0}, 1ms));
  monitor_.switched(now_, hand_m_, {0, 1.2, 0}, 1ms);
  // 1.1 mJ − 0.425 mJ − 0.1 mJ
  const auto covered = monitor_.cover({0, 20, 0}, 2ms);
  EXPECT_NEAR(covered.force_on_hand_newton.norm(), 0.15 + 0.575e-3 / 2e-3 / 0.5, 1e-9);
}

// κ = 36 /m: a clamp knows the drain only, and with what it may count on it is never reduced. A
// lease in which the arm turns too far becomes shorter, which is no fault of the clamp.
TEST(Monitor, AClampIsNotReducedForWhatHeldCurrentsDo) {
  DeviceConfig config = exact_config();
  config.peak_force_newton = 3.0;
  Random random(3);
  const WorstHand hand(config.profile, config.monitor.v_max_m_per_s);
  int shortened = 0;
  for (int i = 0; i < 1000; ++i) {
    ForceMonitor monitor(config, {.turning_per_m = 36.0});
    TimePoint now{};
    Vector3 hand_m = Vector3::Zero();
    monitor.read(now, hand_m);
    const std::uint64_t ticks = 20 + random.below(300);
    for (std::uint64_t tick = 0; tick < ticks; ++tick) {
      hand_m.x() += 1e-4;
      monitor.read(now += 1ms, hand_m);
    }
    const Vector3 acting_newton = random.uniform(0.0, 1.0) * random.direction();
    monitor.switched(now, hand_m, acting_newton, 2ms);
    monitor.read(now, hand_m);
    const Duration within = from_seconds(random.uniform(1e-4, 5e-4));
    const double free_joule =
        monitor.coverable_joule() - to_seconds(within) * hand.drain_watt(acting_newton);
    monitor.begins_within(within);
    Vector3 force_newton = 3.0 * random.direction();
    force_newton *= hand.largest_scale(force_newton, std::max(0.0, free_joule) / 2e-3);
    const double drain = hand.drain_watt(force_newton);
    const Duration lease =
        drain > 0.0 ? std::clamp(from_seconds(free_joule / drain), Duration(2ms), Duration(10ms))
                    : Duration(10ms);

    const auto covered = monitor.cover(force_newton, lease);

    EXPECT_FALSE(covered.is_reduced) << i;
    EXPECT_LT((covered.force_on_hand_newton - force_newton).norm(), 1e-9) << i;
    EXPECT_GE(covered.lease, 2ms) << i;
    shortened += covered.lease < lease ? 1 : 0;
  }
  EXPECT_GT(shortened, 50);
}

// Friction absorbs 0.1 N itself, but not what held currents do more as the arm turns.
TEST_F(MonitorWith1100MicroJoule, FallsByWhatHeldCurrentsDidMore) {
  const double joule = monitor_.joule();
  monitor_.switched(now_, hand_m_, {0.1, 0, 0}, 2ms);
  monitor_.read(now_ + 1ms, hand_m_, {.turning_joule = 2e-5});
  EXPECT_NEAR(monitor_.joule(), joule - 2e-5, 1e-12);
  // what they did less is no credit
  monitor_.read(now_ + 2ms, hand_m_, {.turning_joule = -2e-5});
  EXPECT_NEAR(monitor_.joule(), joule - 2e-5, 1e-12);
}

// A reading 1 ms old: every command costs its drain 1 ms longer, so does the one that acts.
TEST_F(MonitorWith1100MicroJoule, KeepsWhatTheSkewMayCost) {
  monitor_.read(now_ + 1ms, hand_m_ + Vector3(1e-4, 0, 0), {.skew = 1ms});
  const double joule = monitor_.joule();
  EXPECT_LT(monitor_.coverable_joule(), joule);
  const auto covered = monitor_.cover({0, 20, 0}, 2ms);
  EXPECT_NEAR(covered.force_on_hand_newton.norm(), 0.15 + joule / 3e-3 / 0.5, 1e-9);
}

TEST_F(MonitorWith1100MicroJoule, AForceThatEndsAtAReadingIsBookedAsRead) {
  monitor_.switched(now_, hand_m_, {1, 0, 0}, 1ms);
  monitor_.read(now_ + 1ms, hand_m_ + Vector3(6e-4, 0, 0));
  EXPECT_NEAR(monitor_.joule(), 1.1e-3 - 6e-4 + friction_joule(6e-4, 1e-3), 1e-12);
}

TEST(Monitor, AForceReleasedAtItsSwitchCostsNothing) {
  DeviceConfig config = exact_config();
  config.profile.position_resolution_m = 55e-6;
  ForceMonitor monitor(config);
  monitor.read(TimePoint(1ms), Vector3::Zero());
  monitor.read(TimePoint(2ms), Vector3(1e-3, 0, 0));
  const double before = monitor.joule();
  monitor.switched(TimePoint(2ms), Vector3(1e-3, 0, 0), {1, 0, 0}, 10ms);
  monitor.released(TimePoint(2ms));
  monitor.read(TimePoint(3ms), Vector3(1e-3, 0, 0));
  EXPECT_EQ(monitor.joule(), before);
}

TEST_F(MonitorWith1100MicroJoule, IgnoresAReadingThatIsNotNewer) {
  monitor_.read(now_, hand_m_ + Vector3(1e-3, 0, 0));
  monitor_.read(now_ - 1ms, hand_m_ - Vector3(1e-3, 0, 0));
  EXPECT_NEAR(monitor_.joule(), 1.1e-3, 1e-12);
  move(1);
  move(0);
  EXPECT_NEAR(monitor_.joule(), 1.1e-3 + friction_joule(1e-4, 1e-3), 1e-12);
}

TEST_F(MonitorWith1100MicroJoule, AForceThatActedBeforeItLostTrackIsForgotten) {
  monitor_.switched(now_, hand_m_, {1, 0, 0}, 1h);
  monitor_.lost();
  monitor_.read(now_ + 1ms, hand_m_);
  monitor_.read(now_ + 2ms, hand_m_ + Vector3(1e-4, 0, 0));
  EXPECT_NEAR(monitor_.joule(), friction_joule(1e-4, 1e-3), 1e-12);
}

TEST(Monitor, BeginsAtItsFirstReadingWithoutCredit) {
  DeviceConfig config = exact_config();
  config.profile.position_resolution_m = 55e-6;
  ForceMonitor monitor(config);
  EXPECT_NEAR(monitor.cover({0, 1, 0}, 2ms).force_on_hand_newton.norm(), 0.1, 1e-3);
  monitor.read(TimePoint(1s), Vector3(0.1, 0, 0));
  EXPECT_EQ(monitor.joule(), 0.0);
}

// --- rounding -------------------------------------------------------------------------------

/// |F| with D(F) = this for little power, where D is (|F| − 0.1 N)²/(0.4 N·s/m).
Vector3 force_of_drain(double watt) { return {0, 0.1 + std::sqrt(0.4 * watt), 0}; }

TEST(Monitor, LetsANanojoulePassAsRounding) {
  ForceMonitor monitor(exact_config());
  monitor.read(TimePoint(1ms), Vector3::Zero());
  EXPECT_FALSE(ForceMonitor(monitor).cover(force_of_drain(0.9e-6), 1ms).is_reduced);
  EXPECT_TRUE(ForceMonitor(monitor).cover(force_of_drain(1.1e-6), 1ms).is_reduced);
}

// Also after a reading: the debt stays until the hand has put in what was drawn.
TEST(Monitor, LetsItPassOnce) {
  ForceMonitor monitor(exact_config());
  TimePoint now(1ms);
  Vector3 hand = Vector3::Zero();
  monitor.read(now, hand);
  const Vector3 force = force_of_drain(0.9e-6);
  EXPECT_FALSE(monitor.cover(force, 1ms).is_reduced);
  EXPECT_TRUE(monitor.cover(force, 1ms).is_reduced);
  // the hand draws it
  monitor.switched(now, hand, force, 1ms);
  now += 1ms;
  hand += 0.5e-3 * (force.y() - 0.1) / 0.1 * Vector3::UnitY();
  monitor.ended(hand);
  monitor.read(now, hand);
  EXPECT_NEAR(monitor.joule(), -0.9e-9, 1e-15);
  EXPECT_TRUE(monitor.cover(force, 1ms).is_reduced);
  EXPECT_FALSE(monitor.cover({0, 0.1, 0}, 1h).is_reduced);
  // a fault forgets no debt
  monitor.lost();
  monitor.read(now + 1ms, hand);
  EXPECT_NEAR(monitor.joule(), -0.9e-9, 1e-15);
  EXPECT_TRUE(monitor.cover(force, 1ms).is_reduced);
}

TEST(Monitor, AFaultCountsWhatTheLastCommandCanStillDraw) {
  ForceMonitor monitor(exact_config());
  for (int i = 1; i <= 10; ++i) {
    monitor.read(TimePoint(i * 1ms), Vector3::Zero());
    static_cast<void>(monitor.cover(force_of_drain(0.4e-6), 1ms));
    monitor.lost();
  }
  monitor.read(TimePoint(11ms), Vector3::Zero());
  EXPECT_NEAR(monitor.joule(), -0.8e-9, 1e-15);  // two of them passed
}

// As after a hand faster than v_max.
TEST_F(MonitorWith1100MicroJoule, FrictionsOwnForcePassesInDebt) {
  monitor_.switched(now_, hand_m_, {1, 0, 0}, 1h);
  move(100);
  ASSERT_LT(monitor_.joule(), -1e-3);
  monitor_.released(now_);
  EXPECT_FALSE(monitor_.cover({0.1, 0, 0}, 1h).is_reduced);
  const auto covered = monitor_.cover({1, 0, 0}, 1ms);
  EXPECT_TRUE(covered.is_reduced);
  EXPECT_LE(covered.force_on_hand_newton.norm(), 0.1 + 1e-12);
  EXPECT_TRUE(monitor_.cover({1, 0, 0}, 1ms).is_reduced);
}

// 1.1 mJ pay for 400 N, 199.925 W, for 5502.06 ns.
TEST_F(MonitorWith1100MicroJoule, LetsTheDrainOfANanosecondPassAsRounding) {
  EXPECT_FALSE(ForceMonitor(monitor_).cover({0, 400, 0}, 5503ns).is_reduced);
  EXPECT_TRUE(ForceMonitor(monitor_).cover({0, 400, 0}, 5504ns).is_reduced);
}

// 0.425 mJ of 1.1 mJ, then as much again, then what is left.
TEST_F(MonitorWith1100MicroJoule, SubtractsWhatItCovers) {
  EXPECT_FALSE(monitor_.cover({0, 1, 0}, 1ms).is_reduced);
  EXPECT_FALSE(monitor_.cover({0, 1, 0}, 1ms).is_reduced);
  const auto rest = monitor_.cover({0, 1, 0}, 10ms);
  EXPECT_NEAR(rest.force_on_hand_newton.norm(), 0.15 + 0.25e-3 / 2e-3 / 0.5, 1e-9);
  EXPECT_LE(monitor_.cover({0, 1, 0}, 1ms).force_on_hand_newton.norm(), 0.1 + 1e-9);
}

// --- the worst hand -------------------------------------------------------------------------

constexpr double kAnySpeed = std::numeric_limits<double>::infinity();

TEST(WorstHand, DrawsNothingFromTheForceThatFrictionAbsorbs) {
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const Vector3 coulomb(random.uniform(0.01, 1), random.uniform(0.01, 1),
                          random.uniform(0.01, 1));
    const WorstHand isotropic({.coulomb_newton = coulomb.x()}, kAnySpeed);
    EXPECT_EQ(isotropic.drain_watt(coulomb.x() * random.direction()), 0.0);
    const WorstHand per_axis({.per_axis = FrictionPerAxis{.coulomb_newton = coulomb}}, kAnySpeed);
    EXPECT_EQ(per_axis.drain_watt(coulomb), 0.0);
    EXPECT_EQ(per_axis.drain_watt(-coulomb), 0.0);
  }
}

TEST(WorstHand, TheLargestScaleIsPaidAndNoLargerOneIs) {
  constexpr double kPrecise = 1e-9;
  int at_v_max = 0;
  for (std::uint64_t seed = 1; seed <= 2000; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const auto any = [&] { return random.uniform(0.02, 0.3); };
    DeviceProfile profile{.viscous_newton_s_per_m = any(), .coulomb_newton = any()};
    const bool is_per_axis = random.chance(0.5);
    if (is_per_axis) {
      profile.per_axis = FrictionPerAxis{.viscous_newton_s_per_m = {any(), any(), any()},
                                         .coulomb_newton = {any(), any(), any()}};
    }
    const double v_max = random.chance(0.3) ? kAnySpeed : random.uniform(0.05, 3.0);
    const WorstHand hand(profile, v_max);
    const Vector3 force = random.uniform(0.5, 5.0) * random.direction();
    const double drain = hand.drain_watt(force);
    EXPECT_EQ(hand.largest_scale(force, drain), 1.0);
    EXPECT_EQ(hand.largest_scale(force, 1.1 * drain), 1.0);

    const double watt = drain * std::pow(10.0, random.uniform(-6.0, -0.01));
    const double scale = hand.largest_scale(force, watt);
    EXPECT_LT(scale, 1.0);
    EXPECT_LE(hand.drain_watt(scale * force), watt * (1.0 + 1e-9));
    EXPECT_GT(hand.drain_watt((scale + kPrecise) * force), watt);
    if (!is_per_axis && watt > profile.viscous_newton_s_per_m * v_max * v_max) ++at_v_max;
  }
  EXPECT_GT(at_v_max, 100);
}

// Along x nothing bounds the drain: nothing may be reserved for a lease that is over.
TEST(Monitor, AnUnboundedDrainThatIsOverIsNotReserved) {
  DeviceConfig config = exact_config();
  config.monitor.v_max_m_per_s = kAnySpeed;
  config.profile.per_axis =
      FrictionPerAxis{.viscous_newton_s_per_m = {0, 0.1, 0.1}, .coulomb_newton = {0.1, 0.1, 0.1}};
  ForceMonitor monitor(config);
  monitor.read(TimePoint(1ms), Vector3::Zero());
  monitor.read(TimePoint(2ms), Vector3(1e-2, 0, 0));  // 1 mJ
  monitor.switched(TimePoint(2ms), Vector3(1e-2, 0, 0), {1, 0, 0}, 1ms);
  monitor.read(TimePoint(3ms), Vector3(1e-2, 0, 0));
  EXPECT_FALSE(monitor.cover({0, 1, 0}, 400us).is_reduced);  // D = 0.9²/0.4 W
}

}  // namespace
}  // namespace palpate::device
