// SPDX-License-Identifier: Apache-2.0
// The monitor's account: every rounding goes down, and by little more than it must. Exact energies
// are closed forms. A margin is 4 ε of its terms, and the rounding that it covers at most 1 ε.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "device_node/monitor/energy_account.h"

namespace palpate::device {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr int kSteps = 20'000;

EnergyAccount account_at_0(double viscous_newton_s_per_m, double coulomb_newton, double q_m) {
  EnergyAccount account({.viscous_newton_s_per_m = viscous_newton_s_per_m,
                         .coulomb_newton = coulomb_newton,
                         .position_resolution_m = q_m});
  account.restart(Vector3::Zero(), 0.0);
  return account;
}

/// How far below the exact energy [ε J].
double rounded_down_by(const EnergyAccount& account, long double exact_joule) {
  return static_cast<double>((exact_joule - account.joule()) / kEpsilon);
}

/// Of a sum that grows by equal terms to 1, each of `kSteps` partial sums rounded down by 4 ε.
constexpr double kGrowing = 4.0 * kSteps / 2;

/// These steps drift up or down where nothing rounds them [m].
constexpr double kStepsM[] = {1e-4, 1.1e-4, 1.3e-4, 1.7e-4, 1.9e-4};

TEST(EnergyAccount, IsZeroBeforeItsFirstReading) {
  EXPECT_EQ(EnergyAccount({}).joule(), 0.0);
  EXPECT_EQ(EnergyAccount({.per_axis = FrictionPerAxis{.coulomb_newton = Vector3::Ones()}}).joule(),
            0.0);
}

TEST(EnergyAccount, RoundsOneStepDown) {
  EnergyAccount carried = account_at_0(0.0, 0.0, 0.0);
  carried.restart(Vector3::Zero(), -1.0);
  EXPECT_NEAR(rounded_down_by(carried, -1.0L), 4.0, 1.0);

  for (const double sign : {-1.0, 1.0}) {
    EnergyAccount work = account_at_0(0.0, 0.0, 0.0);
    work.book(1e-3, Vector3(sign, 0, 0), Vector3(1, 0, 0));
    EXPECT_NEAR(rounded_down_by(work, -sign), 8.0 + 4.0, 1.0) << sign;
  }

  // what friction is at least, the work of it and its sum, the account
  EnergyAccount coulomb = account_at_0(0.0, 1.0, 0.0);
  coulomb.book(1e-3, Vector3::Zero(), Vector3(1, 0, 0));
  EXPECT_NEAR(rounded_down_by(coulomb, 1.0L), 4.0 * 4, 1.0);

  // d² with d a little more than w
  const double d_m = 1.8;
  EnergyAccount viscous = account_at_0(1.0, 0.0, 1.0);
  viscous.book(1.0, Vector3::Zero(), Vector3(d_m, 0, 0));
  const long double beyond_m = d_m - std::sqrt(3.0L);
  const double expected = static_cast<double>(2.0L * beyond_m) * 4.0 * (d_m + std::sqrt(3.0));
  EXPECT_NEAR(rounded_down_by(viscous, beyond_m * beyond_m), expected, 0.3 * expected);
}

TEST(EnergyAccount, RoundsTheSumOfTheWorkDown) {
  for (const double step_m : kStepsM) {
    for (const double newton : {-0.7, 0.7}) {
      EnergyAccount account = account_at_0(0.0, 0.0, 0.0);
      for (int i = 1; i <= kSteps; ++i) {
        account.book(1e-3, Vector3(newton, 0, 0), Vector3(i * step_m, 0, 0));
      }
      const long double exact = -static_cast<long double>(newton) * (kSteps * step_m);
      EXPECT_NEAR(rounded_down_by(account, exact) / std::abs(static_cast<double>(exact)), kGrowing,
                  0.25 * kGrowing)
          << step_m;
    }
  }
  // to and fro: the sum is one term or 0, and each step adds one
  EnergyAccount account = account_at_0(0.0, 0.0, 0.0);
  for (int i = 1; i <= kSteps; ++i) {
    account.book(1e-3, Vector3(-1, 0, 0), Vector3(i % 2 == 0 ? 0.0 : 0.3, 0, 0));
  }
  const double expected = 4.0 * 0.3 * 1.5 * kSteps;
  EXPECT_NEAR(rounded_down_by(account, 0.0L), expected, 0.25 * expected);
}

TEST(EnergyAccount, RoundsTheCostOfChangesOfTheForceUp) {
  for (const double newton : {0.1, 0.3, 0.7}) {
    EnergyAccount account = account_at_0(0.0, 0.0, 1.0);
    for (int i = 1; i <= kSteps; ++i) {
      account.book(1e-3, Vector3(0, i % 2 == 0 ? newton : -newton, 0), Vector3::Zero());
    }
    const long double cost = 0.5L * (1.0L + 1.0L + 2.0L * (kSteps - 1)) * newton;
    EXPECT_NEAR(rounded_down_by(account, -cost) / static_cast<double>(cost), kGrowing,
                0.25 * kGrowing);
    // what does not change costs nothing
    const double before = account.joule();
    for (int i = 0; i < 100; ++i) account.book(1e-3, Vector3(0, newton, 0), Vector3::Zero());
    EXPECT_EQ(account.joule(), before);
  }
}

TEST(EnergyAccount, RoundsTheSumsOfFrictionDown) {
  for (const double step_m : kStepsM) {
    EnergyAccount coulomb = account_at_0(0.0, 1.0, 0.0);
    EnergyAccount viscous = account_at_0(1.0, 0.0, 0.0);
    for (int i = 1; i <= kSteps; ++i) {
      coulomb.book(1e-3, Vector3::Zero(), Vector3(0, i * step_m, 0));
      viscous.book(step_m, Vector3::Zero(), Vector3(0, i * step_m, 0));
    }
    const long double exact = kSteps * static_cast<long double>(step_m);
    const auto length = static_cast<double>(exact);
    EXPECT_NEAR(rounded_down_by(coulomb, exact) / length, kGrowing, 0.25 * kGrowing) << step_m;
    EXPECT_NEAR(rounded_down_by(viscous, exact) / length, kGrowing, 0.25 * kGrowing) << step_m;
  }
}

// 1 m after a long rest, in one window.
TEST(EnergyAccount, RoundsTheTimeOfAWindowUp) {
  for (const double step_s : kStepsM) {
    EnergyAccount account = account_at_0(1.0, 0.0, 1e-3);
    for (int i = 1; i < kSteps; ++i) account.book(step_s, Vector3::Zero(), Vector3::Zero());
    account.book(step_s, Vector3::Zero(), Vector3(1, 0, 0));
    const long double moved_m = 1.0L - std::sqrt(3.0L) * 1e-3;
    const long double exact = moved_m * moved_m / (kSteps * static_cast<long double>(step_s));
    EXPECT_NEAR(rounded_down_by(account, exact) / static_cast<double>(exact), kGrowing,
                0.25 * kGrowing)
        << step_s;
  }
}

// 200 q in steps of q/100, on one axis: friction acts against the hand once that has moved q/2 for
// sure, and half a count of it is not known where it begins and where it ends.
TEST(EnergyAccount, RoundsTheWorkAgainstFrictionDown) {
  EnergyAccount account = account_at_0(0.0, 1.0, 1.0);
  double path_m = 0.0;
  for (int i = 1; i <= kSteps; ++i) {
    account.book(1e-3, Vector3::Zero(), Vector3(0, 0, 0.01 * i));
    if (0.01 * i > 0.5) path_m += 0.01 * i - 0.01 * (i - 1);
  }
  const double exact = path_m - 1.0;
  EXPECT_NEAR(rounded_down_by(account, exact) / exact, kGrowing, 0.5 * kGrowing);

  const double before = account.joule();
  for (int i = 0; i < 100; ++i) account.book(1e-3, Vector3::Zero(), account.position_m());
  EXPECT_EQ(account.joule(), before);
}

// On three axes the squares of the shares of friction sum to one.
TEST(EnergyAccount, CountsTheWholePathOfADiagonal) {
  EnergyAccount account = account_at_0(0.0, 1.0, 1.0);
  for (int i = 1; i <= 1000; ++i) account.book(1e-3, Vector3::Zero(), Vector3(i, i, i));
  EXPECT_NEAR(account.joule(), std::sqrt(3.0) * (1000.0 - 1.0), 1e-9);
}

/// After a release of 1 N along x that had acted for a while, v_max 1 m/s.
EnergyAccount account_released(double acted_s, double duration_s, const Vector3& position_m,
                               double most_drawn_joule = kInfinite) {
  EnergyAccount account = account_at_0(0.0, 0.0, 0.0);
  account.book_release({.force_on_hand_newton = Vector3(1, 0, 0),
                        .acted_s = acted_s,
                        .duration_s = duration_s,
                        .position_at_end_m = position_m,
                        .v_max_m_per_s = 1.0,
                        .most_drawn_joule = most_drawn_joule});
  return account;
}

// One of the lengths is much larger than the distance at which the force can have ended.
TEST(EnergyAccount, RoundsTheWorkOfAReleaseDown) {
  const EnergyAccount way_back = account_released(1.0, 1001.0, Vector3::Zero());
  EXPECT_NEAR(rounded_down_by(way_back, -1.0L), 4000.0, 100.0);
  const EnergyAccount reach = account_released(1000.0, 1000.0, Vector3::Zero());
  EXPECT_NEAR(rounded_down_by(reach, 0.0L), 4000.0, 100.0);
  const EnergyAccount moved = account_released(1.0, 1.0, Vector3(0, 1000, 0));
  EXPECT_NEAR(rounded_down_by(moved, 0.0L), 4000.0, 100.0);
}

TEST(EnergyAccount, AReleaseCostsAtMostWhatTheForceCanHaveDrawn) {
  EXPECT_NEAR(account_released(1.0, 2.0, Vector3::Zero(), 0.25).joule(), -0.25, 1e-14);
  EXPECT_NEAR(account_released(1.0, 2.0, Vector3::Zero(), 2.0).joule(), -1.0, 1e-14);

  EnergyAccount in_debt = account_at_0(0.0, 0.0, 0.0);
  in_debt.restart(Vector3::Zero(), -1.0);
  in_debt.book_release({.force_on_hand_newton = Vector3(1, 0, 0),
                        .acted_s = 1.0,
                        .duration_s = 2.0,
                        .position_at_end_m = Vector3::Zero(),
                        .v_max_m_per_s = kInfinite,
                        .most_drawn_joule = 0.5});
  // the debt, the difference, the account
  EXPECT_NEAR(rounded_down_by(in_debt, -1.5L), 4.0 + 6.0 + 6.0, 3.0);
}

// 1 N for at least 1 ms and at most 9 of 10 ms, v_max 1 m/s, the hand back where it was: it can
// have been 5 mm further on at 5 ms. 2 mm further on at the end: 6 mm at 6 ms.
TEST(EnergyAccount, AForceThatEndedAtAnUnknownTimeIsBookedAtTheWorstOne) {
  const auto booked = [](double least_s, double most_s, double end_m) {
    EnergyAccount account = account_at_0(0.0, 0.0, 0.0);
    account.book_release({.force_on_hand_newton = Vector3(1, 0, 0),
                          .acted_s = least_s,
                          .acted_at_most_s = most_s,
                          .duration_s = 10e-3,
                          .position_at_end_m = Vector3(end_m, 0, 0),
                          .v_max_m_per_s = 1.0,
                          .most_drawn_joule = kInfinite});
    return account.joule();
  };
  EXPECT_NEAR(booked(1e-3, 9e-3, 0.0), -5e-3, 1e-12);
  EXPECT_NEAR(booked(1e-3, 9e-3, 2e-3), -6e-3, 1e-12);
  // the bounds of the time hold
  EXPECT_NEAR(booked(1e-3, 4e-3, 0.0), -4e-3, 1e-12);
  EXPECT_NEAR(booked(8e-3, 9e-3, 0.0), -2e-3, 1e-12);
  EXPECT_NEAR(booked(1e-3, 1e-3, 0.0), -1e-3, 1e-12);
}

// v 0.5 m/s, 1 ms: 0.5 mm. 2 N, then 1 N, then none: 2 N + 1 N + 1 N.
TEST(EnergyAccount, AReadingThatIsNotOfTheSwitchCostsWhatAHandMovesMeanwhile) {
  EnergyAccount account(
      {.viscous_newton_s_per_m = 0.0, .coulomb_newton = 0.0, .position_resolution_m = 0.0}, 0.5);
  const auto book = [&](double newton) {
    account.next_reading(1e-3, 0.0, Vector3::Zero());
    account.book(1e-3, Vector3(newton, 0, 0), Vector3::Zero());
  };
  account.next_reading(1e-3, 0.0, Vector3::Zero());
  account.restart(Vector3::Zero(), 0.0);
  book(2.0);
  EXPECT_NEAR(account.joule(), -2.0 * 2.0 * 5e-4, 1e-12) << "its begin, and its end now";
  book(2.0);
  EXPECT_NEAR(account.joule(), -2.0 * 2.0 * 5e-4, 1e-12) << "a steady force costs nothing";
  book(1.0);
  book(0.0);
  EXPECT_NEAR(account.joule(), -(2.0 + 1.0 + 1.0) * 5e-4, 1e-12);
}

// The arm has turned: the same force needs other currents, and each message changes it by 0.2 N.
// 0.5 mm, and 2 % more because a force 0.5 mm away is 20 % · 0.1 larger.
TEST(EnergyAccount, ASteadyForceOfCurrentsThatTurnIsChargedWithWhatEachMessageChanges) {
  EnergyAccount account(
      {.viscous_newton_s_per_m = 0.0, .coulomb_newton = 0.0, .position_resolution_m = 0.0}, 0.5,
      40.0);
  const Vector3 force_newton(2, 0, 0);
  account.next_reading(1e-3, 0.0, Vector3::Zero());
  account.restart(Vector3::Zero(), 0.0);
  for (int i = 0; i < 3; ++i) {
    account.next_reading(1e-3, 0.0, Vector3(0, 0.2, 0));
    account.book(1e-3, force_newton, Vector3::Zero());
  }
  const double begin_and_end_newton = 2.0 + Vector3(2, 0.2, 0).norm();
  EXPECT_NEAR(account.joule(), -(begin_and_end_newton + 2 * 0.2) * 5e-4 * 1.02, 1e-12);
}

// Encoder steps of 1 mm: |G|₁ at the begin, at the end, and what each message changes.
TEST(EnergyAccount, StepsOfTheEncoderAreChargedWithWhatEachMessageChanges) {
  EnergyAccount account(
      {.viscous_newton_s_per_m = 0.0, .coulomb_newton = 0.0, .position_resolution_m = 1e-3});
  account.restart(Vector3::Zero(), 0.0);
  for (int i = 0; i < 3; ++i) {
    account.next_reading(0.0, 0.0, Vector3(0, 0.2, 0));
    account.book(1e-3, Vector3(2, 0, 0), Vector3::Zero());
  }
  EXPECT_NEAR(account.joule(), -0.5e-3 * (2.0 + 2.2 + 2 * 0.2), 1e-12);
}

// 2 N that are up to 3 N elsewhere, and end nobody knows where: 3 N over all of the way there.
TEST(EnergyAccount, AnEndThatNobodySeesOfCurrentsThatTurnCostsTheMostTheyCanBe) {
  EnergyAccount account = account_at_0(0.0, 0.0, 0.0);
  const auto booked = [&](double held_ratio, const Vector3& end_m) {
    account.restart(Vector3::Zero(), 0.0);
    account.book_release({.force_on_hand_newton = Vector3(2, 0, 0),
                          .acted_s = 1e-3,
                          .acted_at_most_s = 9e-3,
                          .duration_s = 10e-3,
                          .position_at_end_m = end_m,
                          .v_max_m_per_s = 1.0,
                          .held_ratio = held_ratio,
                          .most_drawn_joule = kInfinite});
    return account.joule();
  };
  EXPECT_NEAR(booked(1.0, Vector3::Zero()), -2.0 * 5e-3, 1e-12);
  EXPECT_NEAR(booked(1.5, Vector3::Zero()), -3.0 * 5e-3, 1e-12);
  EXPECT_NEAR(booked(1.5, Vector3(0, 2e-3, 0)), -3.0 * 6e-3, 1e-12) << "whatever the direction";
  EXPECT_EQ(booked(kInfinite, Vector3::Zero()), 0.0) << "not known: no credit is left";
}

// 1 m in 1 s, the first reading up to 1 s older: 2 s. 0.1 N·s/m · 1 m² / 2 s.
TEST(EnergyAccount, AReadingThatMayBeOlderCountsLessViscousLoss) {
  EnergyAccount account(
      {.viscous_newton_s_per_m = 0.1, .coulomb_newton = 0.0, .position_resolution_m = 0.0}, 0.5);
  account.next_reading(1.0, 0.0, Vector3::Zero());
  account.restart(Vector3::Zero(), 0.0);
  account.next_reading(1.0, 0.0, Vector3::Zero());
  account.book(1.0, Vector3::Zero(), Vector3(1, 0, 0));
  EXPECT_NEAR(account.joule(), 0.05, 1e-12);
}

TEST(EnergyAccount, WhatHeldCurrentsGaveBeyondTheForceIsSubtractedAndNoneAdded) {
  EnergyAccount account = account_at_0(0.0, 0.0, 0.0);
  account.next_reading(0.0, 0.25, Vector3::Zero());
  account.book(1e-3, Vector3(1, 0, 0), Vector3(1, 0, 0));
  EXPECT_NEAR(account.joule(), -1.25, 1e-12);
  account.next_reading(0.0, -0.25, Vector3::Zero());
  account.book(1e-3, Vector3(1, 0, 0), Vector3(1, 0, 0));
  EXPECT_NEAR(account.joule(), -1.25, 1e-12);
}

}  // namespace
}  // namespace palpate::device
