// SPDX-License-Identifier: Apache-2.0
#include "common/contact/elastic/grip.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <limits>
#include <utility>

#include "common/core/random.h"

namespace palpate {
namespace {

Vector3 some(Random& random, double most) {
  return {random.uniform(-most, most), random.uniform(-most, most), random.uniform(-most, most)};
}

/// Of any shape, the stiffest axis up to a million times the softest.
Matrix3 spring(Random& random) {
  Matrix3 m;
  for (double& x : m.reshaped()) x = random.uniform(-1.0, 1.0);
  const Matrix3 q = m.householderQr().householderQ();
  Vector3 k;
  for (double& x : k) x = std::pow(10.0, random.uniform(0.0, 6.0));
  const Matrix3 K = q * k.asDiagonal() * q.transpose();
  return 0.5 * (K + K.transpose());
}

TEST(Grip, HoldsAForceThatIsNotTooLarge) {
  const GripSlip slip = slip_in_jaws({3, 0, -4}, 200.0 * Matrix3::Identity(), 5.0);
  EXPECT_EQ(slip.force_on_tool_newton, Vector3(3, 0, -4));
  EXPECT_EQ(slip.slip_m, Vector3::Zero());
}

// 10 N on a spring of 200 N/m, of which the jaws hold 4: the tool slips until the spring is 20 mm
// long, which is 30 mm, away from the tissue that pulls it back.
TEST(Grip, SlipsUntilItHolds) {
  const GripSlip slip = slip_in_jaws({0, 0, -10}, 200.0 * Matrix3::Identity(), 4.0);
  EXPECT_NEAR((slip.force_on_tool_newton - Vector3(0, 0, -4)).norm(), 0.0, 1e-12);
  EXPECT_NEAR((slip.slip_m - Vector3(0, 0, 0.03)).norm(), 0.0, 1e-14);
}

TEST(Grip, WhateverTheSpringASlipDissipatesAndEndsAtTheLimit) {
  Random random(37);
  for (int i = 0; i < 10'000; ++i) {
    const Matrix3 K = spring(random);
    const Vector3 force = some(random, 20.0);
    const double most = random.uniform(0.01, 10.0);
    if (force.norm() <= most) continue;
    const GripSlip slip = slip_in_jaws(force, K, most);
    ASSERT_NEAR(slip.force_on_tool_newton.norm(), most, 1e-9 * most);
    // the law, and Coulomb's direction
    ASSERT_NEAR((slip.force_on_tool_newton - force - K * slip.slip_m).norm(), 0.0,
                1e-7 * force.norm());
    const double dissipated = -slip.slip_m.dot(slip.force_on_tool_newton);
    ASSERT_NEAR(dissipated, slip.slip_m.norm() * most, 1e-9 * dissipated);
    // no more than the spring gives up
    const auto stored = [&](const Vector3& f) { return 0.5 * f.dot(K.inverse() * f); };
    ASSERT_LE(dissipated, (1 + 1e-6) * (stored(force) - stored(slip.force_on_tool_newton)));
  }
}

TEST(Grip, CutsAForceWhoseSlipWouldNotBeFinite) {
  const Matrix3 none = 1e-320 * Matrix3::Identity();
  const GripSlip slip = slip_in_jaws({0, 8, 0}, none, 2.0);
  EXPECT_TRUE(slip.slip_m.allFinite());
  EXPECT_LE(slip.force_on_tool_newton.norm(), 2.0 * (1 + 1e-9));

  const double infinity = std::numeric_limits<double>::infinity();
  const GripSlip endless = slip_in_jaws({0, infinity, 0}, Matrix3::Identity(), 2.0);
  EXPECT_TRUE(endless.slip_m.allFinite());
  EXPECT_TRUE(endless.force_on_tool_newton.allFinite());
}

// --- needle --------------------------------------------------------------------------------------

constexpr double kCut_newton = 0.4;
constexpr double kSpread_newton = 0.1;
constexpr double kRub_newton_per_m = 20.0;
constexpr double kAxis_newton_per_m = 300.0;

NeedleLaw needle_at(double deepest_m) {
  return {.inward_world = -Vector3::UnitZ(),
          .cutting_newton = kCut_newton,
          .spreading_newton = kSpread_newton,
          .friction_newton_per_m = kRub_newton_per_m,
          .deepest_m = deepest_m};
}
/// On a spring of 300 N/m.
GripSlip pushed(double newton, double depth_m, double deepest_m) {
  return slip_of_needle({1.0, 0, newton}, kAxis_newton_per_m * Matrix3::Identity(),
                        needle_at(deepest_m), depth_m);
}

// 10 mm deep the tissue rubs with 0.2 N: below 0.7 N inward and 0.2 N outward it moves with the
// needle, and across it always does.
TEST(Needle, StandsBelowWhatCutsSpreadsAndRubs) {
  for (const double newton : {0.699, 0.0, -0.199}) {
    const GripSlip slip = pushed(newton, 0.01, 0.01);
    EXPECT_EQ(slip.slip_m, Vector3::Zero()) << newton;
    EXPECT_EQ(slip.force_on_tool_newton, Vector3(1.0, 0, newton));
    EXPECT_FALSE(slip.is_out);
  }
}

// 1.34 N are 0.64 N more: over 300 + 20 N/m that is 2 mm, at which it yields at 0.74 N.
TEST(Needle, CutsUntilItHolds) {
  const GripSlip slip = pushed(1.34, 0.01, 0.01);
  EXPECT_NEAR((slip.slip_m - Vector3(0, 0, -0.002)).norm(), 0.0, 1e-15);
  EXPECT_NEAR((slip.force_on_tool_newton - Vector3(1.0, 0, 0.74)).norm(), 0.0, 1e-12);
}

TEST(Needle, NeedsNoForceToCutInAHoleAndStandsAtItsEnd) {
  // 0.94 N in a hole of 13 mm: 0.3 N over 320 N/m
  EXPECT_NEAR(pushed(0.62, 0.01, 0.013).slip_m.z(), -0.001, 1e-15);
  // to the end, where 0.64 N are left: less than 0.76 N, which cut there
  const GripSlip end = pushed(1.54, 0.01, 0.013);
  EXPECT_NEAR(end.slip_m.z(), -0.003, 1e-15);
  EXPECT_NEAR(end.force_on_tool_newton.z(), 0.64, 1e-12);
  // beyond
  EXPECT_NEAR(pushed(1.98, 0.01, 0.013).slip_m.z(), -0.004, 1e-15);
}

TEST(Needle, ComesBackAgainstFrictionAloneUntilItIsOut) {
  const GripSlip slip = pushed(-0.8, 0.01, 0.03);
  EXPECT_NEAR(slip.slip_m.z(), 0.002, 1e-15);
  EXPECT_NEAR(slip.force_on_tool_newton.z(), -0.2, 1e-12);
  EXPECT_FALSE(slip.is_out);
  const GripSlip out = pushed(-3.3, 0.01, 0.03);
  EXPECT_TRUE(out.is_out);
  EXPECT_EQ(out.force_on_tool_newton, Vector3::Zero());
}

TEST(Needle, WhateverTheSpringASlipDissipates) {
  Random random(41);
  for (int i = 0; i < 10'000; ++i) {
    const Matrix3 K = spring(random);
    const Vector3 force = some(random, 20.0);
    NeedleLaw needle{.inward_world = (some(random, 1.0) + 2.0 * Vector3::UnitX()).normalized(),
                     .cutting_newton = random.uniform(0.0, 5.0),
                     .spreading_newton = random.uniform(0.0, 5.0),
                     .friction_newton_per_m = std::pow(10.0, random.uniform(-2.0, 6.0)),
                     .deepest_m = random.uniform(0.0, 0.1)};
    const double depth_m = random.uniform(0.0, 0.1);
    const GripSlip slip = slip_of_needle(force, K, needle, depth_m);
    ASSERT_TRUE(slip.force_on_tool_newton.allFinite() && slip.slip_m.allFinite());
    const double way_m = slip.slip_m.dot(needle.inward_world);
    ASSERT_NEAR((slip.slip_m - way_m * needle.inward_world).norm(), 0.0, 1e-12);
    ASSERT_GE(way_m, -std::max(0.0, depth_m) - 1e-12);
    if (slip.is_out) continue;
    ASSERT_NEAR((slip.force_on_tool_newton - force - K * slip.slip_m).norm(), 0.0,
                1e-7 * force.norm());
    const double dissipated = -slip.slip_m.dot(slip.force_on_tool_newton);
    ASSERT_GE(dissipated, -1e-9 * std::abs(way_m) * force.norm());
    const auto stored = [&](const Vector3& f) { return 0.5 * f.dot(K.inverse() * f); };
    ASSERT_LE(dissipated, (1 + 1e-6) * (stored(force) - stored(slip.force_on_tool_newton)) + 1e-12);
    // and it stands where it has come to
    Grip grip{.needle = needle};
    static_cast<void>(slip_of(grip, depth_m * needle.inward_world, force, K));
    ASSERT_GE(grip.needle.deepest_m, depth_m + way_m - 1e-15);
    const double again_m =
        slip_of_needle(slip.force_on_tool_newton, K, grip.needle, depth_m + way_m).slip_m.norm();
    if (way_m >= 0.0) {
      ASSERT_LE(again_m, 1e-7 + 1e-6 * way_m);
    }
  }
}

/// A blade that cuts along x, its edge along z.
NeedleLaw blade_at(double deepest_m) {
  return {.inward_world = Vector3::UnitX(),
          .cutting_newton = kCut_newton,
          .deepest_m = deepest_m,
          .edge_world = Vector3::UnitZ(),
          .friction_newton = 0.1};
}

// 0.5 N cut and rub; across the blade it holds whatever acts there.
TEST(Blade, CutsWhereItFacesSlidesAlongItsEdgeAndHoldsAcross) {
  const Matrix3 K = kAxis_newton_per_m * Matrix3::Identity();
  const NeedleLaw blade = blade_at(0.01);
  EXPECT_EQ(slip_of_needle({-0.499, 5.0, 0.099}, K, blade, 0.01).slip_m, Vector3::Zero());
  const GripSlip cuts = slip_of_needle({-0.8, 5.0, 0.0}, K, blade, 0.01);
  EXPECT_NEAR((cuts.slip_m - Vector3(0.001, 0, 0)).norm(), 0.0, 1e-15);
  EXPECT_NEAR((cuts.force_on_tool_newton - Vector3(-0.5, 5.0, 0)).norm(), 0.0, 1e-12);
  const GripSlip slides = slip_of_needle({0.0, 5.0, -0.4}, K, blade, 0.01);
  EXPECT_NEAR((slides.slip_m - Vector3(0, 0, 0.001)).norm(), 0.0, 1e-15);
  EXPECT_NEAR((slides.force_on_tool_newton - Vector3(0, 5.0, -0.1)).norm(), 0.0, 1e-12);
  // back in its cut: friction alone
  const GripSlip back = slip_of_needle({0.4, 5.0, 0.0}, K, blade, 0.01);
  EXPECT_NEAR((back.slip_m - Vector3(-0.001, 0, 0)).norm(), 0.0, 1e-15);
  EXPECT_NEAR(back.force_on_tool_newton.x(), 0.1, 1e-12);
}

TEST(Blade, WhateverTheSpringASlipTakesEnergyOut) {
  Random random(43);
  int slides = 0;
  for (int i = 0; i < 10'000; ++i) {
    const Matrix3 K = spring(random);
    const Vector3 force = some(random, 20.0);
    NeedleLaw blade{.inward_world = (some(random, 1.0) + 2.0 * Vector3::UnitX()).normalized(),
                    .cutting_newton = random.uniform(0.0, 5.0),
                    .spreading_newton = random.uniform(0.0, 5.0),
                    .deepest_m = random.uniform(0.0, 0.1),
                    .friction_newton = random.chance(0.2) ? 0.0 : random.uniform(0.0, 5.0)};
    blade.edge_world = blade.inward_world.cross(some(random, 1.0)).normalized();
    const double depth_m = random.uniform(0.0, 0.1);
    const GripSlip slip = slip_of_needle(force, K, blade, depth_m);
    ASSERT_TRUE(slip.force_on_tool_newton.allFinite() && slip.slip_m.allFinite());
    const Vector3 normal = blade.inward_world.cross(blade.edge_world);
    ASSERT_NEAR(slip.slip_m.dot(normal), 0.0, 1e-12);
    if (slip.is_out) continue;
    ASSERT_NEAR((slip.force_on_tool_newton - force - K * slip.slip_m).norm(), 0.0,
                1e-7 * force.norm());
    // the spring has lost at least what the step has dissipated, ≥ 0
    const auto stored = [&](const Vector3& f) { return 0.5 * f.dot(K.inverse() * f); };
    ASSERT_LE(stored(slip.force_on_tool_newton), (1 + 1e-9) * stored(force));
    const double along_newton = std::abs(slip.force_on_tool_newton.dot(blade.edge_world));
    ASSERT_LE(along_newton, blade.friction_newton + 1e-7 * force.norm());
    // at the same time no more pushes than it takes to go on, nor pulls
    const double push_newton = -slip.force_on_tool_newton.dot(blade.inward_world);
    const double after_m = depth_m + slip.slip_m.dot(blade.inward_world);
    const double cuts_newton = after_m < blade.deepest_m - 1e-12 ? 0.0 : blade.cutting_newton;
    ASSERT_LE(push_newton,
              blade.spreading_newton + blade.friction_newton + cuts_newton + 1e-7 * force.norm());
    ASSERT_GE(push_newton, -blade.friction_newton - 1e-7 * force.norm());
    slides += std::abs(slip.slip_m.dot(blade.edge_world)) > 0.0 ? 1 : 0;
  }
  EXPECT_GT(slides, 1000) << "this says nothing";
}

// The work of an insertion at any speed: J × width × way, what spreads and rubs, and what the
// spring has.
TEST(Needle, TheWorkOfAnInsertionIsToughnessTimesAreaAndFriction) {
  constexpr double kToughness_joule_per_m2 = 160.0;
  constexpr double kWidth_m = 0.0025;  // × 160 J/m²: 0.4 N
  constexpr double kStep_m = 2e-5;
  Grip grip{.needle = needle_at(0.0)};
  double slip_m = 0.0;
  double work_joule = 0.0;
  double newton = 0.0;
  double tool_m = 0.0;
  const auto go = [&](double way_m) {
    tool_m += way_m;
    const GripSlip slip =
        slip_of(grip, {0, 0, -slip_m}, {0, 0, kAxis_newton_per_m * (tool_m - slip_m)},
                kAxis_newton_per_m * Matrix3::Identity());
    slip_m -= slip.slip_m.z();
    const double now = slip.force_on_tool_newton.z();
    work_joule += 0.5 * (newton + now) * way_m;
    newton = now;
  };
  while (tool_m < 0.03) go(kStep_m);
  const double stored_joule = 0.5 * newton * newton / kAxis_newton_per_m;
  const double cut_joule = kToughness_joule_per_m2 * kWidth_m * slip_m;
  const double rest_joule = kSpread_newton * slip_m + 0.5 * kRub_newton_per_m * slip_m * slip_m;
  EXPECT_GT(slip_m, 0.025);
  EXPECT_NEAR(work_joule, cut_joule + rest_joule + stored_joule, 0.002 * work_joule);
  // shares of fracture, spreading and friction at the end [Barnett16: 61, 18 and 21 %]
  const double sum = kCut_newton + kSpread_newton + kRub_newton_per_m * slip_m;
  EXPECT_NEAR(newton, sum, 1e-9);

  // out again against friction alone: the spring gives back what it had
  work_joule = 0.0;
  const double deepest_m = slip_m;
  while (slip_m > 1e-4) go(-kStep_m);
  EXPECT_NEAR(work_joule + stored_joule, 0.5 * kRub_newton_per_m * deepest_m * deepest_m,
              0.02 * (work_joule + stored_joule));
  EXPECT_NEAR(grip.needle.deepest_m, deepest_m, 1e-12);
  // and in by the same hole without cutting
  work_joule = 0.0;
  while (slip_m < 0.02) go(kStep_m);
  EXPECT_NEAR(newton, kSpread_newton + kRub_newton_per_m * slip_m, 1e-9);
}

}  // namespace
}  // namespace palpate
