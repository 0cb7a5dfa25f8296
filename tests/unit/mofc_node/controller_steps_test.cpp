// SPDX-License-Identifier: Apache-2.0
// The controllers step by step beside their equations (docs/theory.md §2.4, §2.5), written once
// more from the ledger and the clamp; and what a reset, a gap and the defaults do.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "common/core/random.h"
#include "mofc_node/controllers/energy_ledger.h"
#include "mofc_node/controllers/guard_mofc.h"
#include "mofc_node/controllers/one_pool_clamp.h"
#include "mofc_node/controllers/paper_mofc.h"
#include "mofc_node/controllers/safety_net.h"
#include "mofc_node/controllers/vector_mofc.h"

namespace palpate::controllers {
namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();
constexpr MofcParameters kPhantom{.f_d = 0.1, .f_co = 0.1, .T = 0.02};

AppliedStretch stretch(double duration_s, const Vector3& force, const Vector3& end) {
  return {.duration_s = duration_s, .force_on_hand_newton = force, .hand_position_at_end_m = end};
}

AppliedStretch unread(double duration_s, const Vector3& force) {
  return {.duration_s = duration_s,
          .force_on_hand_newton = force,
          .hand_position_at_end_m = {7, 7, 7},
          .has_position_at_end = false};
}

/// One pool by the equations; the ledger's own count and the clamp are tested by themselves.
class PoolByTheEquations {
 public:
  explicit PoolByTheEquations(const GuardParameters& p)
      : p_(p),
        clamp_(p.mofc, p.per_axis, p.v_max_m_per_s),
        ledger_(p.mofc, p.per_axis, p.resolution_m) {}

  void reset() { *this = PoolByTheEquations(p_); }

  void book(const ControlInput& input) {
    elapsed_s = 0.0;
    work_joule = 0.0;
    if (!has_started_) {
      ledger_.restart(input.hand_position_m);
    } else if (input.has_gap) {
      ledger_.forfeit(input.hand_position_m);
    } else {
      book_each(input);
    }
    has_started_ = true;
    at_ = input.hand_position_m;
  }

  ControlOutput grant(const ControlInput& input, double gate) const {
    double prompt_s = p_.delta_max_s;
    if (p_.prompt_s > 0.0 && p_.prompt_s < prompt_s) prompt_s = p_.prompt_s;
    const double drain = clamp_.drain_watt(input.acting_force_on_hand_newton);
    double energy = ledger_.energy_joule();
    if (input.energy_limit_joule < energy) energy = input.energy_limit_joule;
    const auto free_at = [&](double delta_s) {
      const double reserved_s = std::min(input.acting_lease_s, delta_s);
      return energy - (reserved_s > 0.0 ? reserved_s * drain : 0.0);
    };
    double free = free_at(prompt_s);
    const double longest = std::max(p_.mofc.T, p_.longest_lease_s);
    double covered = p_.mofc.T;
    const bool bridges = p_.v_max_m_per_s < kUnbounded;  // guard
    const double hole = bridges && has_ended_unread_ ? holes_.longest_s() : 0.0;
    if (hole > covered && hole <= longest) covered = hole;
    ControlOutput output =
        clamp_.clamp(input.requested_force_on_hand_newton, free * (p_.mofc.T / covered), gate);
    output.ledger_energy_joule = energy;
    output.counted_energy_joule = ledger_.energy_joule();
    output.lease_s = std::max(p_.mofc.T, p_.longest_lease_s);
    const double power = clamp_.drain_watt(output.force_on_hand_newton);
    const double kept = std::max(covered, std::min(longest, 8e-3));
    const bool is_free = !(drain > 0.0) || input.acting_lease_s <= prompt_s;
    output.begins_within_s =
        is_free ? p_.delta_max_s : latest_beginning_s(prompt_s, [&](double delta_s) {
          return kept * power <= free_at(delta_s);
        });
    free = free_at(output.begins_within_s);
    if (power > 0.0) {
      const bool is_all_spent =
          output.begins_within_s > prompt_s && output.begins_within_s < p_.delta_max_s;
      const double paid = is_all_spent ? kept : std::max(0.0, free) / power;
      output.lease_s = std::min(output.lease_s, std::max(p_.mofc.T, paid));
    }
    return output;
  }

  /// By halving: what is paid later is paid before.
  template <class IsPaid>
  double latest_beginning_s(double prompt_s, const IsPaid& is_paid) const {
    if (is_paid(p_.delta_max_s)) return p_.delta_max_s;
    double paid_s = prompt_s;
    double unpaid_s = p_.delta_max_s;
    for (int i = 0; i < 60; ++i) {
      const double middle_s = 0.5 * (paid_s + unpaid_s);
      (is_paid(middle_s) ? paid_s : unpaid_s) = middle_s;
    }
    return paid_s;
  }

  double elapsed_s = 0.0;
  double work_joule = 0.0;  // of the hand against the force
  EnergyLedger& ledger() { return ledger_; }

