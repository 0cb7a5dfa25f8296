// SPDX-License-Identifier: Apache-2.0
// The ledger never exceeds the true energy, for any hand and any encoder.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "mofc_node/controllers/energy_ledger.h"
#include "mofc_node/controllers/one_pool_clamp.h"
#include "tests/property/controller_cases.h"

namespace palpate::controllers {
namespace {

/// The ledger without the quantisation terms: (8) in vector form on the measured positions.
struct NaiveLedger {
  Hand hand;  // its friction
  Vector3 position_m;
  double energy_joule = 0.0;
  void book(double duration_s, const Vector3& force_on_hand, const Vector3& measured) {
    const Vector3 d = measured - position_m;
    energy_joule += duration_s * hand.friction_watt(d / duration_s) - force_on_hand.dot(d);
    position_m = measured;
  }
};

struct LedgerRun {
  double worst_excess_joule = -std::numeric_limits<double>::infinity();  // of E′ over the truth
  double worst_naive_excess_joule = worst_excess_joule;
};

/// One hand, any held forces, intervals of 0.5 … 1.5 T in one to three stretches.
LedgerRun run_ledger(std::uint64_t seed, double q, bool is_per_axis) {
  Random random(seed);
  const MofcParameters p = random_parameters(random);
  Hand hand{.f_d = p.f_d, .f_co = p.f_co, .position_m = 0.1 * random.direction()};
  if (is_per_axis) hand.per_axis = random_axis_friction(random);
  HandStrategy strategy(random, q);
  EnergyLedger ledger(p, hand.per_axis, q);
  ledger.restart(quantised(hand.position_m, q));
  NaiveLedger naive{hand, quantised(hand.position_m, q)};
  LedgerRun run;
  Vector3 force = Vector3::Zero();

  for (int k = 0; k < 1000; ++k) {
    if (random.chance(0.03)) strategy.change();
    double left_s = random.uniform(0.5, 1.5) * p.T;
    for (std::uint64_t stretches = 1 + random.below(3); stretches > 0; --stretches) {
      if (random.chance(0.5)) force = random.uniform(0.0, 5.0) * random.direction();
      if (random.chance(0.2)) force.setZero();
      const double duration_s = stretches == 1 ? left_s : random.uniform(0.1, 0.9) * left_s;
      left_s -= duration_s;
      strategy.move(hand, duration_s, force);
      const Vector3 measured = quantised(hand.position_m, q);
      ledger.book(duration_s, force, measured);
      naive.book(duration_s, force, measured);
      run.worst_excess_joule =
          std::max(run.worst_excess_joule, ledger.energy_joule() - hand.energy_joule);
      run.worst_naive_excess_joule =
          std::max(run.worst_naive_excess_joule, naive.energy_joule - hand.energy_joule);
    }
  }
  return run;
}

TEST(LedgerLaws, TheLedgerNeverExceedsTheTrueEnergy) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const double q = seed % 5 == 0 ? 0.0 : Random(~seed).uniform(0.0, 0.5e-3);
    EXPECT_LE(run_ledger(seed, q, false).worst_excess_joule, kRoundingJoule);
    EXPECT_LE(run_ledger(seed, q, true).worst_excess_joule, kRoundingJoule);
  }
}

/// As above with forces that end unread: a hand no faster than v_max, often along the force while
/// it acts and back afterwards. The ledger is told `claimed` times that speed.
/// @return the most by which E′ exceeds the truth
double excess_with_releases_joule(std::uint64_t seed, bool is_per_axis, double claimed) {
  Random random(seed);
  const MofcParameters p = random_parameters(random);
  const double q = seed % 5 == 0 ? 0.0 : random.uniform(0.0, 0.5e-3);
  Hand hand{.f_d = p.f_d, .f_co = p.f_co, .position_m = 0.1 * random.direction()};
  hand.v_max_m_per_s = random.uniform(0.1, 1.0);
  if (is_per_axis) hand.per_axis = random_axis_friction(random);
  const OnePoolClamp drain(p, hand.per_axis, hand.v_max_m_per_s);
  HandStrategy strategy(random, q);
  EnergyLedger ledger(p, hand.per_axis, q);
  ledger.restart(quantised(hand.position_m, q));
  double excess_joule = -std::numeric_limits<double>::infinity();

  for (int k = 0; k < 500; ++k) {
    if (random.chance(0.1)) strategy.change();
    const double duration_s = random.uniform(0.5, 1.5) * p.T;
    const Vector3 force = random.uniform(0.0, 3.0) * random.direction();
    if (random.chance(0.5)) {
      strategy.move(hand, duration_s, force);
      ledger.book(duration_s, force, quantised(hand.position_m, q));
    } else {
      const double acted_s = random.uniform() * duration_s;
      if (random.chance(0.5)) {
        const Vector3 u = force.normalized();
        hand.move(acted_s, hand.v_max_m_per_s * u, force);
        hand.move(duration_s - acted_s, -random.uniform(0.0, hand.v_max_m_per_s) * u,
                  Vector3::Zero());
      } else {
        strategy.move(hand, acted_s, force);
        strategy.move(hand, duration_s - acted_s, Vector3::Zero());
      }
      // the worst case of a hand that is faster than it claims would hide the claim
      const double most_joule = claimed < 1.0 ? 1e9 : acted_s * drain.drain_watt(force);
      ledger.book_release({.force_on_hand_newton = force,
                           .acted_s = acted_s,
                           .duration_s = duration_s,
                           .hand_position_at_end_m = quantised(hand.position_m, q),
                           .v_max_m_per_s = claimed * hand.v_max_m_per_s,
                           .most_drawn_joule = most_joule});
    }
    excess_joule = std::max(excess_joule, ledger.energy_joule() - hand.energy_joule);
  }
  return excess_joule;
}

