// SPDX-License-Identifier: Apache-2.0
// The equations of the controllers against numbers computed by hand.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "mofc_node/controllers/energy_ledger.h"
#include "mofc_node/controllers/guard_mofc.h"
#include "mofc_node/controllers/mofc_equations.h"
#include "mofc_node/controllers/one_pool_clamp.h"
#include "mofc_node/controllers/paper_mofc.h"
#include "mofc_node/controllers/vector_mofc.h"

namespace palpate::controllers {
namespace {

constexpr MofcParameters kOmni{.f_d = 0.1, .f_co = 0.1, .T = 0.02};

ControlInput input_at(const Vector3& x, const std::vector<AppliedStretch>& applied,
                      const Vector3& requested) {
  return {.hand_position_m = x,
          .applied = applied,
          .has_gap = false,
          .acting_force_on_hand_newton =
              applied.empty() ? Vector3(Vector3::Zero()) : applied.back().force_on_hand_newton,
          .requested_force_on_hand_newton = requested};
}

// (10): f_d d²/T + f_co|d| + f d with d = 2 mm, T = 20 ms, f = −0.5 N:
// 0.1·4e−6/0.02 + 0.1·2e−3 − 0.5·2e−3 = 2e−5 + 2e−4 − 1e−3 = −7.8e−4 J
TEST(MofcEquations, IntervalEnergyIsEquation10) {
  EXPECT_NEAR(interval_energy_joule(0.1, 0.1, 0.02, 2e-3, -0.5), -7.8e-4, 1e-15);
}

// (12): |f| = 0.5, f_co = 0.1, f_d = 0.1: v* = −(0.5 − 0.1)/0.2 = −2 m/s; below f_co it is 0
TEST(MofcEquations, MostDrainingVelocityIsEquation12) {
  EXPECT_NEAR(most_draining_velocity_m_per_s(kOmni, 0.5), -2.0, 1e-12);
  EXPECT_NEAR(most_draining_velocity_m_per_s(kOmni, -0.5), 2.0, 1e-12);
  EXPECT_EQ(most_draining_velocity_m_per_s(kOmni, 0.09), 0.0);
}

// at v* the interval's energy is −T (|f| − f_co)²/(4 f_d) = −0.02·0.16/0.4 = −8 mJ, its minimum
TEST(MofcEquations, NoVelocityDrainsMoreThanTheMostDrainingOne) {
  const double f = 0.5;
  const double d_star = kOmni.T * most_draining_velocity_m_per_s(kOmni, f);
  const double worst = interval_energy_joule(kOmni.f_d, kOmni.f_co, kOmni.T, d_star, f);

  EXPECT_NEAR(worst, -8e-3, 1e-12);
  EXPECT_NEAR(worst, -kOmni.T * drain_watt(kOmni, f), 1e-12);
  for (double d = -0.1; d <= 0.1; d += 1e-4) {
    EXPECT_GE(interval_energy_joule(kOmni.f_d, kOmni.f_co, kOmni.T, d, f), worst - 1e-15);
  }
}

// (13): E′ = 8 mJ gives back f_co + 2 √(0.1·8e−3/0.02) = 0.1 + 0.4 = 0.5 N
TEST(MofcEquations, MaximumForceIsEquation13) {
  EXPECT_NEAR(maximum_force_newton(kOmni, 8e-3), 0.5, 1e-12);
  EXPECT_NEAR(maximum_force_newton(kOmni, 0.0), 0.1, 1e-15);
  EXPECT_NEAR(maximum_force_newton(kOmni, -1.0), 0.1, 1e-15);
}

TEST(MofcEquations, OutputForceIsEquation14) {
  EXPECT_EQ(output_force_newton(0.3, 0.5), 0.3);
  EXPECT_EQ(output_force_newton(0.7, 0.5), 0.5);
  EXPECT_EQ(output_force_newton(-0.7, 0.5), -0.5);
}

// At the clamp the worst next interval brings the energy to exactly 0, inside it stays above.
TEST(MofcEquations, TheBoundIsTight) {
  for (const double energy : {0.0, 1e-4, 3e-3, 0.2}) {
    const double f = maximum_force_newton(kOmni, energy);
    const double d = kOmni.T * most_draining_velocity_m_per_s(kOmni, f);
    EXPECT_NEAR(energy + interval_energy_joule(kOmni.f_d, kOmni.f_co, kOmni.T, d, f), 0.0, 1e-15);
    EXPECT_GT(energy + interval_energy_joule(kOmni.f_d, kOmni.f_co, kOmni.T, d, 0.9 * f), -1e-15);
  }
}

// A hand of 0.5 m/s at most. 1 N: v* = 0.9/0.2 = 4.5 m/s is cut to 0.5: (0.9 − 0.1·0.5)·0.5
// = 0.425 W. 0.25 N: 0.75 m/s is cut too: (0.15 − 0.05)·0.5 = 0.05 W.
// 0.15 N: v* = 0.25 m/s, as without: 0.05²/0.4 = 6.25 mW. f_d = 0: 0.9·0.5 = 0.45 W
TEST(MofcEquations, DrainOfAHandOfBoundedSpeed) {
  EXPECT_NEAR(drain_watt(kOmni, 1.0, 0.5), 0.425, 1e-15);
  EXPECT_NEAR(drain_watt(kOmni, 0.25, 0.5), 0.05, 1e-15);
  EXPECT_NEAR(drain_watt(kOmni, 0.15, 0.5), 6.25e-3, 1e-15);
  EXPECT_EQ(drain_watt(kOmni, 0.1, 0.5), 0.0);
  EXPECT_NEAR(drain_watt({.f_d = 0.0, .f_co = 0.1, .T = 0.02}, 1.0, 0.5), 0.45, 1e-15);
}

// The seam is f_d T v_max² = 0.1·0.02·0.25 = 0.5 mJ: 0.1 + 2·√(0.1·5e−4/0.02) = 0.2 N.
// 0.125 mJ is below it: 0.1 + 2·√(0.1·1.25e−4/0.02) = 0.15 N. 8 mJ is above: 0.1 + 0.1·0.5
// + 8e−3/(0.02·0.5) = 0.95 N, where (13) gives 0.5 N. f_d = 0: 0.1 + 8e−3/0.01 = 0.9 N
TEST(MofcEquations, MaximumForceOnAHandOfBoundedSpeed) {
  EXPECT_NEAR(maximum_force_newton(kOmni, 5e-4, 0.5), 0.2, 1e-15);
  EXPECT_NEAR(maximum_force_newton(kOmni, 1.25e-4, 0.5), 0.15, 1e-15);
  EXPECT_NEAR(maximum_force_newton(kOmni, 8e-3, 0.5), 0.95, 1e-15);
  EXPECT_NEAR(maximum_force_newton(kOmni, -1.0, 0.5), 0.1, 1e-15);
  EXPECT_NEAR(maximum_force_newton({.f_d = 0.0, .f_co = 0.1, .T = 0.02}, 8e-3, 0.5), 0.9, 1e-15);
}

const GuardParameters kGuard{.mofc = kOmni, .v_max_m_per_s = 0.5};

// 10 mm free along −z in 20 ms, then 1 N requested against it:
//   E′ = 0.1·1e−4/0.02 + 0.1·0.01 = 1.5 mJ, so f* = 0.1 + 0.05 + 1.5e−3/0.01 = 0.3 N
//   S  = 10 + 1.5 − ½·1·0.01·1e3 = 6.5 mJ, recovering to 6.5 + 3.5 (1 − e^−0.04) = 6.637237 mJ
//   f_max = 0.1 + 6.637237/10 · 0.2 = 0.2327447 N
TEST(GuardMofc, TheGateClosesByWhatTheHeldForceLeaked) {
  GuardMofc controller(kGuard);
  (void)controller.step(input_at(Vector3::Zero(), {}, Vector3::Zero()));
  const std::vector<AppliedStretch> free{{0.02, Vector3::Zero(), Vector3(0, 0, -0.01), true}};

  const ControlOutput out = controller.step(input_at(Vector3(0, 0, -0.01), free, {0, 0, 1}));

  EXPECT_NEAR(out.ledger_energy_joule, 1.5e-3, 1e-15);
  EXPECT_NEAR(out.f_max_newton.x(), 0.2327447, 1e-7);
  EXPECT_NEAR(out.force_on_hand_newton.z(), 0.2327447, 1e-7);
  EXPECT_TRUE(out.is_clamped);
}

// The same force, marked as held: nothing has leaked yet, S = 10 mJ, the gate is open.
TEST(GuardMofc, AHeldForceLeaksOnlyWhenTheNextIsKnown) {
  GuardMofc controller(kGuard);
  (void)controller.step(input_at(Vector3::Zero(), {}, Vector3::Zero()));
  const std::vector<AppliedStretch> free{{0.02, Vector3::Zero(), Vector3(0, 0, -0.01), true}};
  ControlInput input = input_at(Vector3(0, 0, -0.01), free, {0, 0, 1});
  input.is_request_fresh = false;

  EXPECT_NEAR(controller.step(input).f_max_newton.x(), 0.3, 1e-12);
}

// 0.12 m free in 1 s earn 13.44 mJ; the cap leaves 5 mJ above what the environment has in store.
TEST(GuardMofc, CreditIsCappedAboveTheStoredEnergy) {
  const std::vector<AppliedStretch> free{{1.0, Vector3::Zero(), Vector3(0.12, 0, 0), true}};
  for (const double stored_joule : {0.0, 2e-3, -1.0}) {
    GuardMofc controller(kGuard);
    (void)controller.step(input_at(Vector3::Zero(), {}, Vector3::Zero()));
    ControlInput input = input_at(Vector3(0.12, 0, 0), free, Vector3::Zero());
    input.stored_energy_joule = stored_joule;
    EXPECT_NEAR(controller.step(input).ledger_energy_joule, 5e-3 + std::max(0.0, stored_joule),
                1e-12);
  }
}

/// After 1.5 mJ as above: 10 ms of 0.15 N along x whose end was not read, 10 ms without force, and
/// a reading this far from where it began.
double after_unread_joule(const Vector3& moved_m) {
  GuardMofc controller(kGuard);
  (void)controller.step(input_at(Vector3::Zero(), {}, Vector3::Zero()));
  const Vector3 from(0, 0, -0.01);
  const std::vector<AppliedStretch> free{{0.02, Vector3::Zero(), from, true}};
  (void)controller.step(input_at(from, free, Vector3::Zero()));
  const std::vector<AppliedStretch> unread{{0.01, {0.15, 0, 0}, Vector3::Zero(), false},
                                           {0.01, Vector3::Zero(), from + moved_m, true}};
  return controller.step(input_at(from + moved_m, unread, Vector3::Zero())).ledger_energy_joule;
}

// It may have ended up to min(0.5·0.01, −3 mm + 0.5·0.01) = 2 mm along x: 0.15·2 mm = 0.3 mJ of
// work. The 3 mm earn 0.1·3 mm + 0.1·(3 mm)²/20 ms = 0.345 mJ: +45 µJ.
TEST(GuardMofc, AnUnreadReleaseIsBookedWithTheFurthestPlaceThatTheHandCanHaveReached) {
  EXPECT_NEAR(after_unread_joule({-3e-3, 0, 0}), 1.5e-3 - 0.3e-3 + 0.345e-3, 1e-15);
}

// 1 mm: 0.15·5 mm less 0.105 mJ of friction would be more than the hand can draw in 10 ms at any
// speed, 0.01·6.25e−3 = 62.5 µJ.
TEST(GuardMofc, AnUnreadReleaseCostsNoMoreThanTheWorstMotion) {
  EXPECT_NEAR(after_unread_joule({1e-3, 0, 0}), 1.5e-3 - 62.5e-6, 1e-15);
}

// 1 N for 1 ms, then none for 9 ms, q = 0.1 mm, 2 mm back: at most 0.5 mm along x and 0.05 mm of
// rounding, 0.55 mJ of work. There and back are 0.5 + 2.5 = 3 mm, the ends show 2 and √3·0.1 mm:
// 0.1·(2·0.5 + 2 − 2 − 0.1732) mm = 82.68 µJ more. From 0 to 1 N: (0.1/2)·1 = 0.05 mJ.
// Friction of 0.1 N over the 2 mm is 0.2 mJ, less (0.1/2)·0.1 as it begins and as it ends, and
// the windows 2 − 0.1732 mm: 0.1·(1.8268 mm)²/10 ms = 33.37 µJ.
TEST(EnergyLedger, AReleaseCountsThePathThereAndBack) {
  EnergyLedger ledger(0.1, 0.1, 1e-4);
  ledger.restart(Vector3::Zero());
  ledger.book_release({.force_on_hand_newton = {1, 0, 0},
                       .acted_s = 1e-3,
                       .duration_s = 10e-3,
                       .hand_position_at_end_m = {-2e-3, 0, 0},
                       .v_max_m_per_s = 0.5,
                       .most_drawn_joule = 1.0});

  EXPECT_NEAR(ledger.energy_joule(), -0.55e-3 + 82.68e-6 - 0.05e-3 + 0.19e-3 + 33.37e-6, 2e-8);
}

// 13.44 mJ capped to 5; 1.5 N drain (1.4 − 0.05)·0.5 = 0.675 W, for at least 2 ms and at most 10.
// 0.5 ms of the 1 N that acts (0.425 W) are reserved: (5 − 0.2125) mJ / 0.675 W = 7.093 ms.
TEST(GuardMofc, ALeaseLastsAsLongAsThePoolPaysForIt) {
  GuardParameters p = kGuard;
  p.mofc.T = 2e-3;
  p.delta_max_s = 0.5e-3;
  p.longest_lease_s = 10e-3;
  GuardMofc controller(p);
  (void)controller.step(input_at(Vector3::Zero(), {}, Vector3::Zero()));
  const Vector3 x(0.12, 0, 0);
  const std::vector<AppliedStretch> free{{1.0, Vector3::Zero(), x, true}};
  ControlInput input = input_at(x, free, {1.5, 0, 0});
  input.is_request_fresh = false;
  input.acting_force_on_hand_newton = {1, 0, 0};

  EXPECT_NEAR(controller.step(input).lease_s, 7.0926e-3, 1e-7);
  // the force that acts ends in 0.1 ms: 0.0425 mJ
  input.applied = {};
  input.acting_lease_s = 0.1e-3;
  EXPECT_NEAR(controller.step(input).lease_s, 7.3444e-3, 1e-7);
  // less than 10 ms of 0.2 N, and friction alone absorbs 0.1 N
  input.requested_force_on_hand_newton = {0.2, 0, 0};
  EXPECT_EQ(controller.step(input).lease_s, 10e-3);
  input.requested_force_on_hand_newton = {0.1, 0, 0};
  EXPECT_EQ(controller.step(input).lease_s, 10e-3);
}

TEST(HoleLengths, ThreeWithinTwoSecondsCount) {
  HoleLengths holes;
  holes.note(7e-3, 2e-3);
  holes.note(2e-3, 2e-3);
  holes.note(6e-3, 2e-3);
  EXPECT_EQ(holes.longest_s(), 0.0);
  holes.note(3e-3, 2e-3);
  EXPECT_EQ(holes.longest_s(), 7e-3);
  for (int k = 0; k < 1100; ++k) holes.note(1e-3, 2e-3);
  EXPECT_EQ(holes.longest_s(), 7e-3);
  for (int k = 0; k < 1000; ++k) holes.note(1e-3, 2e-3);
  EXPECT_EQ(holes.longest_s(), 0.0);
}

// In 1/1024 s, without rounding: a span ends once it is longer than a second.
TEST(HoleLengths, LastForTwoSpansOfMoreThanASecond) {
  constexpr double kUnit_s = 1.0 / 1024.0;
  HoleLengths holes;
  for (int k = 0; k < 3; ++k) holes.note(4.0 * kUnit_s, kUnit_s);
  for (int k = 12; k < 2 * 1025 - 1; ++k) holes.note(kUnit_s, kUnit_s);
  EXPECT_EQ(holes.longest_s(), 4.0 * kUnit_s);
  holes.note(kUnit_s, kUnit_s);
  EXPECT_EQ(holes.longest_s(), 0.0);
}

TEST(HoleLengths, ASpanOfMoreThanTwoSecondsEndsWhatWasBefore) {
  const auto longest_s = [](double span_s) {
    constexpr double kHole_s = 1.0 / 256.0;
    HoleLengths holes;
    for (int k = 0; k < 3; ++k) holes.note(kHole_s, 2e-3);
    holes.note(span_s - 3.0 * kHole_s, 2e-3);
    return holes.longest_s();
  };
  EXPECT_EQ(longest_s(2.0), 2.0 - 3.0 / 256.0);
  EXPECT_EQ(longest_s(2.0 + 1.0 / 1024.0), 0.0);
}

// After holes of 8 ms, in one of which a force ended unread, a force is granted that lasts for 8
// ms: (F − 0.15 N) · 0.5 m/s · 8 ms = E′. Before, and with a latch: for 2 ms, 3 N.
TEST(GuardMofc, WhereHolesKeepComingItGrantsWhatLastsThroughThem) {
  GuardParameters p = kGuard;
  p.longest_lease_s = 10e-3;
  p.mofc.T = 2e-3;
  GuardMofc controller(p);
  Vector3 x = Vector3::Zero();
  (void)controller.step(input_at(x, {}, Vector3::Zero()));
  for (int k = 0; k < 40; ++k) {  // free motion earns more than the cap
    x.x() += 2e-3;
    (void)controller.step(input_at(x, {{8e-3, Vector3::Zero(), x, true}}, Vector3::Zero()));
  }
  EXPECT_EQ(controller.step(input_at(x, {}, {3, 0, 0})).force_on_hand_newton.x(), 3.0);
  (void)controller.step(
      input_at(x, {{1e-3, {0.2, 0, 0}, Vector3::Zero(), false}, {7e-3, Vector3::Zero(), x, true}},
               Vector3::Zero()));
  const ControlOutput output = controller.step(input_at(x, {}, {3, 0, 0}));
  const double energy = output.ledger_energy_joule;
  EXPECT_GT(energy, 4e-3);
  EXPECT_NEAR(output.force_on_hand_newton.x(), 0.15 + energy / (0.5 * 8e-3), 1e-6);
  EXPECT_NEAR(output.lease_s, 8e-3, 1e-8);
}

// 20 mm against 1 N are 20 mJ of work, of which S_c = 12 mJ count; S_cap = 5 mJ on top. Where no
// force is requested the contact is over.
TEST(GuardMofc, InAContactTheWorkOfTheHandIsCredit) {
  GuardParameters p = kGuard;
  p.contact_credit_joule = 12e-3;
  GuardMofc controller(p);
  (void)controller.step(input_at(Vector3::Zero(), {}, Vector3::Zero()));
  const Vector3 x(-0.02, 0, 0);
  const std::vector<AppliedStretch> pressed{{1.0, {1, 0, 0}, x, true}};

  EXPECT_NEAR(controller.step(input_at(x, pressed, {1, 0, 0})).ledger_energy_joule, 17e-3, 1e-12);
  EXPECT_NEAR(controller.step(input_at(x, {}, Vector3::Zero())).ledger_energy_joule, 5e-3, 1e-12);
}

// 11 mm in 20 ms are 0.55 m/s; 9 mm are 0.45. With q = 1 mm, 11 mm may have been 9.3.
TEST(GuardMofc, AHandCertainlyFasterThanVMaxIsReported) {
  const auto is_too_fast = [](double moved_m, double q) {
    GuardParameters p = kGuard;
    p.resolution_m = q;
    GuardMofc controller(p);
    (void)controller.step(input_at(Vector3::Zero(), {}, Vector3::Zero()));
    const Vector3 x(moved_m, 0, 0);
    return controller.step(input_at(x, {{0.02, Vector3::Zero(), x, true}}, Vector3::Zero()))
        .is_too_fast;
  };
  EXPECT_TRUE(is_too_fast(11e-3, 0.0));
  EXPECT_FALSE(is_too_fast(9e-3, 0.0));
  EXPECT_FALSE(is_too_fast(11e-3, 1e-3));
}

// 13.44 mJ limited to 10; at most 4 drawn without a reading, then at most 7.
TEST(EnergyLedger, AnUnreadIntervalIsDeductedWhole) {
  EnergyLedger ledger(0.1, 0.1, 0.0);
  ledger.restart(Vector3::Zero());
  ledger.book(1.0, Vector3::Zero(), Vector3(0.12, 0, 0));
  ledger.limit(10e-3);
  ledger.book_unread(4e-3, Vector3::Zero());
  EXPECT_NEAR(ledger.energy_joule(), 6e-3, 1e-15);
  // more than was reserved, as by an answer that acted late
  ledger.book_unread(7e-3, Vector3::Zero());
  EXPECT_NEAR(ledger.energy_joule(), -1e-3, 1e-15);
}

TEST(EnergyLedger, AForfeitDropsCreditAndKeepsDebt) {
  EnergyLedger ledger(0.1, 0.1, 0.0);
  ledger.restart(Vector3::Zero());
  ledger.book(1.0, Vector3::Zero(), Vector3(0.12, 0, 0));
  ledger.forfeit(Vector3::Zero());
  EXPECT_EQ(ledger.energy_joule(), 0.0);

  // 10 mm along 1 N within 1 s: 0.1·1e−4 + 0.1·0.01 − 0.01 = −8.99 mJ
  ledger.book(1.0, Vector3(1, 0, 0), Vector3(0.01, 0, 0));
  ledger.forfeit(Vector3::Zero());
  EXPECT_NEAR(ledger.energy_joule(), -8.99e-3, 1e-15);
}

// Free motion of 1 mm per 20 ms along x: E′ₓ = 0.1·1e−6/0.02 + 0.1·1e−3 = 1.05e−4 J, y and z none.
// f_max,x = 0.1 + 2 √(0.1·1.05e−4/0.02) = 0.1 + 2·0.0229129 = 0.1458258 N; y, z: 0.1 N
TEST(PaperMofc, EachAxisClampsOnItsOwnPool) {
  PaperMofc controller(kOmni);
  (void)controller.step(input_at(Vector3::Zero(), {}, Vector3::Zero()));
  const std::vector<AppliedStretch> free{{0.02, Vector3::Zero(), Vector3(1e-3, 0, 0), true}};

  const ControlOutput out = controller.step(input_at(Vector3(1e-3, 0, 0), free, {-0.2, 0.2, 0.05}));

  EXPECT_NEAR(out.f_max_newton.x(), 0.1458258, 1e-6);
  EXPECT_NEAR(out.force_on_hand_newton.x(), -0.1458258, 1e-6);
  EXPECT_NEAR(out.force_on_hand_newton.y(), 0.1, 1e-12);
  EXPECT_EQ(out.force_on_hand_newton.z(), 0.05);
  EXPECT_NEAR(out.ledger_energy_joule, 1.05e-4, 1e-12);
  EXPECT_TRUE(out.is_clamped);
}

// Isotropic friction of 0.1 N: each axis uses 0.1/√3 = 0.0577350 N.
TEST(PaperMofc, ForIsotropicFrictionEachAxisUsesOneOverSqrt3) {
  PaperMofc controller = PaperMofc::isotropic(kOmni);
  (void)controller.step(input_at(Vector3::Zero(), {}, Vector3::Zero()));
  const std::vector<AppliedStretch> free{{0.02, Vector3::Zero(), Vector3(1e-3, 0, 0), true}};

  const ControlOutput out = controller.step(input_at(Vector3(1e-3, 0, 0), free, {9, 9, 9}));

  // x: 0.1·1e−6/0.02 + 0.057735·1e−3 = 62.735 µJ
  EXPECT_NEAR(out.ledger_energy_joule, 62.735e-6, 1e-10);
  EXPECT_NEAR(out.f_max_newton.y(), 0.0577350, 1e-7);
}

constexpr double kNoLimit = std::numeric_limits<double>::infinity();
const AxisFriction kAxial{.f_d = {0.1, 0.2, 0.4}, .f_co = {0.1, 0.2, 0.0}};

// f_d = (0.1, 0.2, 0.4), f_co = (0.1, 0.2, 0), F = (0.5, 0.6, 0.8) N: excess (0.4, 0.4, 0.8):
// 0.16/0.4 + 0.16/0.8 + 0.64/1.6 = 0.4 + 0.2 + 0.4 = 1 W. No faster than 0.5 m/s: v* = (2, 1, 1)
// m/s are cut: (0.4 − 0.05)·0.5 + (0.4 − 0.1)·0.5 + (0.8 − 0.2)·0.5 = 0.625 W, but together no
// faster either: |e| = √0.96 = 0.979796, (0.979796 − 0.1·0.5)·0.5 = 0.464898 W
TEST(OnePoolClamp, DrainPerAxisIsTheSumOrThatOfTheWholeHand) {
  const Vector3 F(0.5, -0.6, 0.8);
  EXPECT_NEAR(OnePoolClamp(kOmni, kAxial, kNoLimit).drain_watt(F), 1.0, 1e-12);
  EXPECT_NEAR(OnePoolClamp(kOmni, kAxial, 0.5).drain_watt(F), 0.464898, 1e-6);
  EXPECT_EQ(OnePoolClamp(kOmni, kAxial, 0.5).drain_watt({0.1, -0.2, 0.0}), 0.0);
}

// Twice that F, T = 20 ms and E′ = 20 mJ: 1 W for 20 ms is paid, so s = ½. Nothing in the pool and
// F = (0.5, 0.6, 0): the scale at which no axis drains, x: 0.1/0.5 = 0.2. Half open: 0.2 + ½ (s −
// 0.2).
TEST(OnePoolClamp, PerAxisTheForceIsScaledToWhatThePoolPays) {
  const OnePoolClamp clamp(kOmni, kAxial, kNoLimit);
  const Vector3 requested(1.0, -1.2, 1.6);

  const ControlOutput paid = clamp.clamp(requested, 20e-3);
  EXPECT_LT((paid.force_on_hand_newton - 0.5 * requested).norm(), 1e-12);
  EXPECT_TRUE(paid.is_clamped);
  // all 20 mJ for x alone: 0.1 + 2 √(0.1·0.02/0.02) = 0.732456 N
  EXPECT_NEAR(paid.f_max_newton.x(), 0.732456, 1e-6);

  const Vector3 flat(0.5, 0.6, 0.0);
  EXPECT_LT((clamp.clamp(flat, 0.0).force_on_hand_newton - 0.2 * flat).norm(), 1e-12);
  // open it would be s: (0.5 s − 0.1)²/0.4 + (0.6 s − 0.2)²/0.8 = 1: all of it
  EXPECT_LT((clamp.clamp(flat, 20e-3, 0.5).force_on_hand_newton - 0.6 * flat).norm(), 1e-12);
  EXPECT_FALSE(clamp.clamp(flat, 20e-3).is_clamped);
}

// No axis has viscous friction: E′/(T v_max) beyond f_co. |e| v_max T = E′: F along x: 0.1
// + 8e−3/(0.02·0.5) = 0.9 N, as in 1-D.
TEST(OnePoolClamp, PerAxisItWorksWithoutViscousFriction) {
  const AxisFriction dry{.f_d = Vector3::Zero(), .f_co = {0.1, 0.2, 0.0}};
  const OnePoolClamp clamp(kOmni, dry, 0.5);

  EXPECT_NEAR(clamp.clamp({5, 0, 0}, 8e-3).force_on_hand_newton.x(), 0.9, 1e-12);
  EXPECT_NEAR(clamp.clamp({0, 0, -5}, 8e-3).force_on_hand_newton.z(), -0.8, 1e-12);
}

// The same motion in `vector`: one bound for all axes, direction kept. |F_e| = 0.3 along (2,1,2)/3.
TEST(VectorMofc, ScalesTheForceAndKeepsItsDirection) {
  VectorMofc controller(kOmni, 0.0, 0.0);
  (void)controller.step(input_at(Vector3::Zero(), {}, Vector3::Zero()));
  const std::vector<AppliedStretch> free{{0.02, Vector3::Zero(), Vector3(1e-3, 0, 0), true}};

  const ControlOutput out = controller.step(input_at(Vector3(1e-3, 0, 0), free, {0.2, 0.1, 0.2}));

  EXPECT_NEAR(out.force_on_hand_newton.norm(), 0.1458258, 1e-6);
  EXPECT_NEAR(out.force_on_hand_newton.cross(Vector3(2, 1, 2)).norm(), 0.0, 1e-12);
}

// δ = 5 ms while 0.5 N acts: 5e−3·(0.4²/0.4) = 2 mJ are spent in advance; 10 mJ in the ledger leave
// 8 mJ and so 0.5 N. The ledger: 0.12 m free in 1 s: 0.1·0.0144 + 0.1·0.12 = 13.44 mJ, and then the
// 0.5 N for 0.02 s moving 10.4 mm along it (the device helps the hand): 0.1·1.0816e−4/0.02
// + 0.1·0.0104 − 0.5·0.0104 = 0.5408e−3 − 4.16e−3 = −3.6192 mJ → 9.8208 mJ
TEST(VectorMofc, ReservesEnergyForTheForceThatStillActs) {
  VectorMofc controller(kOmni, 0.0, 5e-3);
  (void)controller.step(input_at(Vector3::Zero(), {}, Vector3::Zero()));
  const std::vector<AppliedStretch> applied{{1.0, Vector3::Zero(), Vector3(0.12, 0, 0), true},
                                            {0.02, {0.5, 0, 0}, Vector3(0.1304, 0, 0), true}};

  const ControlOutput out = controller.step(input_at(Vector3(0.1304, 0, 0), applied, {9, 0, 0}));

  EXPECT_NEAR(out.ledger_energy_joule, 9.8208e-3, 1e-12);
  EXPECT_NEAR(out.force_on_hand_newton.x(), 0.1 + 2 * std::sqrt(0.1 * 7.8208e-3 / 0.02), 1e-12);
}

TEST(VectorMofc, StartsAgainWithoutCreditAfterAGap) {
  VectorMofc controller(kOmni, 0.0, 0.0);
  (void)controller.step(input_at(Vector3::Zero(), {}, Vector3::Zero()));
  const std::vector<AppliedStretch> free{{1.0, Vector3::Zero(), Vector3(0.1, 0, 0), true}};
  ASSERT_GT(
      controller.step(input_at(Vector3(0.1, 0, 0), free, Vector3::Zero())).ledger_energy_joule,
      1e-3);

  ControlInput after_gap = input_at(Vector3(0.2, 0, 0), free, {1, 0, 0});
  after_gap.has_gap = true;
  const ControlOutput out = controller.step(after_gap);

  EXPECT_EQ(out.ledger_energy_joule, 0.0);
  EXPECT_NEAR(out.force_on_hand_newton.x(), 0.1, 1e-15);
}

// 20 ms of 1 N drain at most 0.02·0.9²/0.4 = 40.5 mJ. Nothing was reserved here, so it is a debt.
TEST(VectorMofc, AnIntervalWithoutAPositionIsBookedWithTheWorstMotion) {
  VectorMofc controller(kOmni, 0.0, 0.0);
  (void)controller.step(input_at(Vector3::Zero(), {}, Vector3::Zero()));
  const std::vector<AppliedStretch> applied{{0.02, {1, 0, 0}, Vector3::Zero(), false},
                                            {0.02, Vector3::Zero(), Vector3(0.1, 0, 0), true}};

  const ControlOutput out = controller.step(input_at(Vector3(0.1, 0, 0), applied, {1, 0, 0}));

  EXPECT_NEAR(out.ledger_energy_joule, -40.5e-3, 1e-15);
}

TEST(PassThrough, GivesTheRequestedForceAndReportsNoBound) {
  PassThrough none;

  const ControlOutput out = none.step(input_at(Vector3::Zero(), {}, {5, -6, 7}));

  EXPECT_EQ(out.force_on_hand_newton, Vector3(5, -6, 7));
  EXPECT_FALSE(out.is_clamped);
  EXPECT_TRUE(std::isnan(out.ledger_energy_joule));
  EXPECT_TRUE(out.f_max_newton.array().isNaN().all());
}

// A press of 2 N through quantised positions, held and released without motion: work 0, path 0; the
// quantisation costs (q/2)(|f| + TV) = 27.5 µm·(0 + 4 N) = 110 µJ once the force is gone.
TEST(EnergyLedger, AStaticPressCostsTheForceTimesTheResolutionOnce) {
  const double q = 55e-6;
  EnergyLedger ledger(0.1, 0.1, q);
  ledger.restart(Vector3::Zero());
  for (int i = 0; i < 1000; ++i) ledger.book(1e-3, {0, 0, 2}, Vector3::Zero());
  ledger.book(1e-3, Vector3::Zero(), Vector3::Zero());

  EXPECT_NEAR(ledger.energy_joule(), -0.5 * q * 4.0, 1e-12);
}

// 0.1 m at 0.1 m/s read every millisecond with q = 55 µm, no force: truth 0.1·0.01·1 + 0.1·0.1
// = 11 mJ. The ledger may lose some of it to quantisation, but not most.
TEST(EnergyLedger, SlowMotionAtAHighRateStillCounts) {
  const double q = 55e-6;
  EnergyLedger ledger(0.1, 0.1, q);
  ledger.restart(Vector3::Zero());
  for (int i = 1; i <= 1000; ++i) {
    const double x = std::round(1e-4 * i / q) * q;
    ledger.book(1e-3, Vector3::Zero(), {x, 0, 0});
  }

  EXPECT_LE(ledger.energy_joule(), 11e-3);
  EXPECT_GE(ledger.energy_joule(), 0.97 * 10e-3 + 0.75 * 1e-3);
}

// Per axis, q = 0.1 mm; 2 mm along x and back against 1 N, 1 s each way. With friction g = ±1.1 N:
// 4.4 mJ, less ½·0.1 mm·(1.1 + 1.1 + 2.2 N): 0.22 mJ. Viscous 0.1·(1.9 mm)²/1 s twice: 0.722 µJ;
// with √3 q for q, as for isotropic friction, it would be less. The play moves 1.95 mm there
// and 1.9 back, against 0.1 N.
TEST(EnergyLedger, PerAxisItCountsThePlayOfTheAxis) {
  EnergyLedger ledger(AxisFriction{.f_d = {0.1, 0.1, 0.1}, .f_co = {0.1, 5.0, 5.0}}, 1e-4);
  ledger.restart(Vector3::Zero());
  ledger.book(1.0, {-1, 0, 0}, {2e-3, 0, 0});
  ledger.book(1.0, {1, 0, 0}, Vector3::Zero());

  EXPECT_NEAR(ledger.energy_joule(), 4.180722e-3, 1e-12);
  EXPECT_NEAR(ledger.dissipated_joule(), 0.385722e-3, 1e-12);
}

// Ten steps of 2 mm, by turns along x and y, q = 0.1 mm, in 1 s. Friction dissipates 0.1·20 mm. Its
// direction follows that of the steps within 1.6 mm; that of the whole way would count 1.4 mJ.
TEST(EnergyLedger, AStaircaseCountsItsWholePath) {
  EnergyLedger ledger(0.1, 0.1, 1e-4);
  ledger.restart(Vector3::Zero());
  Vector3 x = Vector3::Zero();
  for (int i = 0; i < 10; ++i) {
    x[i % 2] += 2e-3;
    ledger.book(0.1, Vector3::Zero(), x);
  }

  EXPECT_GE(ledger.energy_joule(), 1.8e-3);
  EXPECT_LE(ledger.energy_joule(), 2e-3);
}

// To and fro by 1 mm: 10 · 1 mm against 0.1 N, less ½·0.1 mm for each newton by which friction
// changes: 0.1 at the first turn, 0.2 at each of the nine others, 0.1 at the end.
TEST(EnergyLedger, MotionToAndFroCountsThoughItEndsWhereItBegan) {
  EnergyLedger ledger(0.0, 0.1, 1e-4);
  ledger.restart(Vector3::Zero());
  for (int i = 1; i <= 10; ++i) ledger.book(0.1, Vector3::Zero(), {i % 2 * 1e-3, 0, 0});

  EXPECT_NEAR(ledger.energy_joule(), 0.1 * 10e-3 - 0.05e-3 * (0.1 + 9 * 0.2 + 0.1), 1e-12);
}

}  // namespace
}  // namespace palpate::controllers