 private:
  void book_each(const ControlInput& input) {
    std::vector<AppliedStretch> open;  // since the last reading
    for (std::size_t i = 0; i < input.applied.size(); ++i) {
      const AppliedStretch& one = input.applied[i];
      elapsed_s += one.duration_s;
      open.push_back(one);
      const bool is_last = i + 1 == input.applied.size();
      if (!one.has_position_at_end && !is_last) continue;
      const Vector3 end =
          one.has_position_at_end ? one.hand_position_at_end_m : input.hand_position_m;
      if (open.size() == 1 && one.has_position_at_end) {
        work_joule -= one.force_on_hand_newton.dot(end - at_);
        ledger_.book(one.duration_s, one.force_on_hand_newton, end);
        holes_.note(one.duration_s, p_.mofc.T);
      } else {
        book_open(open, end);
      }
      at_ = end;
      open.clear();
    }
  }

  void book_open(const std::vector<AppliedStretch>& open, const Vector3& end) {
    double most = 0.0;
    double duration_s = 0.0;
    for (const AppliedStretch& one : open) {
      duration_s += one.duration_s;
      most += one.duration_s * clamp_.drain_watt(one.force_on_hand_newton);
    }
    holes_.note(duration_s, p_.mofc.T);
    if (open[0].force_on_hand_newton != Vector3::Zero()) has_ended_unread_ = true;
    const bool is_release = std::all_of(
        open.begin() + 1, open.end(),
        [](const AppliedStretch& one) { return one.force_on_hand_newton == Vector3::Zero(); });
    if (most == kUnbounded) {
      ledger_.forfeit(end);
    } else if (is_release && p_.v_max_m_per_s < kUnbounded) {
      ledger_.book_release({.force_on_hand_newton = open[0].force_on_hand_newton,
                            .acted_s = open[0].duration_s,
                            .duration_s = duration_s,
                            .hand_position_at_end_m = end,
                            .v_max_m_per_s = p_.v_max_m_per_s,
                            .most_drawn_joule = most});
    } else {
      ledger_.book_unread(most, end);
    }
  }

  GuardParameters p_;
  OnePoolClamp clamp_;
  EnergyLedger ledger_;
  HoleLengths holes_{};
  bool has_ended_unread_ = false;
  Vector3 at_ = Vector3::Zero();
  bool has_started_ = false;
};

/// Cap, gate and report of the speed.
class GuardByTheEquations {
 public:
  explicit GuardByTheEquations(const GuardParameters& p) : p_(p), pool_(p), S_(p.gate_joule) {}

  void reset() {
    // the count of the friction's work is compared with that of the last step, across a reset too
    const double dissipated = dissipated_;
    *this = GuardByTheEquations(p_);
    dissipated_ = dissipated;
  }

  ControlOutput step(const ControlInput& input) {
    pool_.book(input);
    const double t = pool_.elapsed_s;
    Vector3 moved = input.hand_position_m - at_;
    if (t <= 0.0) moved.setZero();
    at_ = input.hand_position_m;
    since_fresh_ += moved;
    if (input.has_gap) since_fresh_.setZero();
    if (input.has_gap) asked_.setZero();

    contact_work_ += pool_.work_joule;
    if (input.requested_force_on_hand_newton == Vector3::Zero()) contact_work_ = 0.0;
    double elastic = std::max(0.0, input.stored_energy_joule);
    elastic = std::max(elastic, std::min(contact_work_, p_.contact_credit_joule));
    pool_.ledger().limit(p_.credit_cap_joule + elastic);

    const double dissipated = pool_.ledger().dissipated_joule();
    S_ += std::max(0.0, dissipated - dissipated_);
    dissipated_ = dissipated;
    if (input.is_request_fresh) {
      const double before = asked_.norm();
      double s = 1.0;
      if (before > 0.0) s = std::min(1.0, input.acting_force_on_hand_newton.norm() / before);
      S_ += 0.5 * s * (input.requested_force_on_hand_newton - asked_).dot(since_fresh_);
      asked_ = input.requested_force_on_hand_newton;
      since_fresh_.setZero();
    }
    const double decay = std::exp(-t / p_.gate_recovery_s);
    S_ = p_.gate_joule + (S_ - p_.gate_joule) * decay;
    S_ = std::min(std::max(S_, -p_.gate_joule), p_.gate_joule);

    ControlOutput output = pool_.grant(input, std::max(0.0, S_ / p_.gate_joule));
    output.is_too_fast =
        moved.norm() - std::numbers::sqrt3 * p_.resolution_m > p_.v_max_m_per_s * t;
    return output;
  }

 private:
  GuardParameters p_;
  PoolByTheEquations pool_;
  double S_;
  double contact_work_ = 0.0;
  double dissipated_ = 0.0;
  Vector3 at_ = Vector3::Zero();
  Vector3 since_fresh_ = Vector3::Zero();
  Vector3 asked_ = Vector3::Zero();
};

/// A hand that wanders, what acts on it in one to four stretches, some of whose ends were not read.
class RandomSteps {
 public:
  explicit RandomSteps(std::uint64_t seed) : random_(seed), x_(0.1 * random_.direction()) {}

