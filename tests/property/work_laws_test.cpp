// SPDX-License-Identifier: Apache-2.0
// The upper bound of the hand's energy against the account, which is a lower bound and shares no
// arithmetic with it, and against hands whose energy is known.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "common/core/random.h"
#include "device_node/monitor/force_monitor.h"
#include "device_node/monitor/state_text.h"
#include "device_node/monitor/work_bound.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

Vector3 on_grid(const Vector3& position_m, double q) {
  return q > 0.0 ? Vector3((position_m / q).array().round() * q) : position_m;
}

DeviceConfig any_config(Random& random) {
  const auto any = [&] { return random.chance(0.1) ? 0.0 : random.uniform(0.02, 0.5); };
  DeviceConfig config;
  config.profile = {.viscous_newton_s_per_m = any(),
                    .coulomb_newton = any(),
                    .position_resolution_m =
                        random.chance(0.3) ? 0.0 : std::pow(10.0, random.uniform(-6.0, -3.0))};
  if (random.chance(0.5)) {
    config.profile.per_axis = FrictionPerAxis{.viscous_newton_s_per_m = {any(), any(), any()},
                                              .coulomb_newton = {any(), any(), any()}};
  }
  config.reply = 500us;
  config.lease = 2ms;
  config.monitor.v_max_m_per_s =
      random.chance(0.5) ? random.uniform(0.2, 1.0) : std::numeric_limits<double>::infinity();
  return config;
}

/// Anything that a hand, a network and a device may do to a monitor, for so many ticks.
/// @return largest M − U seen at a reading [J]
double largest_excess_joule(const DeviceConfig& config, const DeviceConfig& claimed, Random& random,
                            int ticks, bool is_covered) {
  const double q = config.profile.position_resolution_m;
  const MotorEnds ends{.are_by_themselves = random.chance(0.5), .reach_m = 0.4};
  ForceMonitor monitor(claimed, ends);
  WorkBound bound(config, ends.are_by_themselves);
  TimePoint now{};
  Vector3 hand = random.uniform(0.0, 0.1) * random.direction();
  Vector3 velocity = Vector3::Zero();
  Vector3 force = Vector3::Zero();
  TimePoint end{};
  double worst = -std::numeric_limits<double>::infinity();
  for (int k = 0; k < ticks; ++k) {
    const Duration step =
        std::chrono::microseconds(100 + random.below(random.chance(0.1) ? 20000 : 2000));
    if (random.chance(0.05)) velocity = random.uniform(0.0, 1.5) * random.direction();
    if (random.chance(0.1)) velocity = random.uniform(0.0, 0.5) * force;
    if (random.chance(0.05)) velocity.setZero();
    const TimePoint next = now + step;
    if (ends.are_by_themselves && end > now && end < next && random.chance(0.5)) {
      const Vector3 at_end = on_grid(hand + to_seconds(end - now) * velocity, q);
      monitor.ended(at_end);
      bound.ended(at_end);
    }
    now = next;
    hand += to_seconds(step) * velocity;
    const Vector3 reading = on_grid(hand, q);
    monitor.read(now, reading);
    bound.read(now, reading);
    worst = std::max(worst, monitor.joule() - bound.joule());
    if (random.chance(0.01)) {
      monitor.released(now);
      bound.released(now);
      if (random.chance(0.3)) {
        monitor.lost();
        bound.lost();
      }
      continue;
    }
    if (random.chance(0.1)) continue;  // no answer
    force = random.chance(0.2) ? Vector3(Vector3::Zero())
                               : Vector3(random.uniform(0.0, 5.0) * random.direction());
    const ForceMonitor::Covered covered = monitor.cover(force, config.lease);
    if (is_covered) force = covered.force_on_hand_newton;
    const Duration late = std::chrono::microseconds(random.below(400));
    const Vector3 at_switch = on_grid(hand + to_seconds(late) * velocity, q);
    now += late;
    hand += to_seconds(late) * velocity;
    monitor.switched(now, at_switch, force, covered.lease);
    bound.switched(now, at_switch, force, covered.lease);
    end = now + covered.lease;
  }
  return worst;
}

