// SPDX-License-Identifier: Apache-2.0
// Energy of an emulated arm in a hand, through driver and wire, on virtual time: with the clamp of
// joints and without it.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <deque>

#include "common/core/random.h"
#include "mofc_node/controllers/ports/port_guard.h"
#include "tests/property/seeds.h"
#include "tests/unit/device_node/dynamixel/bench.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;
using controllers::PortGuard;
using controllers::PortGuardParameters;
using controllers::PortOutput;
using controllers::PortStretch;
using controllers::PortValues;
using test::LeaderBench;

// What the hand has put in is its work, less what moves and is tense: to the bit of the arithmetic.
TEST(JointPlant, ItsEnergyIsTheWorkOfTheHand) {
  Random random(3);
  JointPlant plant{GearedJoint{}};
  for (int k = 0; k < 200'000; ++k) {
    const double time_s = 50e-6 * k;
    const double motor = 0.4 * std::sin(37.0 * time_s) + 0.1 * random.uniform(-1.0, 1.0);
    const double hand = 2.0 * (0.5 * std::sin(2.0 * time_s) - plant.link_rad());
    plant.advance(50e-6, motor, hand);
  }
  EXPECT_NEAR(plant.energy_joule(), plant.energy_by_hand_joule(), 1e-9);
  EXPECT_GT(std::abs(plant.energy_joule()), 0.01);
}

// Friction and teeth take, whatever pushes.
TEST(JointPlant, WithoutAMotorTheHandPays) {
  JointPlant plant{GearedJoint{}};
  double before = 0.0;
  for (int k = 0; k < 100'000; ++k) {
    const double time_s = 50e-6 * k;
    plant.advance(50e-6, 0.0, 0.5 * std::sin(11.0 * time_s));
    if (k % 200 == 0) {
      EXPECT_GE(plant.energy_joule(), before - 1e-9);
      before = plant.energy_joule();
    }
  }
  EXPECT_GT(before, 0.1);
}

/// A hand that leads every joint somewhere else each half second, loose enough to be driven.
JointHand restless_hand() {
  return [](std::size_t joint, double rad, double rad_per_s, double time_s) {
    const auto at = static_cast<std::uint64_t>(2.0 * time_s) * 16 + joint;
    const double target = 0.8 * std::sin(static_cast<double>(at * at % 1009));
    return std::clamp(2.5 * (target - rad), -0.5, 0.5) - 0.15 * rad_per_s;
  };
}

/// What a far arm, a network or a wrong program may ask for.
class Requests {
 public:
  explicit Requests(std::uint64_t seed) : random_(seed) {}
  LeaderValues next(const LeaderReading& reading) {
    past_.push_back(reading.position_rad);
    if (past_.size() > 20) past_.pop_front();
    if (random_.chance(0.01)) kind_ = random_.below(4);
    LeaderValues torque{};
    for (std::size_t i = 0; i < 7; ++i) {
      const double moved = reading.position_rad[i] - past_.front()[i];
      switch (kind_) {
        case 0:  // an arm 40 ms away that pulls
          torque[i] = 4.0 * (past_.front()[i] - reading.position_rad[i]);
          break;
        case 1:  // along the motion: it drives the hand
          torque[i] = moved == 0.0 ? 0.0 : std::copysign(0.3, moved);
          break;
        case 2:
          torque[i] = 0.35 * random_.uniform(-1.0, 1.0);
          break;
        default:
          torque[i] = i % 2 == 0 ? 0.25 : -0.25;
      }
    }
    return torque;
  }

 private:
  Random random_;
  std::uint64_t kind_ = 1;
  std::deque<LeaderValues> past_;
};

struct ArmRun {
  double least_energy_joule = 0.0;
  double fastest_rad_per_s = 0.0;
  double made_ratio = 0.0;  // of the torque that was asked for
  std::string fault;
};

/// Ten thousand cycles of 2 ms, or of up to 9 ms where one comes late.
ArmRun run_arm(bool is_clamped, std::uint64_t seed, int cycles) {
  LeaderBench bench(seven_servos(), restless_hand());
  bench.settings.longest_delay_s = 0.005;
  bench.settings.longest_cycle_s = 0.012;
  for (DynamixelJoint& joint : bench.joints) joint.torque_newton_m_per_ampere = 0.354;
  DynamixelArm& arm = bench.enabled();

  PortGuardParameters parameters{
      .count = 7, .times = {.hold_s = arm.lease_s(), .longest_lease_s = arm.lease_s()}};
  PortValues peak{};
  for (std::size_t i = 0; i < 7; ++i) {
    parameters.ports[i] = {.f_d = 0.8 * 0.015,
                           .f_co = 0.8 * 0.09,
                           .q = arm.resolution_rad(i),
                           .v_max = bench.joints[i].fastest_rad_per_s};
    peak[i] = 0.35;
  }
  PortGuard guard(raised_for_one_hold(parameters, peak));
  Requests requests(seed);
  Random random(seed + 1);
  PortStretch last;
  bool has_stretch = false;
  double asked = 0.0;
  double got = 0.0;
  for (int k = 0; k < cycles; ++k) {
    if (!arm.read(bench.reading)) break;
    const LeaderValues torque = requests.next(bench.reading);
    LeaderValues sent = torque;
    last.duration_s = bench.reading.elapsed_s;
    last.position_at_end = bench.reading.position_rad;
    if (is_clamped) {
      const PortOutput output =
          guard.step({.position = bench.reading.position_rad,
                      .applied = {&last, has_stretch ? 1U : 0U},
                      .has_gap = !bench.reading.is_known || bench.reading.elapsed_s > arm.lease_s(),
                      .acting_effort_on_hand = last.effort_on_hand,
                      .requested_effort_on_hand = torque});
      sent = output.effort_on_hand;
    }
    bench.pass(from_seconds(random.uniform(0.0, 1.9e-3)));
    if (!bench.write(sent)) break;
    last.effort_on_hand = bench.made;
    has_stretch = true;
    for (std::size_t i = 0; i < 7; ++i) {
      asked += std::abs(torque[i]);
      got += std::abs(bench.made[i]);
    }
    bench.pass(from_seconds(random.chance(0.05) ? random.uniform(1e-3, 7e-3) : 1e-3));
  }
  bench.emulator().catch_up();
  return {.least_energy_joule = bench.emulator().least_energy_joule(),
          .fastest_rad_per_s = bench.emulator().fastest_rad_per_s(),
          .made_ratio = got / asked,
          .fault = arm.fault_text()};
}