  ControlInput next() {
    applied_.clear();
    if (random_.chance(0.9)) {
      for (std::uint64_t left = 1 + random_.below(4); left > 0; --left) {
        x_ += random_.uniform(0.0, 4e-3) * random_.direction();
        const Vector3 force = random_.chance(0.4)
                                  ? Vector3(Vector3::Zero())
                                  : Vector3(random_.uniform(0.0, 1.0) * random_.direction());
        applied_.push_back(random_.chance(0.7) ? stretch(random_.uniform(1e-3, 8e-3), force, x_)
                                               : unread(random_.uniform(1e-3, 8e-3), force));
      }
    }
    // the requested force changes little between two steps, and more when it is evaluated anew
    if (random_.chance(0.2)) asked_ = random_.uniform(0.0, 2.0) * random_.direction();
    if (random_.chance(0.05)) asked_.setZero();
    if (random_.chance(0.1)) acting_ = random_.uniform(0.0, 2.0) * random_.direction();
    return {.hand_position_m = x_,
            .applied = applied_,
            .has_gap = random_.chance(0.02),
            .acting_force_on_hand_newton = random_.chance(0.2) ? Vector3(Vector3::Zero()) : acting_,
            .acting_lease_s = random_.chance(0.5) ? kUnbounded : random_.uniform(0.0, 3e-3),
            .energy_limit_joule = random_.chance(0.7) ? kUnbounded : random_.uniform(-1e-3, 1e-3),
            .requested_force_on_hand_newton = asked_,
            .is_request_fresh = random_.chance(0.7),
            .stored_energy_joule = random_.chance(0.3) ? random_.uniform(0.0, 3e-3) : 0.0};
  }
  bool is_reset_due() { return random_.chance(0.01); }

 private:
  Random random_;
  Vector3 x_;
  Vector3 asked_ = Vector3::Zero();
  Vector3 acting_ = Vector3::Zero();
  std::vector<AppliedStretch> applied_;
};

GuardParameters parameters_of(std::uint64_t seed) {
  Random random(seed);
  GuardParameters p{.mofc = {.f_d = random.chance(0.2) ? 0.0 : random.uniform(0.05, 1.0),
                             .f_co = random.uniform(0.0, 0.2),
                             .T = random.uniform(1e-3, 10e-3)},
                    .resolution_m = random.chance(0.3) ? 0.0 : random.uniform(0.0, 1e-4),
                    .delta_max_s = random.uniform(0.0, 2e-3),
                    .prompt_s = 0.0,
                    .longest_lease_s = random.uniform(0.0, 30e-3),
                    .v_max_m_per_s = random.uniform(0.3, 1.0),
                    .credit_cap_joule = random.uniform(0.2e-3, 3e-3),
                    .contact_credit_joule = random.uniform(0.0, 3e-3),
                    .gate_joule = random.uniform(0.3e-3, 3e-3),
                    .gate_recovery_s = random.uniform(0.02, 0.3)};
  if (random.chance(0.7)) p.prompt_s = random.uniform(0.0, 1.2 * p.delta_max_s);
  if (random.chance(0.1)) p.longest_lease_s = 2.0;
  if (random.chance(0.5)) {
    p.per_axis = AxisFriction{.f_d = {0.1, random.uniform(0.0, 0.5), 0.3},
                              .f_co = {random.uniform(0.0, 0.2), 0.1, 0.0}};
  }
  return p;
}

void expect_same(const ControlOutput& out, const ControlOutput& expected) {
  const double energy = 1e-12 * (1e-3 + std::abs(expected.ledger_energy_joule));
  EXPECT_NEAR(out.ledger_energy_joule, expected.ledger_energy_joule, energy);
  EXPECT_NEAR(out.counted_energy_joule, expected.counted_energy_joule,
              1e-12 * (1e-3 + std::abs(expected.counted_energy_joule)));
  EXPECT_LT((out.force_on_hand_newton - expected.force_on_hand_newton).norm(), 1e-9);
  EXPECT_LT((out.f_max_newton - expected.f_max_newton).norm(), 1e-9 * expected.f_max_newton.norm());
  EXPECT_NEAR(out.lease_s, expected.lease_s, 1e-9);
  EXPECT_NEAR(out.begins_within_s, expected.begins_within_s, 1e-9);
  EXPECT_EQ(out.is_too_fast, expected.is_too_fast);
}

TEST(GuardMofcSteps, EveryStepIsThatOfTheEquations) {
  int too_fast = 0;
  int clamped = 0;
  int long_leases = 0;
  int partly_later = 0;  // than prompt, and not as late as can be
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const GuardParameters p = parameters_of(seed);
    GuardMofc controller(p);
    GuardByTheEquations expected(p);
    RandomSteps steps(seed);
    for (int k = 0; k < 300 && !HasFailure(); ++k) {
      if (steps.is_reset_due()) {
        controller.reset();
        expected.reset();
      }
      const ControlInput input = steps.next();
      const ControlOutput out = controller.step(input);
      expect_same(out, expected.step(input));
      too_fast += out.is_too_fast ? 1 : 0;
      clamped += out.is_clamped ? 1 : 0;
      long_leases += out.lease_s > p.mofc.T ? 1 : 0;
      partly_later +=
          out.begins_within_s > p.prompt_s && out.begins_within_s < p.delta_max_s ? 1 : 0;
    }
  }
  // every part of it was in use
  EXPECT_GT(too_fast, 100);
  EXPECT_GT(clamped, 1000);
  EXPECT_GT(long_leases, 100);
  EXPECT_GT(partly_later, 20);
}

TEST(VectorMofcSteps, EveryStepIsThatOfTheEquations) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    GuardParameters p = parameters_of(seed);
    p.v_max_m_per_s = kUnbounded;
    VectorMofc controller(p.mofc, p.resolution_m, p.delta_max_s, p.per_axis, p.longest_lease_s,
                          p.prompt_s);
    PoolByTheEquations expected(p);
    RandomSteps steps(seed);
    for (int k = 0; k < 200 && !HasFailure(); ++k) {
      if (steps.is_reset_due()) {
        controller.reset();
        expected.reset();
      }
      const ControlInput input = steps.next();
      expected.book(input);
      expect_same(controller.step(input), expected.grant(input, 1.0));
    }
  }
}

