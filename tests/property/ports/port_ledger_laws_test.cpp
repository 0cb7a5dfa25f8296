// SPDX-License-Identifier: Apache-2.0
// The ledger of ports never counts more than a hand has put in, whatever it and the motors do.
#include <gtest/gtest.h>

#include <algorithm>

#include "mofc_node/controllers/ports/port_pool.h"
#include "tests/property/ports/leader_loop.h"
#include "tests/property/seeds.h"

namespace palpate::test {
namespace {

using controllers::PortLedger;

constexpr double kRoundingJoule = 1e-9;

/// How far the ledger rises above the true energy in a run in which efforts change at random and,
/// sometimes, end unread.
double most_excess_joule(LeaderCase& c, int stretches = 400) {
  Random& random = c.random;
  PortLedger ledger(c.parameters.used());
  PortValues effort{};
  ledger.restart(c.leader->read());
  double most = 0.0;
  for (int k = 0; k < stretches; ++k) {
    if (random.chance(0.1)) c.leader->change();
    if (random.chance(0.1)) c.leader->attack();
    if (random.chance(0.3)) {
      for (std::size_t i = 0; i < c.leader->count(); ++i) effort[i] = random.uniform(-0.5, 0.5);
      effort = c.leader->realised(effort);
    }
    const double duration_s = c.timing.period_s * random.uniform(0.1, 3.0);
    c.leader->hold(duration_s, effort);
    if (c.handle == nullptr && random.chance(0.1)) {
      const double rest_s = c.timing.period_s * random.uniform(0.0, 3.0);
      c.leader->hold(rest_s, {});
      ledger.book_release({.effort_on_hand = effort,
                           .acted_s = duration_s,
                           .duration_s = duration_s + rest_s,
                           .position_at_end = c.leader->read(),
                           .most_drawn_joule = 1e9});
    } else {
      ledger.book({.duration_s = duration_s,
                   .effort_on_hand = effort,
                   .position_at_end = c.leader->read(),
                   .doubt = c.leader->doubt(duration_s)});
    }
    most = std::max(most, ledger.energy_joule() - c.leader->energy_joule());
  }
  return most;
}

template <class Change>
double most_excess_with(std::size_t joints, Change&& change) {
  double most = 0.0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    LeaderCase c(seed, joints);
    change(c);
    most = std::max(most, most_excess_joule(c));
  }
  return most;
}

TEST(PortLedgerLaws, TheLedgerNeverExceedsTheTrueEnergy) {
  for (const std::size_t joints : {0U, 1U, 7U}) {
    EXPECT_LE(most_excess_with(joints, [](LeaderCase&) {}), kRoundingJoule) << joints;
  }
}

TEST(PortLedgerLaws, ItExceedsItWhereTheEncodersCountAsExact) {
  EXPECT_GT(most_excess_with(1,
                             [](LeaderCase& c) {
                               for (Port& port : c.parameters.ports) port.q = 0.0;
                             }),
            1e-4);
}

TEST(PortLedgerLaws, ItExceedsItWhereReleasesAreBookedAsIfTheHandWereSlower) {
  EXPECT_GT(most_excess_with(1,
                             [](LeaderCase& c) {
                               for (Port& port : c.parameters.ports) port.v_max *= 0.2;
                             }),
            1e-4);
}

// A body that turns round a cone has turned about its axis, which two orientations do not show.
TEST(PortLedgerLaws, ItExceedsItWhereNothingIsTakenOffForWhatATurningBodyHides) {
  const auto make_free = [](LeaderCase& c) {
    c.handle->make_free();
    c.take_profile();
  };
  EXPECT_LE(most_excess_with(0, make_free), kRoundingJoule);
  EXPECT_GT(most_excess_with(0,
                             [&](LeaderCase& c) {
                               make_free(c);
                               c.handle->counts_doubt = false;
                             }),
            1e-4);
}

TEST(PortLedgerLaws, ADoubtOverNoTimeCostsTheCredit) {
  const std::array<Port, 1> port{Port{.f_d = 1.0, .f_co = 0.3, .q = 0.0, .v_max = 4.0}};
  PortLedger ledger(port);
  ledger.restart({});
  ledger.book({.duration_s = 0.5, .position_at_end = {0.5}});
  const double before = 0.5 + 0.3 * 0.5;  // f_d Δx²/T + f_co Δx
  EXPECT_NEAR(ledger.energy_joule(), before, 1e-12);
  // −F·Δx is 2 · 0.1; the doubt (|F| + f_co + f_d (2 v_max + R/T)) R with R = 0.1
  ledger.book(
      {.duration_s = 0.5, .effort_on_hand = {-2.0}, .position_at_end = {0.6}, .doubt = {0.1}});
  const double doubt = (2.0 + 0.3 + 1.0 * (8.0 + 0.2)) * 0.1;
  EXPECT_NEAR(ledger.energy_joule(), before + 0.02 + 0.03 + 0.2 - doubt, 1e-12);
  ledger.book({.duration_s = 1.0, .position_at_end = {2.6}});
  EXPECT_GT(ledger.energy_joule(), 1.0);
  ledger.book({.duration_s = 0.0, .position_at_end = {2.6}, .doubt = {0.1}});
  EXPECT_EQ(ledger.energy_joule(), 0.0);
}

}  // namespace
}  // namespace palpate::test
