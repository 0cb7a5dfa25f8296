// SPDX-License-Identifier: Apache-2.0
// Energy of an emulated arm in a hand, of Damiao motors: with the clamp of joints and without it.
#include <gtest/gtest.h>

#include <cstdio>

#include "tests/property/seeds.h"
#include "tests/unit/device_node/damiao/bench.h"
#include "tests/unit/device_node/leader/leader_runs.h"

namespace palpate::device {
namespace {

using test::ArmRun;
using test::DamiaoBench;

ArmRun run_at(bool is_clamped, std::uint64_t seed, int cycles) {
  DamiaoBench bench(seven_damiao_motors(), test::restless_hand());
  return test::run_arm(bench, is_clamped, seed, cycles);
}

ArmRun push_at(double timeout_s, bool is_clamped) {
  DamiaoBench bench(seven_damiao_motors(), leading_hand());
  bench.settings.timeout_s = timeout_s;
  return test::push_against_a_stop(bench, is_clamped);
}

// Prints the figures of docs/operations/leader_arms.md.
TEST(DamiaoEnergy, AStopIsFelt) {
  for (const double timeout_s : {0.020, 0.100}) {
    const ArmRun run = push_at(timeout_s, true);
    EXPECT_EQ(run.fault, "");
    EXPECT_LT(run.fastest_rad_per_s, 3.0);
    EXPECT_GE(run.least_energy_joule, -1e-6);
    EXPECT_GT(run.made_ratio, 0.4);
    std::printf("timeout %3.0f ms: %4.1f %% of the torque made, least energy %.1f uJ\n",
                1e3 * timeout_s, 100.0 * run.made_ratio, 1e6 * run.least_energy_joule);
  }
  const ArmRun free = push_at(0.020, false);
  std::printf("no clamp: %4.1f %% made, least energy %.1f uJ\n", 100.0 * free.made_ratio,
              1e6 * free.least_energy_joule);
  EXPECT_GT(free.made_ratio, 0.9);
}

TEST(DamiaoEnergy, TheHandIsNeverDriven) {
  for (const std::uint64_t seed : test::seeds(1)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const ArmRun run = run_at(true, seed, test::place_count(10'000));
    EXPECT_EQ(run.fault, "");
    EXPECT_LT(run.fastest_rad_per_s, 6.0);  // what the clamp assumes of the hand
    EXPECT_GE(run.least_energy_joule, -1e-6);
    EXPECT_GT(run.made_ratio, 0.2);
    std::printf("least energy %.1f uJ, %4.1f %% made\n", 1e6 * run.least_energy_joule,
                100.0 * run.made_ratio);
  }
}

TEST(DamiaoEnergy, WithoutAClampItIs) {
  const ArmRun run = run_at(false, 1, test::place_count(10'000));
  EXPECT_EQ(run.fault, "");
  EXPECT_LT(run.least_energy_joule, -0.1);
  std::printf("no clamp: least energy %.1f mJ\n", 1e3 * run.least_energy_joule);
}

}  // namespace
}  // namespace palpate::device
