// SPDX-License-Identifier: Apache-2.0
// Mode vector: no hand and no environment draw energy. Each protection taken away, they do.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/property/controller_cases.h"

namespace palpate::controllers {
namespace {

TEST(VectorMofcLaws, NoHandAndNoEnvironmentDrawEnergyAtAnyInstant) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Case a_case(seed);
    EXPECT_GE(a_case.least_energy_joule(), -kRoundingJoule);
  }
}

// Without Coulomb friction, resolution and delay this is the energy bound of the force bounding
// approach, E ≥ Fᵀ B⁻¹ F / (4 ξ) with B = f_d/T and ξ = 1 ([Kim04], docs/theory.md §8): every
// force leaves enough in the ledger for the worst next interval, and no more than that where it is
// clamped.
TEST(VectorMofcLaws, EveryForceLeavesTheEnergyItMayCost) {
  constexpr double f_d = 0.1;
  constexpr double T = 0.001;
  int clamped = 0;
  for (const std::uint64_t seed : seeds(100)) {
    Random random(seed);
    VectorMofc controller({.f_d = f_d, .f_co = 0.0, .T = T}, 0.0, 0.0);
    Vector3 x = Vector3::Zero();
    Vector3 F = Vector3::Zero();
    Vector3 v = Vector3::Zero();
    for (int k = 0; k < 500; ++k) {
      v += 0.1 * random.uniform(0, 1) * random.direction();
      v *= 0.95;
      x += T * v;
      const AppliedStretch stretch{T, F, x, true};
      ControlInput input;
      input.hand_position_m = x;
      if (k > 0) input.applied = {&stretch, 1};
      input.requested_force_on_hand_newton = random.uniform(0, 3) * random.direction();
      const ControlOutput out = controller.step(input);
      F = out.force_on_hand_newton;
      const double cost_joule = F.squaredNorm() * T / (4.0 * f_d);
      ASSERT_LE(cost_joule, std::max(0.0, out.ledger_energy_joule) + 1e-12) << "seed " << seed;
      if (!out.is_clamped) continue;
      ++clamped;
      ASSERT_NEAR(cost_joule, std::max(0.0, out.ledger_energy_joule), 1e-12) << "seed " << seed;
    }
  }
  EXPECT_GT(clamped, 1000);
}

TEST(VectorMofcLaws, WithoutTheQuantisationTermsEnergyIsDrawn) {
  EXPECT_LT(least_energy_joule(50, [](Case& c) { c.assumed_q = 0.0; }), -1e-3);
}

TEST(VectorMofcLaws, WithoutTheReserveForTheDelayEnergyIsDrawn) {
  // nothing else in reserve: the encoder exact, the friction as assumed
  const auto make_tight = [](Case& c) {
    c.q = c.assumed_q = 0.0;
    c.hand.f_d = c.assumed.f_d;
    c.hand.f_co = c.assumed.f_co;
  };
  EXPECT_GE(least_energy_joule(200, make_tight), -kRoundingJoule);
  EXPECT_LT(least_energy_joule(200,
                               [&](Case& c) {
                                 make_tight(c);
                                 c.assumed_delay_s = 0.0;
                               }),
            -1e-4);
}

TEST(VectorMofcLaws, WithCommandsThatActLongerThanTheirLeaseEnergyIsDrawn) {
  EXPECT_LT(least_energy_joule(100,
                               [](Case& c) {
                                 c.timing.overrun = 2.0;
                                 c.timing.lost_answers = 0.3;
                               }),
            -1e-3);
}

TEST(VectorMofcLaws, WithFrictionOverestimatedEnergyIsDrawn) {
  EXPECT_LT(least_energy_joule(50, [](Case& c) { c.assumed.f_d *= 5.0; }), -1e-3);
  EXPECT_LT(least_energy_joule(50, [](Case& c) { c.assumed.f_co *= 5.0; }), -1e-3);
}

TEST(VectorMofcLaws, WithUnnoticedGapsEnergyIsDrawn) {
  // the controller ignores the gap
  class Blind final : public ForceController {
   public:
    explicit Blind(const VectorMofc& controller) : controller_(controller) {}
    void reset() noexcept override { controller_.reset(); }
    ControlOutput step(const ControlInput& input) noexcept override {
      ControlInput without = input;
      without.has_gap = false;
      return controller_.step(without);
    }

   private:
    VectorMofc controller_;
  };
  double least_joule = 0.0;
  for (std::uint64_t seed = 1; seed <= test::seed_count(50); ++seed) {
    Case c(seed);
    c.timing.lost_echoes = 0.05;
    Blind controller{VectorMofc(c.assumed, c.assumed_q, c.assumed_delay_s)};
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, c.assumed.f_co);
    loop.run(controller, 1500, [](const ControlInput&, const ControlOutput&) {});
    least_joule = std::min(least_joule, loop.least_energy_joule());
  }
  EXPECT_LT(least_joule, -1e-3);
}

}  // namespace
}  // namespace palpate::controllers
