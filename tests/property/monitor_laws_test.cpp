// SPDX-License-Identifier: Apache-2.0
// The monitor's account against the clamp's ledger, which shares no code with it, and the monitor
// against every hand: what it passes is covered.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/core/random.h"
#include "device_node/monitor/force_monitor.h"
#include "mofc_node/controllers/energy_ledger.h"
#include "mofc_node/controllers/one_pool_clamp.h"

namespace palpate::device {
namespace {

/// Isotropic friction or friction per axis, some of it 0; an encoder that is exact or not.
DeviceProfile random_profile(Random& random) {
  const auto any = [&] { return random.chance(0.1) ? 0.0 : random.uniform(0.02, 0.3); };
  DeviceProfile profile{
      .viscous_newton_s_per_m = any(),
      .coulomb_newton = any(),
      .position_resolution_m = random.chance(0.2) ? 0.0 : random.uniform(5e-6, 5e-4)};
  if (random.chance(0.5)) {
    profile.per_axis = FrictionPerAxis{.viscous_newton_s_per_m = {any(), any(), any()},
                                       .coulomb_newton = {any(), any(), any()}};
  }
  return profile;
}

/// With such a profile, T_hold 2 ms, answers within 0.5 ms, and v_max 0.5 m/s or none.
DeviceConfig random_config(Random& random, double v_max_chance) {
  DeviceConfig config;
  config.profile = random_profile(random);
  config.reply = std::chrono::microseconds(500);
  config.lease = std::chrono::milliseconds(2);
  config.monitor.v_max_m_per_s =
      random.chance(v_max_chance) ? 0.5 : std::numeric_limits<double>::infinity();
  return config;
}

std::optional<controllers::AxisFriction> axes_of(const DeviceProfile& profile) {
  if (!profile.per_axis) return {};
  return controllers::AxisFriction{.f_d = profile.per_axis->viscous_newton_s_per_m,
                                   .f_co = profile.per_axis->coulomb_newton};
}

controllers::MofcParameters parameters_of(const DeviceProfile& profile) {
  return {.f_d = profile.viscous_newton_s_per_m, .f_co = profile.coulomb_newton, .T = 0.002};
}

Vector3 quantised(const Vector3& position_m, double q) {
  return q > 0.0 ? Vector3((position_m / q).array().round() * q) : position_m;
}

// So the monitor never reduces what an honest clamp grants, and never trusts more than it.
TEST(MonitorLaws, TheAccountIsTheClampsLedgerToRoundingAndNotBelowIt) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const DeviceProfile profile = random_profile(random);
    const double q = profile.position_resolution_m;
    const bool has_v_max = random.chance(0.5);
    const double v_max = has_v_max ? 0.5 : std::numeric_limits<double>::infinity();
    EnergyAccount account(profile);
    controllers::EnergyLedger ledger(parameters_of(profile), axes_of(profile), q);
    const controllers::OnePoolClamp clamp(parameters_of(profile), axes_of(profile), v_max);
    const WorstHand worst_hand(profile, v_max);

    Vector3 hand = Vector3::Zero();
    Vector3 velocity = Vector3::Zero();
    Vector3 force = Vector3::Zero();
    account.restart(quantised(hand, q), 0.0);
    ledger.restart(quantised(hand, q));
    double largest = 1e-3;
    for (int k = 0; k < 2000; ++k) {
      const double T = random.uniform(1e-4, 2e-3);
      if (random.chance(0.05)) velocity = random.uniform(0.0, 0.4) * random.direction();
      if (random.chance(0.5)) force = random.uniform(0.0, 3.3) * random.direction();
      if (random.chance(0.1)) force.setZero();
      hand += T * velocity;
      const Vector3 reading = quantised(hand, q);
      const double drain = worst_hand.drain_watt(force);
      EXPECT_TRUE(drain == clamp.drain_watt(force) ||
                  std::abs(drain - clamp.drain_watt(force)) < 1e-9 * drain + 1e-12);
      if (random.chance(0.1) && !force.isZero(0.0)) {
        const double acted = random.uniform() * T;
        account.book_release({.force_on_hand_newton = force,
                              .acted_s = acted,
                              .duration_s = T,
                              .position_at_end_m = reading,
                              .v_max_m_per_s = v_max,
                              .most_drawn_joule = acted * drain});
        if (!std::isfinite(drain)) {
          ledger.forfeit(reading);
        } else if (has_v_max) {
          ledger.book_release({.force_on_hand_newton = force,
                               .acted_s = acted,
                               .duration_s = T,
                               .hand_position_at_end_m = reading,
                               .v_max_m_per_s = v_max,
                               .most_drawn_joule = acted * drain});
        } else {
          ledger.book_unread(acted * drain, reading);
        }
      } else {
        account.book(T, force, reading);
        ledger.book(T, force, reading);
      }
      largest = std::max(largest, std::abs(ledger.energy_joule()));
      ASSERT_NEAR(account.joule(), ledger.energy_joule(), 1e-11 * largest) << "step " << k;
      ASSERT_GE(account.joule(), ledger.energy_joule() - 1e-14 * largest) << "step " << k;
    }
  }
}

