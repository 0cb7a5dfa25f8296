// SPDX-License-Identifier: Apache-2.0
// The bound of the force: what the worst hand can draw in the next interval.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "mofc_node/controllers/one_pool_clamp.h"
#include "tests/property/controller_cases.h"

namespace palpate::controllers {
namespace {

// E′ + g(d) over d, g as (10): convex, least at d* = T v* of (12).
TEST(ClampLaws, TheWorstNextIntervalEndsAtZeroAtTheBoundAndAboveItInside) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const MofcParameters p = random_parameters(random);
    const double energy = 1e-6 * std::pow(1e6, random.uniform());
    const double bound = maximum_force_newton(p, energy);
    const auto after = [&](double d, double f) {
      return energy + interval_energy_joule(p.f_d, p.f_co, p.T, d, f);
    };

    for (const double sign : {-1.0, 1.0}) {
      const double f = sign * bound;
      const double d_star = p.T * most_draining_velocity_m_per_s(p, f);
      EXPECT_NEAR(after(d_star, f), 0.0, 1e-12 * energy);
      for (int i = 0; i < 200; ++i) {
        const double d = random.uniform(-3.0, 3.0) * std::abs(d_star);
        EXPECT_GE(after(d, f), -1e-12 * energy);
        EXPECT_GT(after(d, random.uniform(0.0, 0.99) * f), 0.0);
      }
      // and beyond the bound it does not hold
      const double beyond = 1.01 * f;
      EXPECT_LT(after(p.T * most_draining_velocity_m_per_s(p, beyond), beyond), 0.0);
    }
  }
}

// As above with g(d) = f_d |d|²/T + f_co |d| − F·d and the controller's own F after free motion.
TEST(ClampLaws, TheSameInThreeDimensions) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const MofcParameters p = random_parameters(random);
    VectorMofc controller(p, 0.0, 0.0);
    const Vector3 moved = random.uniform(1e-3, 1e-1) * random.direction();
    const Vector3 ask = random.direction();
    const std::vector<AppliedStretch> free{{p.T, Vector3::Zero(), moved, true}};
    (void)controller.step({});
    const ControlOutput out = controller.step(
        {.hand_position_m = moved, .applied = free, .requested_force_on_hand_newton = 1e6 * ask});
    ASSERT_TRUE(out.is_clamped);
    const Vector3 F = out.force_on_hand_newton;
    const double energy = out.ledger_energy_joule;
    const auto after = [&](const Vector3& d, const Vector3& force) {
      return energy + p.f_d * d.squaredNorm() / p.T + p.f_co * d.norm() - force.dot(d);
    };

    const Vector3 d_star = p.T * (F.norm() - p.f_co) / (2.0 * p.f_d) * ask;
    EXPECT_NEAR(after(d_star, F), 0.0, 1e-12 * energy);
    for (int i = 0; i < 300; ++i) {
      const Vector3 d = d_star + random.uniform(0.0, 2.0) * d_star.norm() * random.direction();
      EXPECT_GE(after(d, F), -1e-12 * energy);
      EXPECT_GT(after(d, random.uniform(0.0, 0.99) * F), 0.0);
    }
  }
}

// As above, the hand no faster than v_max: d within ±T v_max.
TEST(BoundedSpeedLaws, TheWorstNextIntervalEndsAtZeroAtTheBoundAndAboveItInside) {
  int capped = 0;
  int uncapped = 0;
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    MofcParameters p = random_parameters(random);
    if (seed % 5 == 0) p.f_d = 0.0;
    const double v_max = random.uniform(0.1, 1.0);
    const double energy = 1e-6 * std::pow(1e6, random.uniform());
    const double bound = maximum_force_newton(p, energy, v_max);
    const auto after = [&](double d, double f) {
      return energy + interval_energy_joule(p.f_d, p.f_co, p.T, d, f);
    };

    const bool is_capped = bound - p.f_co > 2.0 * p.f_d * v_max;
    ++(is_capped ? capped : uncapped);
    const double d_star = is_capped ? p.T * v_max : p.T * (bound - p.f_co) / (2.0 * p.f_d);
    EXPECT_NEAR(after(-d_star, bound), 0.0, 1e-12 * energy);
    EXPECT_NEAR(p.T * drain_watt(p, bound, v_max), energy, 1e-12 * energy);
    for (int i = 0; i < 200; ++i) {
      const double d = random.uniform(-1.0, 1.0) * p.T * v_max;
      EXPECT_GE(after(d, bound), -1e-12 * energy);
      EXPECT_GT(after(d, random.uniform(0.0, 0.99) * bound), 0.0);
    }
    EXPECT_LT(after(-d_star, 1.01 * bound), 0.0);
  }
  // both branches were tried
  EXPECT_GT(capped, 40);
  EXPECT_GT(uncapped, 5);
}

TEST(BoundedSpeedLaws, TheBoundIsNeverBelowThePapersAndMeetsItAtTheSeam) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const MofcParameters p = random_parameters(random);
    const double v_max = random.uniform(0.1, 1.0);
    const double seam = p.f_d * p.T * v_max * v_max;
    const double at_seam = p.f_co + 2.0 * p.f_d * v_max;
    EXPECT_NEAR(maximum_force_newton(p, seam, v_max), at_seam, 1e-12 * at_seam);
    EXPECT_NEAR(maximum_force_newton(p, seam * (1.0 + 1e-9), v_max), at_seam, 1e-8 * at_seam);
    for (int i = 0; i < 100; ++i) {
      const double energy = seam * std::pow(1e3, random.uniform(-1.0, 1.0));
      const double bound = maximum_force_newton(p, energy, v_max);
      EXPECT_GE(bound, maximum_force_newton(p, energy) * (1.0 - 1e-15));
      EXPECT_GE(bound, maximum_force_newton(p, 0.99 * energy, v_max));
    }
  }
}

