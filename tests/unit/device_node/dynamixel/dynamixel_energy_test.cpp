// SPDX-License-Identifier: Apache-2.0
// Energy of an emulated arm in a hand, on a Dynamixel bus: with the clamp of joints and without it.
#include <gtest/gtest.h>

#include <cstdio>

#include "tests/property/seeds.h"
#include "tests/unit/device_node/dynamixel/bench.h"
#include "tests/unit/device_node/leader/leader_runs.h"

namespace palpate::device {
namespace {

using test::ArmRun;
using test::LeaderBench;

void use_true_torque(LeaderBench& bench) {
  for (DynamixelJoint& joint : bench.joints) joint.torque_newton_m_per_ampere = 0.354;
}

ArmRun run_at(bool is_clamped, std::uint64_t seed, int cycles) {
  LeaderBench bench(seven_servos(), test::restless_hand());
  use_true_torque(bench);
  return test::run_arm(bench, is_clamped, seed, cycles);
}

ArmRun push_at(int watchdog_units, bool is_clamped) {
  LeaderBench bench(seven_servos(), leading_hand());
  bench.settings.watchdog_units = watchdog_units;
  use_true_torque(bench);
  return test::push_against_a_stop(bench, is_clamped);
}

// Prints the figures of docs/operations/leader_arms.md.
TEST(DynamixelEnergy, AStopIsFelt) {
  for (const int units : {1, 5}) {
    const ArmRun run = push_at(units, true);
    EXPECT_EQ(run.fault, "");
    EXPECT_LT(run.fastest_rad_per_s, 3.0);
    EXPECT_GE(run.least_energy_joule, -1e-6);
    EXPECT_GT(run.made_ratio, 0.4);
    std::printf("watchdog %3d ms: %4.1f %% of the torque made, least energy %.1f uJ\n", 20 * units,
                100.0 * run.made_ratio, 1e6 * run.least_energy_joule);
  }
  const ArmRun free = push_at(1, false);
  std::printf("no clamp: %4.1f %% made, least energy %.1f uJ\n", 100.0 * free.made_ratio,
              1e6 * free.least_energy_joule);
  EXPECT_GT(free.made_ratio, 0.98);
}

// PALPATE_SEEDS=5 for ten thousand cycles: the pseudo-terminal has each of them wait for the
// kernel.
TEST(DynamixelEnergy, TheHandIsNeverDriven) {
  for (const std::uint64_t seed : test::seeds(1)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const ArmRun run = run_at(true, seed, test::place_count(2000));
    EXPECT_EQ(run.fault, "");
    EXPECT_LT(run.fastest_rad_per_s, 6.0);  // what the clamp assumes of the hand
    EXPECT_GE(run.least_energy_joule, -1e-6);
    EXPECT_GT(run.made_ratio, 0.2);
    RecordProperty("least_energy_joule", std::to_string(run.least_energy_joule));
    RecordProperty("made_ratio", std::to_string(run.made_ratio));
  }
}

TEST(DynamixelEnergy, WithoutAClampItIs) {
  const ArmRun run = run_at(false, 1, test::place_count(2000));
  EXPECT_EQ(run.fault, "");
  EXPECT_LT(run.least_energy_joule, -0.1);
  RecordProperty("least_energy_joule", std::to_string(run.least_energy_joule));
}

}  // namespace
}  // namespace palpate::device