TEST(MonitorLaws, WhatIsLeftOfACommandIsCoveredAndNoSmallerThanItMust) {
  int reduced = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const DeviceConfig config = random_config(random, 0.5);
    ForceMonitor monitor(config);
    const WorstHand worst_hand(config.profile, config.monitor.v_max_m_per_s);
    const double q = config.profile.position_resolution_m;
    TimePoint now{};
    Vector3 hand = Vector3::Zero();
    Vector3 velocity = Vector3::Zero();
    for (int k = 0; k < 300; ++k) {
      now += std::chrono::milliseconds(1);
      if (random.chance(0.05)) velocity = random.uniform(0.0, 0.4) * random.direction();
      hand += 1e-3 * velocity;
      monitor.read(now, quantised(hand, q));
      const Vector3 requested = random.uniform(0.0, 20.0) * random.direction();
      const Duration requested_lease = std::chrono::microseconds(random.below(20000) + 1);
      const ForceMonitor::Covered covered = monitor.cover(requested, requested_lease);
      const Vector3& F = covered.force_on_hand_newton;
      const double drain = worst_hand.drain_watt(F);

      EXPECT_LE(covered.lease, requested_lease);
      EXPECT_GE(covered.lease, std::min(requested_lease, config.lease));
      EXPECT_LE(F.norm(), requested.norm() * (1.0 + 1e-12));
      if (drain > 0.0) {
        EXPECT_LE(to_seconds(covered.lease) * drain,
                  std::max(0.0, monitor.joule()) * (1.0 + 1e-9) + 1e-9 * (1.0 + drain));
      }
      if (covered.is_reduced && F.norm() < 0.99 * requested.norm()) {
        ++reduced;
        const double more = to_seconds(covered.lease) * worst_hand.drain_watt(1.001 * F);
        EXPECT_TRUE(more == 0.0 || more > to_seconds(covered.lease) * drain);
      }
      monitor.switched(now, quantised(hand, q), F, covered.lease);
    }
  }
  EXPECT_GT(reduced, 10000);
}

/// Power that the hand puts in.
double watt(const DeviceProfile& profile, const Vector3& force_on_hand, const Vector3& velocity) {
  const double friction =
      profile.per_axis ? profile.per_axis->coulomb_newton.dot(velocity.cwiseAbs()) +
                             profile.per_axis->viscous_newton_s_per_m.dot(velocity.cwiseAbs2())
                       : profile.coulomb_newton * velocity.norm() +
                             profile.viscous_newton_s_per_m * velocity.squaredNorm();
  return friction - force_on_hand.dot(velocity);
}

// Hands that follow each force at the velocity that drains most, or move on; most encoders coarse.
TEST(MonitorLaws, WhatItCountsIsNeverMoreThanTheEnergyAndNeverLessThanTheLedger) {
  int floors = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const DeviceConfig config = random_config(random, 0.7);
    ForceMonitor monitor(config);
    const double q = config.profile.position_resolution_m;
    controllers::EnergyLedger ledger(parameters_of(config.profile), axes_of(config.profile), q);
    ledger.restart(Vector3::Zero());
    TimePoint now{};
    Vector3 hand = Vector3::Zero();
    Vector3 velocity = Vector3::Zero();
    Vector3 F = Vector3::Zero();
    double energy = 0.0;
    double largest = 1e-3;
    monitor.read(now, hand);
    for (int k = 0; k < 1000; ++k) {
      now += std::chrono::milliseconds(1);
      if (random.chance(0.05)) velocity = random.uniform(0.0, 0.45) * random.direction();
      if (!F.isZero(0.0) && random.chance(0.5)) {
        const double speed = std::min(0.5, random.uniform(0.0, F.norm() / 0.1));
        velocity = speed * F.normalized();
      }
      hand += 1e-3 * velocity;
      energy += 1e-3 * watt(config.profile, F, velocity);
      largest = std::max(largest, std::abs(energy));
      monitor.read(now, quantised(hand, q));
      ledger.book(1e-3, F, quantised(hand, q));
      ASSERT_LE(monitor.joule(), energy + 1e-11 * largest) << "step " << k;
      ASSERT_GE(monitor.joule(), ledger.energy_joule() - 1e-11 * largest) << "step " << k;
      ASSERT_GE(energy, -2e-8) << "step " << k;
      floors += monitor.joule() > ledger.energy_joule() + 1e-9 ? 1 : 0;
      // a command in every tick: no lease runs out
      Vector3 requested = F;
      if (random.chance(0.2)) requested = random.uniform(0.0, 5.0) * random.direction();
      if (random.chance(0.2)) requested.setZero();
      const ForceMonitor::Covered covered = monitor.cover(requested, config.lease);
      F = covered.force_on_hand_newton;
      monitor.switched(now, quantised(hand, q), F, covered.lease);
    }
  }
  EXPECT_GT(floors, 10000);
}