/// A random force, often with small components on some axes.
Vector3 random_force(Random& random) {
  Vector3 force = random.direction();
  for (double& f : force) f *= random.chance(0.3) ? 0.01 : 1.0;
  return 10.0 * random.uniform() * force;
}

// Worst velocity against f_d,i, f_co,i without a limit: (12) on each axis. At the bound it brings
// the pool to zero within T, any other leaves it above, and beyond the bound it does not hold.
TEST(AxisClampLaws, TheWorstNextIntervalEndsAtZeroAtTheBoundAndAboveItInside) {
  int clamped = 0;
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const MofcParameters p = random_parameters(random);
    const Hand hand{.per_axis = random_axis_friction(random)};
    const OnePoolClamp clamp(p, hand.per_axis, hand.v_max_m_per_s);
    const double energy = 1e-6 * std::pow(1e6, random.uniform());
    const ControlOutput out = clamp.clamp(100.0 * random_force(random), energy);
    const Vector3 F = out.force_on_hand_newton;
    const auto after = [&](const Vector3& v, const Vector3& force) {
      return energy + p.T * (hand.friction_watt(v) - force.dot(v));
    };

    if (!out.is_clamped) continue;
    ++clamped;
    const Vector3 v_star = hand.most_draining_velocity(F);
    EXPECT_NEAR(after(v_star, F), 0.0, 1e-9 * energy);
    for (int i = 0; i < 200; ++i) {
      const Vector3 v = v_star + random.uniform(0.0, 2.0) * v_star.norm() * random.direction();
      EXPECT_GE(after(v, F), -1e-9 * energy);
    }
    EXPECT_LT(after(hand.most_draining_velocity(1.01 * F), 1.01 * F), 0.0);
  }
  EXPECT_GT(clamped, 60);
}

TEST(AxisClampLaws, NoHandWithinVMaxDrainsMoreThanIsComputed) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const MofcParameters p = random_parameters(random);
    Hand hand{.per_axis = random_axis_friction(random), .v_max_m_per_s = random.uniform(0.1, 1.0)};
    if (seed % 4 == 0) hand.per_axis->f_d[static_cast<int>(seed) % 3] = 0.0;
    const OnePoolClamp clamp(p, hand.per_axis, hand.v_max_m_per_s);
    const Vector3 F = random_force(random);
    const double computed = clamp.drain_watt(F) * (1.0 + 1e-12);
    const auto drawn = [&](const Vector3& v) { return F.dot(v) - hand.friction_watt(v); };
    EXPECT_LE(drawn(hand.most_draining_velocity(F)), computed);
    for (int i = 0; i < 300; ++i) {
      EXPECT_LE(drawn(hand.v_max_m_per_s * random.uniform() * random.direction()), computed);
    }
  }
}

TEST(AxisClampLaws, TheComputedDrainOfEqualAxesWithoutCoulombFrictionIsThatOfTheNorm) {
  for (const std::uint64_t seed : seeds(100)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    MofcParameters p = random_parameters(random);
    p.f_co = 0.0;
    const AxisFriction same{.f_d = Vector3::Constant(p.f_d), .f_co = Vector3::Zero()};
    for (const double v_max : {0.5, std::numeric_limits<double>::infinity()}) {
      const Vector3 F = random_force(random);
      const double whole = OnePoolClamp(p, {}, v_max).drain_watt(F);
      EXPECT_NEAR(OnePoolClamp(p, same, v_max).drain_watt(F), whole, 1e-12 * whole);
    }
  }
}

TEST(AxisClampLaws, MoreEnergyNeverGivesLessAndTheForceKeepsItsDirectionAndItsBounds) {
  for (const std::uint64_t seed : seeds(300)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const MofcParameters p = random_parameters(random);
    const double v_max =
        random.chance(0.5) ? random.uniform(0.1, 1.0) : std::numeric_limits<double>::infinity();
    const OnePoolClamp clamp(p, random_axis_friction(random), v_max);
    const Vector3 requested = random_force(random);
    const double gate = random.chance(0.5) ? 1.0 : random.uniform();
    double before = 0.0;
    for (double energy = 1e-7; energy < 1.0; energy *= 1.5) {
      const ControlOutput out = clamp.clamp(requested, energy, gate);
      const Vector3& given = out.force_on_hand_newton;
      ASSERT_GE(given.norm(), before);
      ASSERT_LE(given.norm(), requested.norm());
      ASSERT_LE(given.cross(requested).norm(), 1e-15 * given.norm() * requested.norm());
      ASSERT_GE(given.dot(requested), 0.0);
      for (int i = 0; i < 3; ++i) {
        ASSERT_LE(std::abs(given[i]), out.f_max_newton[i] * (1.0 + 1e-12));
      }
      ASSERT_EQ(out.is_clamped, given != requested);
      before = given.norm();
    }
  }
}

}  // namespace
}  // namespace palpate::controllers