// Without friction along x no energy pays for the 1 N that acts there; with nothing in reserve
// (δ = 0) that does not matter to y: E′ = 10 mJ gives f_d = 0.1 there 2 √(0.1·0.01/0.02) N.
TEST(VectorMofc, WithoutDelayNothingIsReservedEvenForAForceOfUnboundedDrain) {
  const AxisFriction friction{.f_d = {0.0, 0.1, 0.1}, .f_co = {0.0, 1.0, 0.0}};
  VectorMofc controller({.T = 0.02}, 0.0, 0.0, friction);
  (void)controller.step(ControlInput{});
  const Vector3 x(0, 0.01, 0);
  const std::vector<AppliedStretch> free{stretch(1e9, Vector3::Zero(), x)};

  const ControlOutput out = controller.step({.hand_position_m = x,
                                             .applied = free,
                                             .acting_force_on_hand_newton = {1, 0, 0},
                                             .requested_force_on_hand_newton = {0, 0.9, 0}});

  EXPECT_NEAR(out.ledger_energy_joule, 10e-3, 1e-12);
  EXPECT_NEAR(out.f_max_newton.y(), 1.0 + 2.0 * std::sqrt(0.1 * 0.01 / 0.02), 1e-9);
}

// Friction on x alone, and 10 mJ of it: a force along y has no bound of what it may have drawn
// while nobody read, so that the credit is gone, no more, and the ledger goes on from the next
// reading.
TEST(VectorMofc, AnUnreadForceOfUnboundedDrainTakesTheCredit) {
  const AxisFriction only_x{.f_d = Vector3(0.1, 0, 0), .f_co = Vector3(0.1, 0, 0)};
  VectorMofc controller(kPhantom, 0.0, 0.0, only_x);
  const std::vector<AppliedStretch> free{stretch(1.0, Vector3::Zero(), {0.1, 0, 0})};
  const std::vector<AppliedStretch> lost{unread(0.01, Vector3::UnitY())};
  const std::vector<AppliedStretch> on{stretch(1.0, Vector3::Zero(), {0.4, 0, 0})};
  (void)controller.step(ControlInput{});
  EXPECT_NEAR(
      controller.step({.hand_position_m = {0.1, 0, 0}, .applied = free}).ledger_energy_joule, 11e-3,
      1e-12);
  EXPECT_EQ(controller.step({.hand_position_m = {0.3, 0, 0}, .applied = lost}).ledger_energy_joule,
            0.0);
  EXPECT_NEAR(controller.step({.hand_position_m = {0.4, 0, 0}, .applied = on}).ledger_energy_joule,
              11e-3, 1e-12);
}

// 0.12 m free in two halves of 0.5 s: 2·(0.1·0.06²/0.5 + 0.1·0.06) = 13.44 mJ on x. A reset forgets
// it, a gap and an unread end drop it; nothing from the unread end on is booked.
TEST(PaperMofc, CreditEndsWithAResetAGapAndAnUnreadEnd) {
  const Vector3 start(0.3, 0, 0);
  const Vector3 x(0.42, 0, 0);
  const std::vector<AppliedStretch> free{stretch(0.5, Vector3::Zero(), {0.36, 0, 0}),
                                         stretch(0.5, Vector3::Zero(), x)};
  const std::vector<AppliedStretch> back{stretch(1.0, Vector3::Zero(), start)};
  const auto moved = [&] {
    PaperMofc controller(kPhantom);
    EXPECT_EQ(controller.step({.hand_position_m = start, .applied = free}).ledger_energy_joule,
              0.0);
    const ControlOutput out = controller.step({.hand_position_m = x, .applied = free});
    EXPECT_NEAR(out.ledger_energy_joule, 13.44e-3, 1e-12);
    return controller;
  };

  PaperMofc reset = moved();
  reset.reset();
  EXPECT_EQ(reset.step({.hand_position_m = start, .applied = back}).ledger_energy_joule, 0.0);

  PaperMofc gap = moved();
  EXPECT_EQ(
      gap.step({.hand_position_m = start, .applied = back, .has_gap = true}).ledger_energy_joule,
      0.0);

  PaperMofc lost = moved();
  const std::vector<AppliedStretch> with_unread{unread(0.02, {1e3, 0, 0}), back[0]};
  EXPECT_EQ(lost.step({.hand_position_m = start, .applied = with_unread}).ledger_energy_joule, 0.0);
}

// A debt stays: 10 mm along 1 N within 1 s: 0.1·1e−4 + 0.1·0.01 − 0.01 = −8.99 mJ.
TEST(PaperMofc, ADebtStaysAfterAGap) {
  PaperMofc controller(kPhantom);
  (void)controller.step(ControlInput{});
  const Vector3 x(0.01, 0, 0);
  const std::vector<AppliedStretch> applied{stretch(1.0, {1, 0, 0}, x)};
  (void)controller.step({.hand_position_m = x, .applied = applied});

  const ControlOutput out =
      controller.step({.hand_position_m = x, .applied = applied, .has_gap = true});
  EXPECT_NEAR(out.ledger_energy_joule, -8.99e-3, 1e-15);
}

