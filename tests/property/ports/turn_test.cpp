// SPDX-License-Identifier: Apache-2.0
// What a body has turned, from two orientations: beside ∫ω dt of a way in many small steps.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/core/random.h"
#include "mofc_node/controllers/ports/turn.h"
#include "tests/property/seeds.h"

namespace palpate::controllers {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

Quaterniond rotation(const Vector3d& turned_rad) {
  const double angle = turned_rad.norm();
  if (angle == 0.0) return Quaterniond::Identity();
  return Quaterniond(Eigen::AngleAxisd(angle, turned_rad / angle));
}

Vector3d box(Random& random, double half) {
  return {random.uniform(-half, half), random.uniform(-half, half), random.uniform(-half, half)};
}

TEST(Turn, AboutOneAxisItIsTheSineOfTheAngle) {
  const Quaterniond before(Eigen::AngleAxisd(2.5, Vector3d(1, 2, 3).normalized()));
  const Quaterniond after = rotation({0.0, 0.0, 0.3}) * before;
  EXPECT_LE((turned_rad(before, after) - Vector3d(0, 0, std::sin(0.3))).norm(), 1e-14);
  EXPECT_LE((turned_rad(after, before) + Vector3d(0, 0, std::sin(0.3))).norm(), 1e-14);
}

TEST(Turn, SignAndLengthOfTheQuaternionsDoNotMatter) {
  const Quaterniond before = rotation({0.3, -0.2, 3.0});
  const Quaterniond after = rotation({0.1, 0.05, -0.2}) * before;
  const Quaterniond other(-3.0 * after.coeffs());
  EXPECT_LE((turned_rad(before, other) - turned_rad(before, after)).norm(), 1e-14);
}

TEST(Turn, NoWayMakesItMissMoreThanIsDoubted) {
  double largest_share = 0.0;
  for (const std::uint64_t seed : test::seeds(2000)) {
    Random random(seed);
    const double omega = random.uniform(0.1, 20.0);
    const double duration_s = random.uniform(1e-4, 20e-3);
    const double q = random.chance(0.5) ? 0.0 : random.uniform(0.0, 3e-3);
    const Quaterniond begin = rotation(box(random, 3.0));
    Quaterniond at = begin;
    Vector3d true_rad = Vector3d::Zero();
    const int steps = 1 + static_cast<int>(random.below(40));
    const double curl = random.uniform(-1.0, 1.0);
    Vector3d axis = random.direction();
    const Vector3d about = axis.unitOrthogonal();
    for (int i = 0; i < steps; ++i) {
      const Vector3d piece = omega * duration_s / steps * axis;
      at = rotation(piece) * at;
      true_rad += piece;
      axis = rotation(2.0 * std::numbers::pi / steps * curl * about) * axis;
    }
    const Vector3d error_before = box(random, 0.5 * q);
    const Vector3d error_after = box(random, 0.5 * q);
    const Vector3d missed = turned_rad(rotation(error_before) * begin, rotation(error_after) * at) -
                            (true_rad + error_after - error_before);
    const double doubt = turn_doubt_rad(omega, duration_s, q);
    EXPECT_LE(missed.norm(), doubt) << "seed " << seed;
    largest_share = std::max(largest_share, missed.norm() / doubt);
  }
  // the bound is not far off
  EXPECT_GT(largest_share, 0.2);
}

}  // namespace
}  // namespace palpate::controllers
