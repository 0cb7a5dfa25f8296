// SPDX-License-Identifier: Apache-2.0
#include "common/contact/elastic/grip.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <limits>

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

}  // namespace
}  // namespace palpate