TEST(WorkLaws, NoAccountIsAboveTheHandThatMovedLeast) {
  for (std::uint64_t seed = 1; seed <= 2000; ++seed) {
    Random random(seed);
    const DeviceConfig config = any_config(random);
    const bool is_covered = random.chance(0.5);
    ASSERT_LE(largest_excess_joule(config, config, random, 300, is_covered), 1e-9)
        << "seed=" << seed;
  }
}

// The twin: an account that believes in half as much friction again. What a hand does after a lease
// that ends unread hides it in a few runs.
TEST(WorkLaws, AnAccountThatCountsTooMuchIsSeen) {
  int seen = 0;
  int runs = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    Random random(seed);
    DeviceConfig config = any_config(random);
    config.profile.position_resolution_m = 2e-5;
    if (config.profile.per_axis || config.profile.coulomb_newton == 0.0) continue;
    DeviceConfig claimed = config;
    claimed.profile.coulomb_newton *= 1.5;
    ++runs;
    seen += largest_excess_joule(config, claimed, random, 2000, true) > 1e-6 ? 1 : 0;
  }
  EXPECT_GT(runs, 50);
  EXPECT_GT(seen, 9 * runs / 10);
}

// An exact encoder and a hand that moves straight from reading to reading: that is the hand.
TEST(WorkLaws, ItIsTheEnergyOfAHandThatMovesStraight) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    Random random(seed);
    DeviceConfig config = any_config(random);
    config.profile.position_resolution_m = 0.0;
    config.monitor.v_max_m_per_s = std::numeric_limits<double>::infinity();
    const DeviceProfile& profile = config.profile;
    WorkBound bound(config, true);
    TimePoint now{};
    Vector3 hand = Vector3::Zero();
    Vector3 force = Vector3::Zero();
    double energy = 0.0;
    double path_m = 0.0;
    double change_newton = 0.0;
    bound.read(now, hand);
    for (int k = 0; k < 1000; ++k) {
      now += 1ms;
      const Vector3 v = random.uniform(0.0, 0.5) * random.direction();
      hand += 1e-3 * v;
      const double friction = profile.per_axis
                                  ? profile.per_axis->coulomb_newton.dot(v.cwiseAbs()) +
                                        profile.per_axis->viscous_newton_s_per_m.dot(v.cwiseAbs2())
                                  : profile.coulomb_newton * v.norm() +
                                        profile.viscous_newton_s_per_m * v.squaredNorm();
      energy += 1e-3 * (friction - force.dot(v));
      path_m += 1e-3 * v.lpNorm<1>();
      bound.read(now, hand);
      const Vector3 next = random.uniform(0.0, 3.0) * random.direction();
      change_newton += (next - force).lpNorm<1>();
      force = next;
      bound.switched(now, hand, force, 2ms);
    }
    EXPECT_GE(bound.joule(), energy - 1e-9) << seed;
    // what it rounds up: 1 µN along the path, 1 nm at each change of the force
    EXPECT_LE(bound.joule(), energy + 2e-6 * path_m + 2e-9 * change_newton + 1e-6) << seed;
  }
}

// An encoder that flickers between two values is a hand at rest.
TEST(WorkLaws, AFlickeringEncoderMovesNothing) {
  DeviceConfig config;
  config.profile = {
      .viscous_newton_s_per_m = 0.1, .coulomb_newton = 0.5, .position_resolution_m = 5.5e-5};
  WorkBound bound(config, true);
  TimePoint now{};
  for (int k = 0; k < 1000; ++k) {
    now += 1ms;
    bound.read(now, Vector3(k % 2 == 0 ? 0.0 : 5.4e-5, 0, 0));
    bound.switched(now, Vector3::Zero(), Vector3(1, 0, 0), 2ms);
  }
  EXPECT_LT(bound.joule(), 50e-6);
}