// (10) with T = 0: 0.1·2e−3 − 0.5·2e−3
TEST(MofcEquations, AnIntervalWithoutDurationHasNoViscousPart) {
  EXPECT_NEAR(interval_energy_joule(0.1, 0.1, 0.0, 2e-3, -0.5), -0.8e-3, 1e-18);
}

TEST(EnergyLedger, BeginsEmptyAtTheOriginAsAfterARestartThere) {
  for (const bool is_per_axis : {false, true}) {
    const AxisFriction friction{.f_d = {0.1, 0.2, 0.3}, .f_co = {0.3, 0.2, 0.1}};
    EnergyLedger ledger = is_per_axis ? EnergyLedger(friction, 1e-4) : EnergyLedger(0.1, 0.2, 1e-4);
    EXPECT_EQ(ledger.energy_joule(), 0.0);
    EXPECT_EQ(ledger.dissipated_joule(), 0.0);
    EnergyLedger restarted = ledger;
    restarted.book(0.1, {1, 2, 3}, {0.1, 0.2, 0.1});
    restarted.limit(-1.0);
    restarted.restart(Vector3::Zero());
    EXPECT_EQ(restarted.energy_joule(), 0.0);
    EXPECT_EQ(restarted.dissipated_joule(), 0.0);
    for (EnergyLedger* one : {&ledger, &restarted}) {
      one->book(0.1, {-1, 0, 0}, {3e-3, 0, 0});
      one->book_release({.force_on_hand_newton = {3, 0, 0},
                         .acted_s = 1e-3,
                         .duration_s = 10e-3,
                         .hand_position_at_end_m = {2e-3, 1e-3, 0},
                         .v_max_m_per_s = 0.5,
                         .most_drawn_joule = 1.0});
    }
    EXPECT_EQ(ledger.energy_joule(), restarted.energy_joule());
    EXPECT_EQ(ledger.hand_position_m(), Vector3(2e-3, 1e-3, 0));
  }
}

// As AReleaseCountsThePathThereAndBack, elsewhere; per axis, with 3 N, the path there and back does
// not count: Coulomb 0.19 mJ, viscous 0.1·(1.9 mm)²/10 ms = 36.1 µJ.
TEST(EnergyLedger, AReleaseCountsTheSameEverywhere) {
  const Vector3 start(0.2, -0.1, 0.3);
  const Release release{.force_on_hand_newton = {1, 0, 0},
                        .acted_s = 1e-3,
                        .duration_s = 10e-3,
                        .hand_position_at_end_m = start - Vector3(2e-3, 0, 0),
                        .v_max_m_per_s = 0.5,
                        .most_drawn_joule = 1.0};
  EnergyLedger ledger(0.1, 0.1, 1e-4);
  ledger.restart(start);
  ledger.book_release(release);
  EXPECT_NEAR(ledger.energy_joule(), -0.55e-3 + 82.68e-6 - 0.05e-3 + 0.19e-3 + 33.37e-6, 2e-8);

  const AxisFriction friction{.f_d = {0.1, 0.1, 0.1}, .f_co = {0.1, 0.1, 0.1}};
  EnergyLedger per_axis(friction, 1e-4);
  per_axis.restart(start);
  Release stronger = release;
  stronger.force_on_hand_newton = {3, 0, 0};
  per_axis.book_release(stronger);
  EXPECT_NEAR(per_axis.energy_joule(), 3.0 * (-0.55e-3 - 0.05e-3) + 0.19e-3 + 36.1e-6, 2e-8);
}

// 2 mm free in 10 ms, of which nothing acted at all: 0.1·2e−3 + 0.1·4e−6/0.01 = 0.24 mJ.
TEST(EnergyLedger, AReleaseOfNoForceIsFreeMotion) {
  EnergyLedger ledger(0.1, 0.1, 0.0);
  ledger.restart(Vector3::Zero());
  ledger.book_release({.acted_s = 1e-3,
                       .duration_s = 10e-3,
                       .hand_position_at_end_m = {2e-3, 0, 0},
                       .v_max_m_per_s = 0.5});
  EXPECT_NEAR(ledger.energy_joule(), 0.24e-3, 1e-15);
}

// 300 q at once, as two readings with one stamp give it: the window stays open until time has
// passed, f_d ((300 − √3) q)² / 1 s, with q = 0.1 mm: 0.1·(29.8268 mm)² = 88.964 µJ.
TEST(EnergyLedger, AMotionWithoutDurationCountsOnceTimeHasPassed) {
  EnergyLedger ledger(0.1, 0.0, 1e-4);
  ledger.restart(Vector3::Zero());
  ledger.book(0.0, Vector3::Zero(), {30e-3, 0, 0});
  EXPECT_EQ(ledger.energy_joule(), 0.0);
  ledger.book(1.0, Vector3::Zero(), {30e-3, 0, 0});
  EXPECT_NEAR(ledger.energy_joule(), 88.964e-6, 1e-9);
}

