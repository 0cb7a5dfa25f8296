// SPDX-License-Identifier: Apache-2.0
// Friction per axis: no hand and no environment draw energy in the modes with one pool.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/property/controller_cases.h"

namespace palpate::controllers {
namespace {

/// The least energy over many cases with friction per axis, in which `change` has been made.
template <class SomeCase, class Change>
double least_energy_per_axis_joule(std::uint64_t count, bool is_tight, Change&& change) {
  double least = 0.0;
  for (std::uint64_t seed = 1; seed <= test::seed_count(count); ++seed) {
    SomeCase c(seed);
    give_friction_per_axis(c, seed, is_tight);
    change(c);
    least = std::min(least, c.least_energy_joule());
  }
  return least;
}

template <class SomeCase>
class FrictionPerAxisLaws : public testing::Test {};
using ModesWithOnePool = testing::Types<Case, GuardCase>;
TYPED_TEST_SUITE(FrictionPerAxisLaws, ModesWithOnePool);

TYPED_TEST(FrictionPerAxisLaws, NoHandAndNoEnvironmentDrawEnergyAtAnyInstant) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    TypeParam c(seed);
    give_friction_per_axis(c, seed, seed % 2 == 0);
    EXPECT_GE(c.least_energy_joule(), -kRoundingJoule);
  }
}

// The same cases, each with one assumption broken: the law above can fail.
TYPED_TEST(FrictionPerAxisLaws, WithoutTheQuantisationTermsEnergyIsDrawn) {
  EXPECT_LT(
      least_energy_per_axis_joule<TypeParam>(50, false, [](TypeParam& c) { c.assumed_q = 0.0; }),
      -1e-3);
}

TYPED_TEST(FrictionPerAxisLaws, WithFrictionOverestimatedOnOneAxisEnergyIsDrawn) {
  EXPECT_LT(least_energy_per_axis_joule<TypeParam>(
                50, true, [](TypeParam& c) { c.assumed_per_axis->f_d.y() *= 5.0; }),
            -1e-3);
  EXPECT_LT(least_energy_per_axis_joule<TypeParam>(
                50, true, [](TypeParam& c) { c.assumed_per_axis->f_co.y() *= 5.0; }),
            -1e-3);
}

TYPED_TEST(FrictionPerAxisLaws, TreatedAsIsotropicOnlyTheSmallestOfEachIsSafe) {
  const auto assume = [](TypeParam& c, double f_d, double f_co) {
    c.assumed_per_axis.reset();
    c.assumed.f_d = f_d;
    c.assumed.f_co = f_co;
  };
  EXPECT_GE(least_energy_per_axis_joule<TypeParam>(100, true,
                                                   [&](TypeParam& c) {
                                                     assume(c, c.hand.per_axis->f_d.minCoeff(),
                                                            c.hand.per_axis->f_co.minCoeff());
                                                   }),
            -kRoundingJoule);
  EXPECT_LT(least_energy_per_axis_joule<TypeParam>(100, true,
                                                   [&](TypeParam& c) {
                                                     assume(c, c.hand.per_axis->f_d.mean(),
                                                            c.hand.per_axis->f_co.mean());
                                                   }),
            -1e-3);
}

/// The least energy on devices with isotropic friction when the Coulomb friction of each axis is
/// assumed to be this share of it.
template <class SomeCase>
double least_energy_treated_per_axis_joule(std::uint64_t count, double share) {
  double least = 0.0;
  for (std::uint64_t seed = 1; seed <= test::seed_count(count); ++seed) {
    SomeCase c(seed);
    c.hand.f_d = c.assumed.f_d;
    c.hand.f_co = c.assumed.f_co;
    c.assumed_per_axis = {.f_d = Vector3::Constant(c.hand.f_d),
                          .f_co = Vector3::Constant(share * c.hand.f_co)};
    least = std::min(least, c.least_energy_joule());
  }
  return least;
}

// Across the axes Σ|v_i| = √3|v|: with f_co on each axis, friction is credited with √3 of what it
// takes.
TYPED_TEST(FrictionPerAxisLaws, IsotropicFrictionTreatedAsPerAxisNeedsOneOverSqrt3) {
  EXPECT_LT(least_energy_treated_per_axis_joule<TypeParam>(100, 1.0), -1e-3);
  EXPECT_GE(least_energy_treated_per_axis_joule<TypeParam>(100, 1.0 / std::numbers::sqrt3),
            -kRoundingJoule);
}

// Σ drain is infinite where an axis has no viscous friction; a hand of bounded speed is not.
TEST(GuardMofcLaws, WithoutViscousFrictionOnAnAxisItRendersOnItAndKeepsTheLaw) {
  std::uint64_t rendered = 0;
  for (const std::uint64_t seed : seeds(100)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    GuardCase c(seed);
    give_friction_per_axis(c, seed, false);
    const int axis = static_cast<int>(seed % 3);
    c.assumed_per_axis->f_d[axis] = c.hand.per_axis->f_d[axis] = 0.0;
    if (seed % 4 == 0) c.assumed_per_axis->f_d = c.hand.per_axis->f_d = Vector3::Zero();
    GuardMofc guard(c.parameters());
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, c.assumed.f_co);
    loop.run(guard, 1500, [&](const ControlInput&, const ControlOutput& out) {
      ASSERT_TRUE(out.f_max_newton.allFinite());
      if (std::abs(out.force_on_hand_newton[axis]) > c.assumed_per_axis->f_co[axis] + 0.1)
        ++rendered;
    });
    EXPECT_GE(loop.least_energy_joule(), -kRoundingJoule);
  }
  EXPECT_GT(rendered, 1000u);
}

}  // namespace
}  // namespace palpate::controllers
