// SPDX-License-Identifier: Apache-2.0
// Mode guard: no hand within v_max and no environment draw energy.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "tests/property/controller_cases.h"

namespace palpate::controllers {
namespace {

template <class Change>
double least_energy_of_guard_joule(std::uint64_t count, Change&& change) {
  double least = 0.0;
  for (std::uint64_t seed = 1; seed <= test::seed_count(count); ++seed) {
    GuardCase a_case(seed);
    change(a_case);
    least = std::min(least, a_case.least_energy_joule());
  }
  return least;
}

TEST(GuardMofcLaws, NoHandWithinVMaxAndNoEnvironmentDrawEnergyAtAnyInstant) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    GuardCase a_case(seed);
    EXPECT_GE(a_case.least_energy_joule(), -kRoundingJoule);
  }
}

// Eq. (13) alone would allow f_co and no more.
TEST(GuardMofcLaws, WithoutViscousFrictionItRendersMoreThanFrictionAndKeepsTheLaw) {
  std::uint64_t rendered = 0;
  for (const std::uint64_t seed : seeds(100)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    GuardCase c(seed);
    c.hand.f_d = c.assumed.f_d = 0.0;
    GuardMofc guard(c.parameters());
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, std::min(c.assumed.f_co, c.hand.f_co));
    loop.run(guard, 1500, [&](const ControlInput&, const ControlOutput& out) {
      ASSERT_TRUE(std::isfinite(out.f_max_newton.x()));
      if (out.force_on_hand_newton.norm() > c.assumed.f_co + 0.1) ++rendered;
    });
    EXPECT_GE(loop.least_energy_joule(), -kRoundingJoule);
  }
  EXPECT_GT(rendered, 1000u);
}

// The same cases, each with one assumption broken: the law above can fail.
TEST(GuardMofcLaws, WithAHandFasterThanVMaxEnergyIsDrawn) {
  EXPECT_LT(least_energy_of_guard_joule(50, [](GuardCase& c) { c.hand.v_max_m_per_s *= 3.0; }),
            -1e-3);
}

TEST(GuardMofcLaws, WithoutTheQuantisationTermsEnergyIsDrawn) {
  EXPECT_LT(least_energy_of_guard_joule(50, [](GuardCase& c) { c.assumed_q = 0.0; }), -1e-3);
}

/// Nothing in reserve: the encoder exact, the friction as assumed, the credit unbounded.
void make_tight(GuardCase& c) {
  c.q = c.assumed_q = 0.0;
  c.hand.f_d = c.assumed.f_d;
  c.hand.f_co = c.assumed.f_co;
  c.credit_cap_joule = c.gate_joule = 1e3;
}

TEST(GuardMofcLaws, WithNothingInReserveNoEnergyIsDrawn) {
  EXPECT_GE(least_energy_of_guard_joule(200, make_tight), -kRoundingJoule);
}

TEST(GuardMofcLaws, WithoutTheReserveForTheDelayEnergyIsDrawn) {
  EXPECT_LT(least_energy_of_guard_joule(200,
                                        [](GuardCase& c) {
                                          make_tight(c);
                                          c.assumed_delay_s = 0.0;
                                        }),
            -1e-4);
}

TEST(GuardMofcLaws, WithCommandsThatActLongerThanTheirLeaseEnergyIsDrawn) {
  EXPECT_LT(least_energy_of_guard_joule(200,
                                        [](GuardCase& c) {
                                          make_tight(c);
                                          c.timing.overrun = 2.0;
                                          c.timing.lost_answers = 0.3;
                                        }),
            -1e-3);
}

TEST(GuardMofcLaws, WithFrictionOverestimatedEnergyIsDrawn) {
  EXPECT_LT(least_energy_of_guard_joule(50, [](GuardCase& c) { c.assumed.f_d *= 5.0; }), -1e-3);
  EXPECT_LT(least_energy_of_guard_joule(50, [](GuardCase& c) { c.assumed.f_co *= 5.0; }), -1e-3);
}

// Two controllers in the same run, one with practically unlimited credit; the echo is that of the
// bounded one.
TEST(GuardMofcLaws, CapAndGateOnlyLowerTheCreditAndTheForce) {
  int lowered = 0;
  for (const std::uint64_t seed : seeds(100)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    GuardCase c(seed);
    GuardMofc bounded(c.parameters());
    RandomClaims controller(bounded, seed);
    GuardParameters open = c.parameters();
    open.credit_cap_joule = open.gate_joule = 1e12;
    GuardMofc unbounded(open);
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, std::min(c.assumed.f_co, c.hand.f_co));
    loop.run(controller, 1500, [&](const ControlInput& in, const ControlOutput& out) {
      const ControlOutput more = unbounded.step(in);
      const double rounding = 1e-9 * (1.0 + std::abs(more.ledger_energy_joule));
      ASSERT_LE(out.ledger_energy_joule, more.ledger_energy_joule + rounding);
      ASSERT_LE(out.ledger_energy_joule,
                std::max({0.0, controller.stored_joule, c.contact_credit_joule}) +
                    c.credit_cap_joule + 1e-12);
      ASSERT_LE(out.f_max_newton.x(), more.f_max_newton.x() * (1.0 + 1e-9) + 1e-3);
      if (out.f_max_newton.x() < 0.9 * more.f_max_newton.x()) ++lowered;
    });
  }
  EXPECT_GT(lowered, 1000);
}

// A straight path of n intervals T at `speed`, measured with resolution q: (|Δh| − √3 q) / T is a
// lower bound of the speed.
TEST(GuardMofcLaws, AHandFasterThanVMaxIsReportedAndASlowerOneNever) {
  for (const std::uint64_t seed : seeds(100)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const double T = 1e-3;
    const double q = random.chance(0.3) ? 0.0 : random.uniform(0.0, 1e-4);
    const double v_max = random.uniform(0.2, 1.0);
    for (const bool is_fast : {false, true}) {
      // measured: at least d − √3 q of the way, so 2√3 q more than allowed shows for sure
      const double d = is_fast ? v_max * T + 2.0 * std::numbers::sqrt3 * q + 1e-9
                               : random.uniform(0.0, 1.0) * v_max * T;
      GuardMofc guard(
          {.mofc = {.f_d = 0.1, .f_co = 0.1, .T = T}, .resolution_m = q, .v_max_m_per_s = v_max});
      const Vector3 direction = random.direction();
      Vector3 x = 0.05 * random.direction();
      (void)guard.step({.hand_position_m = quantised(x, q), .applied = {}});
      for (int k = 0; k < 50; ++k) {
        x += d * direction;
        const Vector3 measured = quantised(x, q);
        const std::vector<AppliedStretch> echo{{T, Vector3::Zero(), measured, true}};
        ASSERT_EQ(guard.step({.hand_position_m = measured, .applied = echo}).is_too_fast, is_fast);
      }
    }
  }
}

TEST(GuardMofcLaws, ItReducesTheRequestedForceOrKeepsIt) {
  std::uint64_t clamped = 0;
  for (const std::uint64_t seed : seeds(50)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    GuardCase c(seed);
    GuardMofc guard(c.parameters());
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, std::min(c.assumed.f_co, c.hand.f_co));
    loop.run(guard, 1500, [&](const ControlInput& in, const ControlOutput& out) {
      ASSERT_NO_FATAL_FAILURE(expect_reduced_or_kept(in, out));
      if (out.is_clamped) ++clamped;
    });
  }
  EXPECT_GT(clamped, 0u);
}

}  // namespace
}  // namespace palpate::controllers
