// SPDX-License-Identifier: Apache-2.0
// One port is one axis of the three-axis guard; several ports are the sum of single ones; what is
// booked and granted, by hand.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "mofc_node/controllers/ports/port_guard.h"
#include "tests/property/controller_cases.h"

namespace palpate::controllers {
namespace {

/// The guard of three axes and, beside it, a port for its first one; both get the same.
class Beside final : public ForceController {
 public:
  Beside(const GuardParameters& p, std::uint64_t seed)
      : guard_(p), port_(parameters_of(p)), random_(seed), f_co_(p.mofc.f_co) {}
  void reset() noexcept override {}

  ControlOutput step(const ControlInput& asked) noexcept override {
    ControlInput input = asked;
    input.requested_force_on_hand_newton.tail<2>().setZero();
    input.is_request_fresh = random_.chance(0.5);
    if (random_.chance(0.2)) input.requested_force_on_hand_newton.setZero();
    input.stored_energy_joule = random_.uniform(-1e-3, 5e-3);
    if (random_.chance(0.3)) input.energy_limit_joule = random_.uniform(-1e-3, 1e-2);

    applied_.clear();
    for (const AppliedStretch& stretch : input.applied) {
      applied_.push_back({.duration_s = stretch.duration_s,
                          .effort_on_hand = {stretch.force_on_hand_newton.x()},
                          .position_at_end = {stretch.hand_position_at_end_m.x()},
                          .has_position_at_end = stretch.has_position_at_end,
                          .doubt = {}});
    }
    PortInput beside;
    beside.position = {input.hand_position_m.x()};
    beside.applied = applied_;
    beside.has_gap = input.has_gap;
    beside.acting_effort_on_hand = {input.acting_force_on_hand_newton.x()};
    beside.acting_lease_s = input.acting_lease_s;
    beside.energy_limit_joule = input.energy_limit_joule;
    beside.requested_effort_on_hand = {input.requested_force_on_hand_newton.x()};
    beside.is_request_fresh = input.is_request_fresh;
    beside.stored_energy_joule = input.stored_energy_joule;

    ControlOutput output = guard_.step(input);
    compare(output, port_.step(beside), std::abs(beside.acting_effort_on_hand[0]));
    if (random_.chance(0.002)) {
      guard_.reset();
      port_.reset();
    }
    return output;
  }

  int granted = 0;  // steps with a force beyond friction
  int steps = 0;

 private:
  static PortGuardParameters parameters_of(const GuardParameters& p) {
    return {.ports = {Port{.f_d = p.per_axis ? p.per_axis->f_d.x() : p.mofc.f_d,
                           .f_co = p.per_axis ? p.per_axis->f_co.x() : p.mofc.f_co,
                           .q = p.resolution_m,
                           .v_max = p.v_max_m_per_s}},
            .count = 1,
            .times = {.hold_s = p.mofc.T,
                      .delta_max_s = p.delta_max_s,
                      .prompt_s = p.prompt_s,
                      .longest_lease_s = p.longest_lease_s},
            .credit_cap_joule = p.credit_cap_joule,
            .contact_credit_joule = p.contact_credit_joule,
            .gate_joule = p.gate_joule,
            .gate_recovery_s = p.gate_recovery_s};
  }

  void compare(const ControlOutput& one, const PortOutput& other, double acting) {
    ++steps;
    const double force = one.force_on_hand_newton.x();
    // a square root near 0 magnifies what the sums round
    EXPECT_NEAR(other.effort_on_hand[0], force, 5e-4);
    EXPECT_NEAR(other.most_effort[0], one.f_max_newton.x(), 5e-4);
    EXPECT_NEAR(other.ledger_energy_joule, one.ledger_energy_joule, 1e-11);
    EXPECT_NEAR(other.counted_energy_joule, one.counted_energy_joule, 1e-11);
    // a force little above friction draws next to nothing, for as long as rounding leaves it
    constexpr double kWellAbove = 0.1;
    if (acting > f_co_ + kWellAbove) {
      EXPECT_NEAR(other.begins_within_s, one.begins_within_s, 1e-3 * one.begins_within_s);
    }
    if (std::abs(force) > f_co_ + kWellAbove) {
      EXPECT_NEAR(other.lease_s, one.lease_s, 1e-3 * one.lease_s);
      ++granted;
    }
    EXPECT_EQ(other.is_too_fast, one.is_too_fast);
  }