// Force 2 f_co, as AReleaseCountsThePathThereAndBack: 2·0.55 mJ of work, 2·0.05 of quantisation;
// the path there and back, 0.8268 mm, counts from there on, with f_co = 1: 0.8268 mJ. Coulomb 1.9
// mJ.
TEST(EnergyLedger, ThePathThereAndBackCountsFromTwiceTheCoulombFrictionOn) {
  EnergyLedger ledger(0.0, 1.0, 1e-4);
  ledger.restart(Vector3::Zero());
  ledger.book_release({.force_on_hand_newton = {2, 0, 0},
                       .acted_s = 1e-3,
                       .duration_s = 10e-3,
                       .hand_position_at_end_m = {-2e-3, 0, 0},
                       .v_max_m_per_s = 0.5,
                       .most_drawn_joule = 1.0});
  EXPECT_NEAR(ledger.energy_joule(), -1.1e-3 + 0.8268e-3 - 0.1e-3 + 1.9e-3, 1e-8);
}

// A window of exactly 16 q is closed: the second that follows does not thin it out.
// f_d ((16 − √3) q)² / 1 s; 8 q leave it open: f_d ((8 − √3) q)² over 1 s, then over 2.
TEST(EnergyLedger, AWindowClosesAfterSixteenResolutions) {
  const double q = std::ldexp(1.0, -10);
  const auto after = [q](double resolutions, int seconds) {
    EnergyLedger ledger(1.0, 0.0, q);
    ledger.restart(Vector3::Zero());
    for (int i = 0; i < seconds; ++i) ledger.book(1.0, Vector3::Zero(), {resolutions * q, 0, 0});
    return ledger.dissipated_joule() / (q * q);
  };
  const double sixteen = std::pow(16.0 - std::numbers::sqrt3, 2);
  const double eight = std::pow(8.0 - std::numbers::sqrt3, 2);
  EXPECT_NEAR(after(16.0, 1), sixteen, 1e-9);
  EXPECT_NEAR(after(16.0, 2), sixteen, 1e-9);
  EXPECT_NEAR(after(8.0, 1), eight, 1e-9);
  EXPECT_NEAR(after(8.0, 2), 0.5 * eight, 1e-9);
}

// To and fro by 8 q: 7.5 q are sure the first time, then 7 q each time.
TEST(EnergyLedger, FrictionDissipatesOnThePathThatIsSure) {
  const double q = std::ldexp(1.0, -10);
  EnergyLedger ledger(0.0, 1.0, q);
  ledger.restart(Vector3::Zero());
  for (int i = 1; i <= 37; ++i) ledger.book(0.1, Vector3::Zero(), {i % 2 * 8.0 * q, 0, 0});
  EXPECT_NEAR(ledger.dissipated_joule(), 259.5 * q, 1e-9);
}

// 2 mm along the force, all the time that it acted: there is no path back. Work 2·2.05 mm, friction
// 1 N · 2 mm; quantisation of 1 N, which is left of 2 N beside friction, and of that at the end.
TEST(EnergyLedger, AReleaseWithoutAWayBackCountsNoPathForIt) {
  EnergyLedger ledger(0.0, 1.0, 1e-4);
  ledger.restart(Vector3::Zero());
  ledger.book_release({.force_on_hand_newton = {2, 0, 0},
                       .acted_s = 4e-3,
                       .duration_s = 4e-3,
                       .hand_position_at_end_m = {2e-3, 0, 0},
                       .v_max_m_per_s = 0.5,
                       .most_drawn_joule = 1.0});
  EXPECT_NEAR(ledger.energy_joule(), -4.1e-3 + 2e-3 - 0.05e-3 * (1.0 + 1.0), 1e-8);
}

// To and fro by 8 q as above: 14.5 q, along each axis, for both kinds of friction.
TEST(EnergyLedger, EveryAxisCounts) {
  const double q = std::ldexp(1.0, -10);
  const AxisFriction friction{.f_d = Vector3::Zero(), .f_co = Vector3::Ones()};
  for (EnergyLedger ledger : {EnergyLedger(0.0, 1.0, q), EnergyLedger(friction, q)}) {
    for (int axis = 0; axis < 3; ++axis) {
      ledger.restart(Vector3::Zero());
      ledger.book(1.0, Vector3::Zero(), 8.0 * q * Vector3::Unit(axis));
      ledger.book(1.0, Vector3::Zero(), Vector3::Zero());
      EXPECT_NEAR(ledger.dissipated_joule(), 14.5 * q, 1e-12);
    }
  }
}

// 8 q one way, then to and fro by 0.8 q: half a step may be where the hand never was, so friction
// is not turned round. Each time it would cost 0.2 q.
TEST(EnergyLedger, ASwingShorterThanAStepTurnsNoFriction) {
  const double q = std::ldexp(1.0, -10);
  EnergyLedger ledger(0.0, 1.0, q);
  ledger.restart(Vector3::Zero());
  ledger.book(1.0, Vector3::Zero(), {8.0 * q, 0, 0});
  EXPECT_NEAR(ledger.energy_joule(), 7.0 * q, 1e-12);
  for (int i = 1; i <= 100; ++i) {
    ledger.book(1.0, Vector3::Zero(), {(8.0 - i % 2 * 0.8) * q, 0, 0});
  }
  EXPECT_NEAR(ledger.energy_joule(), 7.0 * q, 1e-12);
}

TEST(EnergyLedger, ATremorWithinHalfAResolutionCountsNothing) {
  EnergyLedger ledger(0.0, 1.0, 1e-4);
  ledger.restart(Vector3::Zero());
  for (int i = 0; i < 100; ++i) {
    ledger.book(1e-3, Vector3::Zero(), (i % 2 == 0 ? 0.4e-4 : -0.4e-4) * Vector3::Ones());
  }
  EXPECT_EQ(ledger.dissipated_joule(), 0.0);
}