/// A clamp that asks in every tick for what passes as rounding, beyond the friction's own force and
/// whatever else is left, and a hand that follows it at the velocity that draws most. Judged by the
/// exact integral of the hand's power, without encoder.
/// @return least energy [J] that the hand has put in
double least_joule_of_roundings(double rate_hz, int ticks, bool asks_for_energy,
                                bool asks_for_lease, int lost_every) {
  constexpr double kAlmost = 0.97;
  constexpr double kCoulombNewton = 0.1;
  constexpr double kViscous = 0.1;
  DeviceConfig config;
  config.profile = {.viscous_newton_s_per_m = kViscous,
                    .coulomb_newton = kCoulombNewton,
                    .position_resolution_m = 0.0};
  const Duration period = from_seconds(1.0 / rate_hz);
  config.reply = period / 2;
  config.lease = 2 * period;
  config.monitor.v_max_m_per_s = 0.5;
  ForceMonitor monitor(config);
  const Duration lease = asks_for_lease ? Duration(1) : config.lease;

  TimePoint now{};
  Vector3 hand = Vector3::Zero();
  double energy = 0.0;
  double least = 0.0;
  Vector3 along = Vector3::UnitX();
  monitor.read(now, hand);
  for (int k = 0; k < ticks; ++k) {
    if (k % 50 == 0) along = -along;
    double excess = 0.0;
    if (asks_for_energy) excess = std::sqrt(4.0 * kViscous * kAlmost * 1e-9 / to_seconds(lease));
    if (asks_for_lease) excess = 400.0;
    const auto covered = monitor.cover((kCoulombNewton + excess) * along, lease);
    monitor.switched(now, hand, covered.force_on_hand_newton, covered.lease);
    if (lost_every > 0 && k % lost_every == lost_every - 1) monitor.lost();

    const Vector3 force = covered.force_on_hand_newton;
    const double beyond = std::max(0.0, force.norm() - kCoulombNewton);
    const double speed = std::min(0.5, beyond / (2.0 * kViscous));
    const double acts_s = to_seconds(std::min(covered.lease, period));
    energy += acts_s * (kViscous * speed - beyond) * speed;
    hand += acts_s * speed * along;
    least = std::min(least, energy);
    now += period;
    if (covered.lease < period) monitor.ended(hand);
    monitor.read(now, hand);
  }
  return least;
}

// 1 nJ and 1 ns · D(400 N) of the lease: once, however long and however often.
TEST(MonitorLaws, ItsRoundingsAreSpentOnce) {
  for (const double rate_hz : {50.0, 1000.0, 10000.0}) {
    const int minute = static_cast<int>(60.0 * rate_hz);
    EXPECT_GE(least_joule_of_roundings(rate_hz, minute, true, false, 0), -1.01e-9) << rate_hz;
    EXPECT_GE(least_joule_of_roundings(rate_hz, minute, true, false, 10), -1.01e-9) << rate_hz;
    EXPECT_GE(least_joule_of_roundings(rate_hz, minute, false, true, 0), -1e-9 - 1e-9 * 200.0)
        << rate_hz;
  }
}

// The roundings are there: an honest clamp, which computes in its own way, needs them.
TEST(MonitorLaws, TheRoundingsPassAtFirst) {
  EXPECT_LT(least_joule_of_roundings(1000.0, 3, true, false, 0), -0.4e-9);
}

}  // namespace
}  // namespace palpate::device