  GuardMofc guard_;
  PortGuard port_;
  Random random_;
  double f_co_;
  std::vector<PortStretch> applied_;
};

void expect_alike(bool is_exact) {
  int granted = 0;
  int steps = 0;
  for (const std::uint64_t seed : seeds(40)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    GuardCase c(seed);
    c.hand.is_on_rail = true;
    c.hand.position_m.tail<2>().setZero();
    GuardParameters p = c.parameters();
    if (seed % 2 == 0) p.prompt_s = 0.5 * p.delta_max_s;
    if (is_exact) {
      c.q = p.resolution_m = 0.0;
      p.gate_joule = 1e9;  // half closed, it takes its share of the bound there, of the force here
    } else {
      // nothing moves on the others; the release of three axes leaves friction out
      p.per_axis = AxisFriction{Vector3(p.mofc.f_d, 1e3, 1e3), Vector3(p.mofc.f_co, 1e3, 1e3)};
      c.timing.silent_watchdog = 0.0;
    }
    Beside beside(p, seed);
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, std::min(c.assumed.f_co, c.hand.f_co));
    loop.run(beside, 500, [](const ControlInput&, const ControlOutput&) {});
    granted += beside.granted;
    steps += beside.steps;
    if (testing::Test::HasFailure()) return;
  }
  EXPECT_GT(granted, steps / 20);
}

TEST(PortGuard, WithOnePortAndAnExactEncoderItIsTheGuardAlongALine) { expect_alike(true); }

TEST(PortGuard, WithOnePortAndAnEncoderItIsTheGuardOfOneAxis) { expect_alike(false); }

std::array<Port, 3> three_ports() {
  return {Port{.f_d = 0.1, .f_co = 0.05, .q = 1e-3, .v_max = 3.0},
          Port{.f_d = 0.02, .f_co = 0.2, .q = 55e-6, .v_max = 0.5},
          Port{.f_d = 0.3, .f_co = 0.0, .q = 0.0, .v_max = 10.0}};
}

TEST(PortLedger, OfSeveralPortsIsTheSumOfThoseOfEach) {
  const auto ports = three_ports();
  for (const std::uint64_t seed : seeds(50)) {
    Random random(seed);
    PortLedger all(ports);
    std::vector<PortLedger> single;
    single.reserve(ports.size());
    for (const Port& port : ports) single.emplace_back(std::span(&port, 1));
    PortValues x{};
    for (int k = 0; k < 100; ++k) {
      const double duration_s = random.uniform(1e-3, 5e-3);
      PortStretch stretch{.duration_s = duration_s};
      for (std::size_t i = 0; i < 3; ++i) {
        x[i] += random.uniform(-1.0, 1.0) * duration_s * ports[i].v_max;
        stretch.position_at_end[i] = x[i];
        stretch.effort_on_hand[i] = random.uniform(-1.0, 1.0);
        stretch.doubt[i] = random.chance(0.1) ? 1e-4 : 0.0;
      }
      const bool is_release = random.chance(0.3);
      const auto book = [&](PortLedger& ledger, const PortStretch& part) {
        if (!is_release) return ledger.book(part);
        ledger.book_release({.effort_on_hand = part.effort_on_hand,
                             .acted_s = 0.4 * duration_s,
                             .duration_s = duration_s,
                             .position_at_end = part.position_at_end,
                             .most_drawn_joule = 1e9});
      };
      book(all, stretch);
      double energy = 0.0;
      double dissipated = 0.0;
      for (std::size_t i = 0; i < 3; ++i) {
        book(single[i], {.duration_s = duration_s,
                         .effort_on_hand = {stretch.effort_on_hand[i]},
                         .position_at_end = {stretch.position_at_end[i]},
                         .doubt = {stretch.doubt[i]}});
        energy += single[i].energy_joule();
        dissipated += single[i].dissipated_joule();
      }
      ASSERT_NEAR(all.energy_joule(), energy, 1e-12) << "seed " << seed << " k " << k;
      ASSERT_NEAR(all.dissipated_joule(), dissipated, 1e-12);
    }
    EXPECT_GT(all.dissipated_joule(), 0.0);
  }
}

/// A pool of three ports that has seen a motion, hence with credit, and what it counts then.
struct Pool {
  std::array<Port, 3> ports = three_ports();
  PortPool pool{ports, {.hold_s = 1e-3, .delta_max_s = 0.0, .longest_lease_s = 20e-3}};
  PortValues x{};

