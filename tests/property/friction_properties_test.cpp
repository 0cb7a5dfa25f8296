// SPDX-License-Identifier: Apache-2.0
// `palpate identify` never measures more friction than there is, and rarely much less.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <vector>

#include "common/core/random.h"
#include "device_node/identification/friction_identification.h"
#include "device_node/simulation/simulated_device.h"
#include "tests/property/seeds.h"

namespace palpate::device {
namespace {

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// Nobody holds the device.
HandConfig no_hand(const Vector3& position_m) {
  HandConfig hand;
  hand.mass_kg = 0.0;
  hand.stiffness_newton_per_m = 0.0;
  hand.damping_newton_s_per_m = 0.0;
  hand.path = HoldPath{.position_m = position_m};
  return hand;
}

/// Uniform in the box of half extents `half_m`.
Vector3 in_box(Random& random, const Vector3& half_m) {
  return half_m.cwiseProduct(
      Vector3(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)));
}

TEST(FrictionIdentification, NeverMeasuresMoreThanThereIsAndRarelyMuchLess) {
  std::vector<double> viscous_ratio;
  std::vector<double> coulomb_ratio;
  for (std::uint64_t seed = 1; seed <= test::seed_count(50); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    SimulatedDeviceConfig config;
    config.mass_kg = random.uniform(0.03, 0.1);
    config.viscous_newton_s_per_m = random.uniform(0.05, 0.3);
    config.coulomb_newton = random.uniform(0.05, 0.26);
    config.position_resolution_m = random.chance(0.2) ? 0.0 : random.uniform(0.0, 55e-6);
    ManualClock clock;
    const Vector3 half_m(0.08, 0.06, 0.035);  // of the simulated workspace
    SimulatedDevice device(config, no_hand(in_box(random, 0.7 * half_m)), clock, seed);

    // two lines of the plan, at random poses and in random directions
    SweepPlan plan = default_sweep_plan(device.specification());
    plan.lines.resize(2);
    for (SweepLine& line : plan.lines) {
      line = {.middle_m = in_box(random, 0.35 * half_m), .direction = random.direction()};
    }
    const FrictionReport report = identify_friction(device, clock, plan, {});

    for (const LineFriction& line : report.lines) {
      EXPECT_LE(line.fit.viscous_bound_newton_s_per_m, config.viscous_newton_s_per_m);
      EXPECT_LE(line.fit.coulomb_bound_newton, config.coulomb_newton);
    }
    viscous_ratio.push_back(report.viscous_bound_newton_s_per_m / config.viscous_newton_s_per_m);
    coulomb_ratio.push_back(report.coulomb_bound_newton / config.coulomb_newton);
  }

  std::printf("bound / true value, median and least of %zu: f_d %.3f, %.3f; f_co %.3f, %.3f\n",
              viscous_ratio.size(), median(viscous_ratio),
              *std::min_element(viscous_ratio.begin(), viscous_ratio.end()), median(coulomb_ratio),
              *std::min_element(coulomb_ratio.begin(), coulomb_ratio.end()));
  EXPECT_GE(median(coulomb_ratio), 0.8);
  EXPECT_GE(median(viscous_ratio), 0.8);
}

}  // namespace
}  // namespace palpate::device