TEST(LedgerLaws, AForceThatEndsUnreadNeverLiftsTheLedgerAboveTheTrueEnergy) {
  for (const std::uint64_t seed : seeds(600)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    EXPECT_LE(excess_with_releases_joule(seed, false, 1.0), kRoundingJoule);
    EXPECT_LE(excess_with_releases_joule(seed, true, 1.0), kRoundingJoule);
  }
}

// The law above can fail.
TEST(LedgerLaws, WithAHandFasterThanAssumedAForceThatEndsUnreadLiftsTheLedgerAboveTheTruth) {
  int lifted = 0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    if (excess_with_releases_joule(seed, false, 0.3) > 1e-4) ++lifted;
  }
  EXPECT_GT(lifted, 25);
}

// The sum without the quantisation terms is right for an exact encoder only: a hand that goes to
// and fro across the edge of a step of the encoder is booked q each time, and hardly moves.
TEST(LedgerLaws, TheNaiveSumExceedsTheTrueEnergyUnlessTheEncoderIsExact) {
  for (const bool is_per_axis : {false, true}) {
    double worst_joule = 0.0;
    for (std::uint64_t seed = 1; seed <= 50; ++seed) {
      SCOPED_TRACE(testing::Message() << "seed=" << seed << " per axis: " << is_per_axis);
      EXPECT_LE(run_ledger(seed, 0.0, is_per_axis).worst_naive_excess_joule, kRoundingJoule);
      worst_joule =
          std::max(worst_joule, run_ledger(seed, 0.5e-3, is_per_axis).worst_naive_excess_joule);
    }
    EXPECT_GT(worst_joule, 10e-3);
  }
}

// Staircases too, whose axes move in turn.
TEST(LedgerLaws, WithAnExactEncoderTheLedgerIsTheSumOfThePaper) {
  for (const std::uint64_t seed : seeds(50)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const MofcParameters p = random_parameters(random);
    Hand hand{.f_d = p.f_d, .f_co = p.f_co};
    if (seed % 2 == 0) hand.per_axis = random_axis_friction(random);
    EnergyLedger ledger(p, hand.per_axis, 0.0);
    ledger.restart(Vector3::Zero());
    NaiveLedger sum{hand, Vector3::Zero()};
    Vector3 x = Vector3::Zero();
    for (int k = 0; k < 300; ++k) {
      const Vector3 step = 1e-3 * random.direction();
      x[static_cast<int>(random.below(3))] += step.x();
      const double duration_s = random.uniform(0.5, 1.5) * p.T;
      const Vector3 force = random.uniform(0.0, 3.0) * random.direction();
      ledger.book(duration_s, force, x);
      sum.book(duration_s, force, x);
      ASSERT_NEAR(ledger.energy_joule(), sum.energy_joule, 1e-12 + 1e-12 * sum.energy_joule);
    }
  }
}