  Pool() {
    step({});
    for (int k = 0; k < 50; ++k) {
      const std::array<PortStretch, 1> stretch{moved_by({0.01, 0.001, 0.02}, {})};
      step(stretch);
    }
  }
  PortStretch moved_by(const PortValues& moved, const PortValues& effort) {
    for (std::size_t i = 0; i < 3; ++i) x[i] += moved[i];
    return {.duration_s = 10e-3, .effort_on_hand = effort, .position_at_end = x};
  }
  Booked step(std::span<const PortStretch> applied, bool has_gap = false) {
    PortInput input;
    input.position = x;
    input.applied = applied;
    input.has_gap = has_gap;
    return pool.book(input);
  }
  [[nodiscard]] double energy_joule() const { return pool.grant({}, {}, 1.0).counted_energy_joule; }
};

TEST(PortPool, BooksEffortsThatChangedUnreadWithAllThatTheyCanHaveDrawn) {
  Pool p;
  const double before = p.energy_joule();
  ASSERT_GT(before, 1e-3);
  const PortValues first{0.2, 0.0, 0.0};
  const PortValues second{0.0, 0.0, 0.1};
  std::array<PortStretch, 3> applied{p.moved_by({}, first), p.moved_by({}, second),
                                     p.moved_by({0.01, 0.0, 0.0}, {})};
  applied[0].has_position_at_end = applied[1].has_position_at_end = false;
  applied[0].duration_s = 1e-3;
  applied[1].duration_s = 2e-3;
  const Booked booked = p.step(applied);
  EXPECT_NEAR(booked.elapsed_s, 13e-3, 1e-15);
  EXPECT_EQ(booked.work_joule, 0.0);
  const double drawn =
      1e-3 * p.pool.clamp().drain_watt(first) + 2e-3 * p.pool.clamp().drain_watt(second);
  EXPECT_GT(drawn, 1e-5);
  EXPECT_NEAR(p.energy_joule(), before - drawn, 1e-12);
}

TEST(PortPool, AReleaseOfADoubtfulPortIsBookedWithItsDrain) {
  Pool p;
  const double before = p.energy_joule();
  const PortValues effort{0.2, 0.0, 0.0};
  std::array<PortStretch, 2> applied{p.moved_by({}, effort), p.moved_by({0.02, 0.0, 0.0}, {})};
  applied[0].has_position_at_end = false;
  applied[0].doubt[0] = 1e-9;
  p.step(applied);
  EXPECT_NEAR(p.energy_joule(), before - 10e-3 * p.pool.clamp().drain_watt(effort), 1e-12);
}

TEST(PortPool, SaysWhatTheHandHasDoneAgainstTheEfforts) {
  Pool p;
  const std::array<PortStretch, 1> stretch{p.moved_by({0.01, -0.002, 0.0}, {-2.0, 1.0, 5.0})};
  EXPECT_NEAR(p.step(stretch).work_joule, 2.0 * 0.01 + 0.002, 1e-15);
  EXPECT_EQ(p.step(stretch, true).elapsed_s, 0.0);
}

// The rest of what the acting effort may still draw is set aside, and no longer than it acts.
TEST(PortPool, SetsAsideWhatTheActingEffortMayStillDraw) {
  const std::array<Port, 1> ports{Port{.f_d = 0.0, .f_co = 0.1, .q = 0.0, .v_max = 1.0}};
  PortPool pool(ports, {.hold_s = 1e-3, .delta_max_s = 2e-3, .longest_lease_s = 1e-3});
  static_cast<void>(pool.book({}));
  const std::array<PortStretch, 1> moved{
      PortStretch{.duration_s = 1.0, .position_at_end = {0.05}}};  // 0.1 N over 0.05: 5 mJ
  PortInput input;
  input.position = {0.05};
  input.applied = moved;
  static_cast<void>(pool.book(input));
  input.acting_effort_on_hand = {1.1};  // 1 W
  for (const double lease_s : {0.0, 1.5e-3, 1.0}) {
    input.acting_lease_s = lease_s;
    const double spent = std::min(lease_s, 2e-3);
    // T (F − 0.1) 1 = 5 mJ − spent
    const PortOutput output = pool.grant(input, {100.0}, 1.0);
    EXPECT_NEAR(output.effort_on_hand[0], 0.1 + (5e-3 - spent) / 1e-3, 1e-6) << lease_s;
    EXPECT_NEAR(output.most_effort[0], 0.1 + (5e-3 - spent) / 1e-3, 1e-6);
    EXPECT_NEAR(output.ledger_energy_joule, 5e-3, 1e-12);
  }
  pool.limit(2e-3);
  EXPECT_NEAR(pool.grant(input, {}, 1.0).ledger_energy_joule, 2e-3, 1e-12);
  input.energy_limit_joule = 1e-3;
  EXPECT_NEAR(pool.grant(input, {}, 1.0).ledger_energy_joule, 1e-3, 1e-12);
  EXPECT_NEAR(pool.grant(input, {}, 1.0).counted_energy_joule, 2e-3, 1e-12);
}

TEST(PortGuardParameters, UseNoMoreThanEightPorts) {
  PortGuardParameters p;
  p.count = 100;
  EXPECT_EQ(p.used().size(), kMostPorts);
  p.count = 3;
  EXPECT_EQ(p.used().size(), 3U);
}

}  // namespace
}  // namespace palpate::controllers