// Exactly the bound is not clamped; f_max = f_co = 0.1 N without energy.
TEST(ControllerOutput, IsClampedOnlyBeyondTheBound) {
  EXPECT_FALSE(output_within({0, 2, 0}, 2.0).is_clamped);
  EXPECT_TRUE(output_within({0, 2.1, 0}, 2.0).is_clamped);
  const auto is_clamped = [](const Vector3& asked) {
    return PaperMofc(kPhantom)
        .step({.hand_position_m = Vector3::Zero(),
               .applied = {},
               .requested_force_on_hand_newton = asked})
        .is_clamped;
  };
  EXPECT_FALSE(is_clamped({0.1, -0.1, 0.05}));
  EXPECT_TRUE(is_clamped({0, 0.11, 0}));
  EXPECT_TRUE(is_clamped({0, 0, -0.11}));
}

/// Answers one force, and counts resets.
class Constant final : public ForceController {
 public:
  Constant(const Vector3& force_newton, int& resets)
      : force_newton_(force_newton), resets_(resets) {}
  void reset() noexcept override { ++resets_; }
  ControlOutput step(const ControlInput& input) noexcept override {
    (void)input;
    ControlOutput output;
    output.force_on_hand_newton = force_newton_;
    output.sent_wave.sum = Vector3(1, 2, 3);
    return output;
  }

 private:
  Vector3 force_newton_;
  int& resets_;
};

// A hand that slides: guard gets what the inner controller answers, as if it had been asked for it.
TEST(SafetyNet, IsGuardOnTheAnswerOfTheInnerController) {
  const GuardParameters parameters{.mofc = kPhantom, .longest_lease_s = 0.1};
  const std::vector<AppliedStretch> slide{stretch(1.0, Vector3::Zero(), {0.1, 0, 0})};
  for (const Vector3& inner : {Vector3(0.05, 0, 0), Vector3(9, 0, 0), Vector3(0, -0.2, 0.1),
                               Vector3(std::numeric_limits<double>::quiet_NaN(), 0, 0)}) {
    int resets = 0;
    SafetyNet net(std::make_unique<Constant>(inner, resets), parameters);
    GuardMofc guard(parameters);
    for (int round = 0; round < 2; ++round) {
      for (const ControlInput& asked :
           {ControlInput{.applied = {}, .requested_force_on_hand_newton = inner},
            ControlInput{.hand_position_m = {0.1, 0, 0},
            .applied = slide,
            .requested_force_on_hand_newton = Vector3(0.05, 0, 0)}}) {
        ControlInput answered = asked;
        answered.requested_force_on_hand_newton = inner.allFinite() ? inner : Vector3::Zero();
        const ControlOutput out = net.step(asked);
        const ControlOutput limited = guard.step(answered);
        expect_same(out, limited);
        EXPECT_EQ(out.sent_wave.sum, Vector3(1, 2, 3));
        EXPECT_EQ(out.is_clamped,
                  limited.force_on_hand_newton != asked.requested_force_on_hand_newton);
      }
      net.reset();
      guard.reset();
      EXPECT_EQ(resets, round + 1);
    }
  }
}

/// Rounding units, 2⁻⁵² of `of`, by which `value` is below `exact`.
double units_below(double exact, double value, double of = 1.0) {
  return (exact - value) / (of * std::numeric_limits<double>::epsilon());
}

// Every sum is lowered by 8 units of its terms (k = 8 · 2⁻⁵²), so that rounding never makes credit;
// with numbers that a double holds exactly the units can be counted.
// Work of ±1 J: 2k when it is booked (of the sum and of the step), k in the count, k in the sum.
TEST(LedgerRounding, WorkIsLoweredBy32Units) {
  for (const double x : {1.0, -1.0}) {
    EnergyLedger ledger(0.0, 0.0, 0.0);
    ledger.restart(Vector3::Zero());
    ledger.book(1.0, {-1, 0, 0}, {x, 0, 0});
    EXPECT_NEAR(units_below(x, ledger.energy_joule()), 32.0, 3.0);
  }
}

// −1 J as above, then 1 J that was drawn unread: 32 units, 2k for the two, 2k in the sum.
TEST(LedgerRounding, ADebtAndWhatWasDrawnUnreadAreLoweredBy64Units) {
  EnergyLedger ledger(0.0, 0.0, 0.0);
  ledger.restart(Vector3::Zero());
  ledger.book(1.0, {-1, 0, 0}, {-1, 0, 0});
  ledger.book_unread(1.0, Vector3::Zero());
  EXPECT_NEAR(units_below(-2.0, ledger.energy_joule()), 64.0, 4.0);
}

// 1 N held: (q/2)(1 + TV) with TV = 1 + k, so q (1 + k/2), k in the count, k in the sum; no more
// for holding it longer.
TEST(LedgerRounding, QuantisationIsRaisedBy20UnitsHoweverLongTheForceIsHeld) {
  const double q = std::ldexp(1.0, -10);
  EnergyLedger ledger(0.0, 0.0, q);
  ledger.restart(Vector3::Zero());
  for (int i = 0; i < 20; ++i) ledger.book(1.0, {-1, 0, 0}, Vector3::Zero());
  EXPECT_NEAR(units_below(-q, ledger.energy_joule(), q), 20.0, 2.0);
}