/// The loop of docs/operations/leader_arms.md: a follower that meets a stop at 0.25 rad, 2 N·m/rad,
/// for 20 s at 250 Hz.
ArmRun push_against_a_stop(int watchdog_units, bool is_clamped) {
  LeaderBench bench(seven_servos(), leading_hand());
  bench.settings.watchdog_units = watchdog_units;
  for (DynamixelJoint& joint : bench.joints) {
    joint.torque_newton_m_per_ampere = 0.354;
    joint.fastest_rad_per_s = 3.0;
  }
  DynamixelArm& arm = bench.enabled();
  PortGuardParameters parameters{
      .count = 7, .times = {.hold_s = arm.lease_s(), .longest_lease_s = arm.lease_s()}};
  PortValues peak{};
  for (std::size_t i = 0; i < 7; ++i) {
    parameters.ports[i] = {
        .f_d = 0.8 * 0.015, .f_co = 0.8 * 0.09, .q = arm.resolution_rad(i), .v_max = 3.0};
    peak[i] = 0.25;
  }
  PortGuard guard(raised_for_one_hold(parameters, peak));
  PortStretch last;
  double asked = 0.0;
  double got = 0.0;
  for (int k = 0; k < 5000 && arm.read(bench.reading); ++k) {
    const PortValues& q = bench.reading.position_rad;
    PortValues torque{};
    for (std::size_t i = 0; i < 7; ++i) torque[i] = 2.0 * (std::clamp(q[i], -0.25, 0.25) - q[i]);
    last.duration_s = bench.reading.elapsed_s;
    last.position_at_end = q;
    const PortOutput output = guard.step({.position = q,
                                          .applied = {&last, k > 0 ? 1U : 0U},
                                          .has_gap = !bench.reading.is_known,
                                          .acting_effort_on_hand = last.effort_on_hand,
                                          .requested_effort_on_hand = torque});
    bench.pass(500us);
    if (!bench.write(is_clamped ? output.effort_on_hand : torque)) break;
    last.effort_on_hand = bench.made;
    for (std::size_t i = 0; i < 7; ++i) {
      asked += std::abs(torque[i]);
      got += std::abs(bench.made[i]);
    }
    bench.pass(3500us);
  }
  bench.emulator().catch_up();
  return {.least_energy_joule = bench.emulator().least_energy_joule(),
          .fastest_rad_per_s = bench.emulator().fastest_rad_per_s(),
          .made_ratio = got / asked,
          .fault = arm.fault_text()};
}

// Prints the figures of docs/operations/leader_arms.md.
TEST(DynamixelEnergy, AStopIsFelt) {
  for (const int units : {1, 5}) {
    const ArmRun run = push_against_a_stop(units, true);
    EXPECT_EQ(run.fault, "");
    EXPECT_LT(run.fastest_rad_per_s, 3.0);
    EXPECT_GE(run.least_energy_joule, -1e-6);
    EXPECT_GT(run.made_ratio, 0.4);
    std::printf("watchdog %3d ms: %4.1f %% of the torque made, least energy %.1f uJ\n", 20 * units,
                100.0 * run.made_ratio, 1e6 * run.least_energy_joule);
  }
  const ArmRun free = push_against_a_stop(1, false);
  std::printf("no clamp: %4.1f %% made, least energy %.1f uJ\n", 100.0 * free.made_ratio,
              1e6 * free.least_energy_joule);
  EXPECT_GT(free.made_ratio, 0.98);
}

// PALPATE_SEEDS=5 for ten thousand cycles: the pseudo-terminal has each of them wait for the
// kernel.
TEST(DynamixelEnergy, TheHandIsNeverDriven) {
  for (const std::uint64_t seed : test::seeds(1)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const ArmRun run = run_arm(true, seed, test::place_count(2000));
    EXPECT_EQ(run.fault, "");
    EXPECT_LT(run.fastest_rad_per_s, 6.0);  // what the clamp assumes of the hand
    EXPECT_GE(run.least_energy_joule, -1e-6);
    EXPECT_GT(run.made_ratio, 0.2);
    RecordProperty("least_energy_joule", std::to_string(run.least_energy_joule));
    RecordProperty("made_ratio", std::to_string(run.made_ratio));
  }
}

TEST(DynamixelEnergy, WithoutAClampItIs) {
  const ArmRun run = run_arm(false, 1, test::place_count(2000));
  EXPECT_EQ(run.fault, "");
  EXPECT_LT(run.least_energy_joule, -0.1);
  RecordProperty("least_energy_joule", std::to_string(run.least_energy_joule));
}

}  // namespace
}  // namespace palpate::device