// 2 N over 0.1 m and back draw 0.4 J: what an account may say since the lowest point.
TEST(WorkLaws, AnAccountThatBeganAtTheLowestPointIsCovered) {
  DeviceConfig config;
  config.profile = {};
  config.profile.position_resolution_m = 0.0;
  WorkBound bound(config, false);
  TimePoint now{};
  const auto move_to = [&](double x) {
    now += 100ms;
    bound.read(now, Vector3(x, 0, 0));
  };
  move_to(0.0);
  bound.switched(now, Vector3::Zero(), Vector3(2, 0, 0), 1s);
  move_to(0.1);
  const double friction_joule = bound.joule() + 0.2;
  EXPECT_NEAR(bound.account_at_most_joule(), 0.0, 1e-12);
  move_to(0.0);
  EXPECT_NEAR(bound.account_at_most_joule(), 0.2 + friction_joule, 1e-6);
}

// Whatever a device reports: no overflow, and no fault that is none.
TEST(WorkLaws, AbsurdReadingsMakeItUnknown) {
  for (const double x : {5.0, 1e300, -1e12, std::numeric_limits<double>::quiet_NaN()}) {
    DeviceConfig config;
    WorkBound bound(config, true);
    bound.read(TimePoint(1ms), Vector3::Zero());
    bound.read(TimePoint(2ms), Vector3(0, x, 0));
    EXPECT_EQ(bound.joule(), std::numeric_limits<double>::infinity()) << x;
    bound.lost();
    bound.read(TimePoint(3ms), Vector3::Zero());
    EXPECT_EQ(bound.joule(), std::numeric_limits<double>::infinity()) << x;
  }
}

// A day of motion and 100 N.
TEST(WorkLaws, CountsForDays) {
  DeviceConfig config;
  config.profile.coulomb_newton = 100.0;
  WorkBound bound(config, true);
  TimePoint now{};
  for (int k = 0; k < 100'000; ++k) {
    now += 1s;
    bound.read(now, Vector3(k % 2 == 0 ? 3.9 : -3.9, 0, 0));
  }
  EXPECT_NEAR(bound.joule() / (100.0 * 7.8 * 99'999), 1.0, 0.05);
}

/// Adds to the energy that the first account has carried on.
struct Damage {
  static constexpr bool kIsReading = false;
  double more_joule;
  int doubles = 0;

  void operator()(double& value) {
    // after its resolution, speed, turning and friction, and three paths of five
    if (++doubles == 4 + 3 * 5 + 1) value += more_joule;
  }
  template <class T>
  void operator()(T&) {}
};

ForceMonitor damaged(ForceMonitor monitor, double more_joule) {
  Damage damage{.more_joule = more_joule};
  monitor.list(damage);
  return monitor;
}

TEST(WorkLaws, ADamagedAccountIsNotPlausible) {
  DeviceConfig config;
  config.monitor.v_max_m_per_s = 0.5;
  ForceMonitor monitor(config);
  TimePoint now{};
  for (int k = 0; k < 100; ++k) {
    now += 1ms;
    monitor.read(now, Vector3(1e-4 * k, 0, 0));
  }
  EXPECT_TRUE(monitor.is_account_plausible());
  EXPECT_TRUE(damaged(monitor, 1e-9).is_account_plausible());
  EXPECT_FALSE(damaged(monitor, 0.1).is_account_plausible());
  EXPECT_TRUE(monitor.is_ledger_plausible(monitor.joule()));
  EXPECT_FALSE(monitor.is_ledger_plausible(monitor.joule() + 0.1));
  EXPECT_TRUE(monitor.is_ledger_plausible(std::numeric_limits<double>::quiet_NaN()));
}

}  // namespace
}  // namespace palpate::device