// Coulomb, 1 m along x: the force of friction less k, its work 2k; count and sum.
TEST(LedgerRounding, ThePathIsLoweredBy40Units) {
  EnergyLedger ledger(0.0, 1.0, 0.0);
  ledger.restart(Vector3::Zero());
  ledger.book(1.0, Vector3::Zero(), {1, 0, 0});
  EXPECT_NEAR(units_below(1.0, ledger.energy_joule()), 40.0, 3.0);
}

// Viscous, 1 m in 1 s: (1 − k)² / (1 + k), the sum of windows k; count and sum.
TEST(LedgerRounding, TheViscousPartIsLoweredBy48Units) {
  EnergyLedger ledger(1.0, 0.0, 0.0);
  ledger.restart(Vector3::Zero());
  ledger.book(1.0, Vector3::Zero(), {1, 0, 0});
  EXPECT_NEAR(units_below(1.0, ledger.energy_joule()), 48.0, 4.0);
}

// To and fro by 8 q against 1 N: 16 q, less 2 q for 4 N of changes. Units of q: friction 8·16 less
// 8·2, the two sums of the work 8·(8 + 8) + 8·(16 + 8), the changes 8·2, the count 8·(16 + 2), the
// sum 8·14. None more for resting there.
TEST(LedgerRounding, FrictionIsLoweredBy704UnitsOfAResolutionHoweverLongTheHandRests) {
  const double q = std::ldexp(1.0, -10);
  EnergyLedger ledger(0.0, 1.0, q);
  ledger.restart(Vector3::Zero());
  ledger.book(1.0, Vector3::Zero(), {8.0 * q, 0, 0});
  for (int i = 0; i < 100; ++i) ledger.book(1.0, Vector3::Zero(), Vector3::Zero());
  EXPECT_NEAR(units_below(14.0 * q, ledger.energy_joule(), q), 704.0, 40.0);
}

// 2 N for ½ s, 1 m/s at most. 0.25 m along it in 1 s: −1 J, 8·2·(0.25 + 1) = 20 units; k booked, k
// in the sum. 0.75 m against it: at least 0.25 m of them while it acted, +½ J, 8·2·(0.75 + 1) = 28.
TEST(LedgerRounding, AReleaseIsLoweredBy36Units) {
  for (const double moved_m : {0.25, -0.75}) {
    EnergyLedger ledger(0.0, 0.0, 0.0);
    ledger.restart(Vector3::Zero());
    ledger.book_release({.force_on_hand_newton = {2, 0, 0},
                         .acted_s = 0.5,
                         .duration_s = 1.0,
                         .hand_position_at_end_m = {moved_m, 0, 0},
                         .v_max_m_per_s = 1.0,
                         .most_drawn_joule = 100.0});
    EXPECT_NEAR(units_below(moved_m > 0.0 ? -1.0 : 0.5, ledger.energy_joule()), 36.0, 3.0);
  }
}

TEST(ControllerDefaults, AreThoseOfTheHeaders) {
  const GuardParameters guard;
  EXPECT_EQ(guard.mofc.f_d, 0.0);
  EXPECT_EQ(guard.mofc.f_co, 0.0);
  EXPECT_EQ(guard.mofc.T, 1e-3);
  EXPECT_EQ(guard.resolution_m, 0.0);
  EXPECT_EQ(guard.delta_max_s, 0.0);
  EXPECT_EQ(guard.prompt_s, 0.0);
  EXPECT_EQ(guard.longest_lease_s, 0.0);
  EXPECT_EQ(guard.v_max_m_per_s, 0.5);
  EXPECT_EQ(guard.credit_cap_joule, 5e-3);
  EXPECT_EQ(guard.contact_credit_joule, 0.0);
  EXPECT_EQ(guard.gate_joule, 10e-3);
  EXPECT_EQ(guard.gate_recovery_s, 0.5);
  const LeasedPoolParameters pool;
  EXPECT_EQ(pool.resolution_m, 0.0);
  EXPECT_EQ(pool.delta_max_s, 0.0);
  EXPECT_EQ(pool.prompt_s, 0.0);
  EXPECT_EQ(pool.longest_lease_s, 0.0);
  const Release release;
  EXPECT_EQ(release.acted_s, 0.0);
  EXPECT_EQ(release.duration_s, 0.0);
  EXPECT_EQ(release.v_max_m_per_s, 0.0);
  EXPECT_EQ(release.most_drawn_joule, 0.0);
  const AppliedStretch applied;
  EXPECT_EQ(applied.duration_s, 0.0);
  EXPECT_TRUE(applied.has_position_at_end);
  const ControlInput input;
  EXPECT_FALSE(input.has_gap);
  EXPECT_EQ(input.acting_lease_s, kUnbounded);
  EXPECT_TRUE(input.is_request_fresh);
  EXPECT_EQ(input.stored_energy_joule, 0.0);
  const ControlOutput output;
  EXPECT_EQ(output.ledger_energy_joule, 0.0);
  EXPECT_EQ(output.lease_s, 0.0);
  EXPECT_EQ(output.begins_within_s, 0.0);
  EXPECT_FALSE(output.is_clamped);
  EXPECT_FALSE(output.is_too_fast);
}

}  // namespace
}  // namespace palpate::controllers