// A hand whose readings are whole counts is somewhere in its count. The least energy that it can
// have put in is a line over the count, so at each reading it is at one end or the other: the least
// over all such ways is what the ledger says.
TEST(LedgerLaws, OnOneAxisNoLargerBoundHolds) {
  for (const std::uint64_t seed : seeds(50)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const double q = std::ldexp(1.0, -12);
    const double f_co = random.uniform(0.0, 0.5);
    EnergyLedger ledger(0.0, f_co, q);
    ledger.restart(Vector3::Zero());
    double count = 0.0;
    double force = 0.0;  // on the environment
    std::array<double, 2> least_joule{};
    for (int k = 0; k < 1000; ++k) {
      const double before = count;
      // a first step tells the ledger the axis
      if (k == 0 || random.chance(0.4)) count += static_cast<double>(random.below(5)) - 2.0;
      if (k == 0) count = 1.0;
      if (random.chance(0.7)) force += random.uniform(-0.4, 0.4);
      std::array<double, 2> next_joule{};
      for (int to = 0; to < 2; ++to) {
        double joule = std::numeric_limits<double>::infinity();
        for (int from = 0; from < 2; ++from) {
          const double moved = q * (count + to - before - from);
          joule = std::min(joule, least_joule.at(static_cast<std::size_t>(from)) + force * moved +
                                      f_co * std::abs(moved));
        }
        next_joule.at(static_cast<std::size_t>(to)) = joule;
      }
      least_joule = next_joule;
      ledger.book(1e-3, {0.0, -force, 0.0}, {0.0, q * count, 0.0});
      ASSERT_NEAR(ledger.energy_joule(), std::min(least_joule[0], least_joule[1]), 1e-12);
    }
  }
}

/// A hand presses 8 mm to and fro once a second for 10 s, read in counts of 0.3 mm, against 1 N,
/// with a trembling force of ±`tremor_newton` on top. @return E′ at the end
double earned_under_tremor_joule(double tremor_newton) {
  const double q = 3e-4;
  Random random(1);
  EnergyLedger ledger(0.0, 0.1, q);
  ledger.restart(Vector3::Zero());
  for (int k = 1; k <= 10000; ++k) {
    const double x = 8e-3 * std::sin(2.0 * std::numbers::pi * 1e-3 * k);
    const double force = k < 10000 ? -1.0 + random.uniform(-tremor_newton, tremor_newton) : 0.0;
    ledger.book(1e-3, {0.0, 0.0, force}, quantised({0.0, 0.0, x}, q));
  }
  return ledger.energy_joule();
}

// 0.32 m against 0.1 N dissipate 32 mJ. Counted apart from friction, changes within ±0.05 N would
// cost (q/2)·33 mN a tick, 50 mJ, and those within ±0.1 N 100 mJ; so they cost once a count.
TEST(LedgerLaws, AForceThatTremblesWithinFrictionCostsOnceACount) {
  const double steady_joule = earned_under_tremor_joule(0.0);
  EXPECT_GE(steady_joule, 28e-3);
  EXPECT_LE(steady_joule, 32e-3);
  EXPECT_GE(earned_under_tremor_joule(0.05), 18e-3);
  EXPECT_GE(earned_under_tremor_joule(0.1), 6e-3);
}

/// The energy booked for 0.3 s straight down at 0.1 m/s, measured at 0.055 mm, after `before_s` on
/// a circle.
double earned_after_circling_joule(double before_s) {
  const double T = 1e-3;
  const double q = 55e-6;
  EnergyLedger ledger(0.1, 0.1, q);
  ledger.restart(Vector3::Zero());
  Vector3 x = Vector3::Zero();
  for (int k = 1; k <= std::lround(before_s / T); ++k) {
    const double angle = std::numbers::pi * k * T;  // 0.5 Hz
    x = 0.02 * Vector3(0.9 * std::sin(angle), 0.4 * std::sin(angle), 1.0 - std::cos(angle));
    ledger.book(T, Vector3::Zero(), quantised(x, q));
  }
  const double before_joule = ledger.energy_joule();
  for (int k = 1; k <= 300; ++k) {
    ledger.book(T, Vector3::Zero(), quantised(x - Vector3(0.0, 0.0, 0.1 * k * T), q));
  }
  return ledger.energy_joule() - before_joule;
}

// 30 mm at 0.1 m/s: 0.1·0.03 + 0.1·0.01·0.3 = 3.3 mJ truly, whatever was before.
TEST(LedgerLaws, TheEnergyOfAMotionDoesNotDependOnHowLongTheHandMovedBefore) {
  const double least_joule = 0.9 * 3.3e-3;
  for (const double before_s : {0.0, 2.0, 14.0, 40.0, 600.0}) {
    SCOPED_TRACE(testing::Message() << before_s << " s");
    EXPECT_GE(earned_after_circling_joule(before_s), least_joule);
    EXPECT_LE(earned_after_circling_joule(before_s), 3.3e-3);
  }
}

}  // namespace
}  // namespace palpate::controllers
