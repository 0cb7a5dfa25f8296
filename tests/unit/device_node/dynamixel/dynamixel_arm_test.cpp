// SPDX-License-Identifier: Apache-2.0
// A leader arm on a Dynamixel bus: the driver through its emulator, on virtual time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "device_node/drivers/dynamixel/dynamixel_arm.h"
#include "device_node/drivers/dynamixel/dynamixel_models.h"
#include "device_node/emulators/dynamixel_emulator.h"
#include "tests/support/alloc_guard.h"
#include "tests/unit/device_node/dynamixel/bench.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;
using test::LeaderBench;
using ::testing::HasSubstr;

// one unit of an XL330-M288: 1 mA · 0.52 N·m / 1.47 A
constexpr double kUnitNewtonM = 1e-3 * 0.52 / 1.47;
constexpr std::size_t kLastButOne = 5;

// --- life ---------------------------------------------------------------------------------------

TEST(DynamixelArm, IsLimpWhenItIsOpened) {
  LeaderBench bench;
  bench.open();
  EXPECT_FALSE(bench.arm().is_enabled());
  for (std::size_t i = 0; i < 7; ++i) EXPECT_EQ(bench.entry(i, dynamixel::kTorqueEnable), 0u);
  EXPECT_TRUE(bench.cycle(0.2));
  EXPECT_EQ(bench.made[3], 0.0);
  EXPECT_EQ(bench.acting_newton_m(), 0.0);
  EXPECT_THAT(bench.arm().description(), HasSubstr("joint 4 (id 4): XL330-M288, firmware 52"));
}

TEST(DynamixelArm, TorqueThatAnotherProgramLeftEnds) {
  LeaderBench bench;
  for (std::size_t i = 0; i < 7; ++i) {
    bench.emulator().with_servo(i, [](EmulatedServo& servo) {
      const std::array current{std::byte{200}, std::byte{0}};
      EXPECT_EQ(servo.write(dynamixel::kTorqueEnable, std::array{std::byte{1}}), 0);
      EXPECT_EQ(servo.write(dynamixel::kGoalCurrent, current), 0);
    });
  }
  bench.pass(2ms);
  ASSERT_GT(bench.acting_newton_m(), 0.3);

  bench.open();
  bench.pass(2ms);

  EXPECT_EQ(bench.acting_newton_m(), 0.0);
}

TEST(DynamixelArm, WatchdogsAreSetBeforeTorque) {
  LeaderBench bench;
  bench.settings.watchdog_units = 3;
  bench.enabled();
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_EQ(bench.entry(i, dynamixel::kTorqueEnable), 1u);
    EXPECT_EQ(bench.entry(i, dynamixel::kBusWatchdog), 3u);
    bench.emulator().with_servo(i, [](EmulatedServo& servo) {
      EXPECT_FALSE(servo.was_unguarded);
      EXPECT_EQ(servo.torque_newton_m(), 0.0);
    });
  }
}

TEST(DynamixelArm, ReleaseAndTheDestructorSwitchTorqueOff) {
  LeaderBench bench;
  bench.enabled();
  ASSERT_TRUE(bench.cycle(0.1));
  ASSERT_GT(bench.acting_newton_m(), 0.5);

  bench.arm().release();
  bench.settle();
  bench.pass(2ms);

  EXPECT_EQ(bench.acting_newton_m(), 0.0);
  EXPECT_EQ(bench.entry(2, dynamixel::kTorqueEnable), 0u);
  EXPECT_TRUE(bench.arm().read(bench.reading));
}

// --- values -------------------------------------------------------------------------------------

TEST(DynamixelArm, TorqueIsRoundedTowardsZeroAndTold) {
  LeaderBench bench;
  bench.joints.resize(1);
  bench.enabled();
  ASSERT_TRUE(bench.cycle(100.6 * kUnitNewtonM));
  EXPECT_NEAR(bench.made[0], 100.0 * kUnitNewtonM, 1e-12);
  // the emulated motor makes 0.354 N·m/A, not 0.52/1.47
  EXPECT_NEAR(bench.acting_newton_m(), 0.0354, 1e-9);
  ASSERT_TRUE(bench.cycle(-100.6 * kUnitNewtonM));
  EXPECT_NEAR(bench.made[0], -100.0 * kUnitNewtonM, 1e-12);
}

TEST(DynamixelArm, TorqueIsCutOffAtTheLimitAndNoneIfItIsNoNumber) {
  LeaderBench bench;
  bench.joints.resize(2);
  bench.joints[0].current_limit_ampere = 0.2;
  bench.joints[1].current_limit_ampere = 100.0;  // the servo's own is 1.75 A
  bench.enabled();
  ASSERT_TRUE(bench.cycle(5.0));
  EXPECT_NEAR(bench.made[0], 200.0 * kUnitNewtonM, 1e-12);
  EXPECT_NEAR(bench.made[1], 1750.0 * kUnitNewtonM, 1e-12);
  EXPECT_NEAR(bench.arm().largest_torque_newton_m(1), 1750.0 * kUnitNewtonM, 1e-12);
  ASSERT_TRUE(bench.cycle(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_EQ(bench.made[0], 0.0);
  ASSERT_TRUE(bench.cycle(std::numeric_limits<double>::infinity()));
  EXPECT_EQ(bench.made[1], 0.0);
}

// A joint that turns against its servo, half as far.
TEST(DynamixelArm, SignGearAndOffsetHoldForAngleAndTorque) {
  LeaderBench bench;
  bench.joints.resize(1);
  bench.joints[0].sign = -1.0;
  bench.joints[0].gear = 2.0;
  bench.joints[0].offset_rad = 2.0;  // q = −3.14/2 + 2 = 0.43
  bench.joints[0].lowest_rad = -0.5;
  bench.joints[0].highest_rad = 1.5;
  bench.enabled();
  ASSERT_TRUE(bench.cycle(0.1));
  EXPECT_NEAR(bench.reading.position_rad[0], 0.43, 1e-3);
  // the horn makes half of it, the other way
  EXPECT_NEAR(bench.made[0], 141.0 * 2.0 * kUnitNewtonM, 1e-12);  // ⌊0.1/(2 u)⌋ = 141
  static_cast<void>(bench.acting_newton_m());
  bench.emulator().with_servo(
      0, [](EmulatedServo& servo) { EXPECT_NEAR(servo.torque_newton_m(), -0.141 * 0.354, 1e-9); });
}

TEST(DynamixelArm, AMeasuredTorquePerAmpereGoesBeforeTheManuals) {
  LeaderBench bench;
  bench.joints.resize(1);
  bench.joints[0].torque_newton_m_per_ampere = 0.354;
  bench.enabled();
  ASSERT_TRUE(bench.cycle(0.0359));
  EXPECT_NEAR(bench.made[0], 0.0354 + 0.000354, 1e-9);
  EXPECT_NEAR(bench.acting_newton_m(), bench.made[0], 1e-9);
}

// Where a servo has counted turns it forgets them as it gets torque; the range says which turn it
// is.
TEST(DynamixelArm, TurnsAreFoundFromTheRange) {
  LeaderBench bench;
  for (std::size_t i = 0; i < 7; ++i) {
    bench.emulator().with_servo(i,
                                [i](EmulatedServo& servo) { servo.turn(static_cast<int>(i) - 3); });
  }
  bench.pass(2ms);
  bench.open();
  ASSERT_TRUE(bench.cycle()) << bench.arm().fault_text();
  for (std::size_t i = 0; i < 7; ++i) EXPECT_NEAR(bench.reading.position_rad[i], 0.0, 2e-3);
  ASSERT_TRUE(bench.arm().enable()) << bench.arm().fault_text();
  ASSERT_TRUE(bench.cycle());
  ASSERT_TRUE(bench.cycle());
  for (std::size_t i = 0; i < 7; ++i) EXPECT_NEAR(bench.reading.position_rad[i], 0.0, 2e-3);
}

TEST(DynamixelArm, OldFirmwareIsReadOneByOne) {
  std::vector<ServoSettings> servos = seven_servos();
  servos[4].firmware = 45;  // Fast Sync Read begins with 46
  LeaderBench bench(servos);
  bench.enabled();
  for (int k = 0; k < 5; ++k) ASSERT_TRUE(bench.cycle(0.1)) << bench.arm().fault_text();
  EXPECT_NEAR(bench.made[4], 0.1, kUnitNewtonM);
}

// --- time ---------------------------------------------------------------------------------------

TEST(DynamixelArm, WhatWasWrittenIsKnownUnlessItCameLateOrNotAtAll) {
  LeaderBench bench;
  bench.settings.longest_delay_s = 0.005;  // 3 ms of it are the servo's and USB's
  DynamixelArm& arm = bench.enabled();
  const LeaderValues torque{0.05, 0.05, 0.05, 0.05, 0.05, 0.05, 0.05};
  ASSERT_TRUE(bench.cycle(0.05));
  ASSERT_TRUE(arm.read(bench.reading));
  EXPECT_TRUE(bench.reading.is_known);
  EXPECT_NEAR(bench.reading.elapsed_s, 0.002 + 0.005, 1e-9);

  bench.pass(3ms);  // between the reading and its answer
  ASSERT_TRUE(bench.write(torque));
  bench.pass(1ms);
  ASSERT_TRUE(arm.read(bench.reading));
  EXPECT_FALSE(bench.reading.is_known);

  ASSERT_TRUE(bench.write(torque));
  bench.pass(2ms);
  bench.emulator().with_servo(3, [](EmulatedServo& servo) {  // as if the write had not come
    EXPECT_EQ(servo.write(dynamixel::kGoalCurrent, std::array{std::byte{9}, std::byte{0}}), 0);
  });
  ASSERT_TRUE(arm.read(bench.reading));
  EXPECT_FALSE(bench.reading.is_known);
  ASSERT_TRUE(bench.write(torque));
  bench.pass(2ms);
  ASSERT_TRUE(arm.read(bench.reading));
  EXPECT_TRUE(bench.reading.is_known);
}

TEST(DynamixelArm, ACycleThatTakesTooLongIsLimp) {
  LeaderBench bench;
  bench.settings.watchdog_units = 10;  // longer than the cycle
  bench.enabled();
  ASSERT_TRUE(bench.cycle(0.1));
  bench.pass(30ms);
  ASSERT_GT(bench.acting_newton_m(), 0.5);
  ASSERT_TRUE(bench.arm().read(bench.reading));
  EXPECT_FALSE(bench.reading.is_known);
  bench.pass(2ms);
  EXPECT_EQ(bench.acting_newton_m(), 0.0);
}

TEST(DynamixelArm, TheLeaseIsACycleAndTheWatchdogWithItsUnit) {
  LeaderBench bench;
  bench.settings.longest_cycle_s = 0.010;
  bench.settings.longest_delay_s = 0.005;
  bench.settings.watchdog_units = 2;
  EXPECT_NEAR(bench.open().lease_s(), 0.010 + 0.005 + 0.060, 1e-12);
  // a step, the play, and 6 rad/s for 5 ms to either side
  EXPECT_NEAR(bench.arm().resolution_rad(0),
              2.0 * std::numbers::pi / 4096 + 0.0044 + 2 * 6.0 * 0.005, 1e-12);
}

TEST(DynamixelArm, TheWatchdogEndsTheTorqueWhenTheProgramStops) {
  for (const int units : {1, 2, 5}) {
    LeaderBench bench;
    bench.settings.watchdog_units = units;
    bench.enabled();
    for (int k = 0; k < 5; ++k) ASSERT_TRUE(bench.cycle(0.1));
    const double last_s = bench.emulator().now_s() - 0.002;  // of the last write
    bench.pass(500ms);
    static_cast<void>(bench.acting_newton_m());
    EXPECT_GE(bench.emulator().torque_until_s(), last_s + 0.020 * units - 1e-9);
    EXPECT_LE(bench.emulator().torque_until_s(), last_s + 0.020 * units + 0.0021);

    EXPECT_FALSE(bench.cycle());
    EXPECT_EQ(bench.arm().fault(), LeaderFault::kWatchdogFired);
    EXPECT_FALSE(bench.arm().enable());  // a new object is needed, and it can be made
    bench.enabled();
    EXPECT_TRUE(bench.cycle());
  }
}

// The register holds the number, and nothing comes of it: it is tried before there is a torque.
TEST(DynamixelArm, AWatchdogThatEndsNoTorqueIsFoundBeforeThereIsOne) {
  LeaderBench bench;
  bench.open();
  bench.emulator().with_servo(3, [](EmulatedServo& servo) { servo.has_watchdog = false; });
  bench.plan(WireFault::kNoWatchdog);
  EXPECT_FALSE(bench.arm().enable());
  EXPECT_EQ(bench.arm().fault(), LeaderFault::kNoWatchdog) << bench.arm().fault_text();
  EXPECT_THAT(bench.arm().fault_text(), HasSubstr("Update its firmware"));
  bench.settle();
  EXPECT_EQ(bench.acting_newton_m(), 0.0);
}

TEST(DynamixelArm, AWatchdogThatDoesNotFireInALongPauseIsAFault) {
  LeaderBench bench;
  bench.enabled();
  ASSERT_TRUE(bench.cycle(0.1));
  bench.plan(WireFault::kNoWatchdog);
  bench.pass(1500ms);
  ASSERT_GT(bench.acting_newton_m(), 0.5);
  EXPECT_FALSE(bench.cycle(0.1));
  EXPECT_EQ(bench.arm().fault(), LeaderFault::kNoWatchdog) << bench.arm().fault_text();
  EXPECT_THAT(bench.arm().fault_text(), HasSubstr("no motor has ended its torque in a pause"));
  bench.pass(5ms);
  EXPECT_EQ(bench.acting_newton_m(), 0.0);
}

TEST(DynamixelArm, ACycleAllocatesNothingAndEndsInTime) {
  LeaderBench bench;
  bench.enabled();
  for (int k = 0; k < 5; ++k) ASSERT_TRUE(bench.cycle(0.05));
  {
    const test::AllocGuard guard;
    const std::uint64_t mallocs = test::mallocs_of_this_thread();
    for (int k = 0; k < 200; ++k) ASSERT_TRUE(bench.cycle(0.05));
    EXPECT_EQ(guard.count(), 0u);
    EXPECT_EQ(test::mallocs_of_this_thread(), mallocs);
  }

  // one that finds a fault: a read twice, then each servo once
  bench.plan(WireFault::kSilent);
  const test::AllocGuard guard;
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_FALSE(bench.cycle());
  const double took_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  EXPECT_EQ(guard.count(), 0u);
  EXPECT_LT(took_s, 10.0 * bench.settings.answer_limit_s + to_seconds(test::patience(200ms)));
}

// --- faults -------------------------------------------------------------------------------------

struct FaultCase {
  WireFault wire;
  LeaderFault fault;
  std::size_t joint;  // 7: the line
};

class DynamixelFaults : public testing::TestWithParam<FaultCase> {};

TEST_P(DynamixelFaults, MakeTheArmLimpAndAreNamed) {
  LeaderBench bench;
  bench.enabled();
  for (int k = 0; k < 5; ++k) ASSERT_TRUE(bench.cycle(0.1)) << bench.arm().fault_text();
  ASSERT_GT(bench.acting_newton_m(), 0.5);
  const LeaderValues before = bench.reading.position_rad;

  bench.plan(GetParam().wire);
  bool is_good = true;
  for (int k = 0; k < 20 && is_good; ++k) {
    is_good = bench.cycle(0.1);
    if (!is_good) break;
    for (std::size_t i = 0; i < 7; ++i) {  // never a jump
      EXPECT_NEAR(bench.reading.position_rad[i], before[i], 0.1);
    }
  }

  EXPECT_FALSE(is_good);
  EXPECT_EQ(bench.arm().fault(), GetParam().fault) << bench.arm().fault_text();
  EXPECT_EQ(bench.arm().fault_joint(), GetParam().joint) << bench.arm().fault_text();
  EXPECT_FALSE(bench.arm().fault_text().empty());
  EXPECT_FALSE(bench.arm().is_enabled());
  EXPECT_FALSE(bench.cycle(0.1));
  bench.pass(25ms);  // servos that hear nothing have their watchdog
  EXPECT_EQ(bench.acting_newton_m(), 0.0);
}

INSTANTIATE_TEST_SUITE_P(
    All, DynamixelFaults,
    testing::Values(FaultCase{WireFault::kSilent, LeaderFault::kNoAnswer, 0},
                    FaultCase{WireFault::kUnplugged, LeaderFault::kNoAnswer, 0},
                    FaultCase{WireFault::kGarbage, LeaderFault::kCorrupt, 0},
                    FaultCase{WireFault::kShort, LeaderFault::kCorrupt, 0},
                    FaultCase{WireFault::kWrongId, LeaderFault::kCorrupt, 0},
                    FaultCase{WireFault::kStuck, LeaderFault::kStale, 0},
                    FaultCase{WireFault::kServoGone, LeaderFault::kNoAnswer, kLastButOne},
                    FaultCase{WireFault::kServoReboot, LeaderFault::kRebooted, kLastButOne},
                    FaultCase{WireFault::kServoOverload, LeaderFault::kHardwareError, kLastButOne}),
    [](const auto& info) {
      return "WireFault" + std::to_string(static_cast<int>(info.param.wire));
    });

TEST(DynamixelArm, ATurnTooManyIsNoJump) {
  LeaderBench bench;
  bench.enabled();
  ASSERT_TRUE(bench.cycle(0.1));
  bench.emulator().with_servo(2, [](EmulatedServo& servo) { servo.turn(-1); });
  bench.pass(1ms);
  EXPECT_FALSE(bench.cycle());
  EXPECT_EQ(bench.arm().fault(), LeaderFault::kWrapped);
  EXPECT_EQ(bench.arm().fault_joint(), 2u);
}

TEST(DynamixelArm, TorqueThatIsSwitchedOffElsewhereIsNamed) {
  LeaderBench bench;
  bench.enabled();
  ASSERT_TRUE(bench.cycle(0.1));
  bench.emulator().with_servo(1, [](EmulatedServo& servo) {
    EXPECT_EQ(servo.write(dynamixel::kTorqueEnable, std::array{std::byte{0}}), 0);
  });
  EXPECT_FALSE(bench.cycle());
  EXPECT_EQ(bench.arm().fault(), LeaderFault::kTorqueOff);
  EXPECT_EQ(bench.arm().fault_joint(), 1u);
}

TEST(DynamixelArm, AnAngleBeyondItsRangeIsNamed) {
  LeaderBench bench(seven_servos(), [](std::size_t joint, double, double rad_per_s, double) {
    return joint == 4 ? 1.5 - 0.3 * rad_per_s : 0.0;
  });
  bench.joints[4].highest_rad = 0.3;
  bench.enabled();
  int cycles = 0;
  while (cycles < 1000 && bench.cycle()) ++cycles;
  EXPECT_EQ(bench.arm().fault(), LeaderFault::kOutOfRange) << bench.arm().fault_text();
  EXPECT_EQ(bench.arm().fault_joint(), 4u);
}

TEST(DynamixelArm, APulledPlugIsNamed) {
  LeaderBench bench;
  bench.enabled();
  ASSERT_TRUE(bench.cycle(0.1));
  bench.unplug();
  EXPECT_FALSE(bench.arm().read(bench.reading));
  EXPECT_EQ(bench.arm().fault(), LeaderFault::kClosed);
}

TEST(DynamixelArm, SingleWrongBitsAreReadAgain) {
  LeaderBench bench;
  bench.settings.answer_limit_s = std::min(0.2, to_seconds(test::patience(10ms)));
  bench.enabled();
  bench.plan(WireFault::kBitErrors);
  int cycles = 0;
  while (cycles < 200 && bench.cycle(0.05)) {
    ++cycles;
    for (std::size_t i = 0; i < 7; ++i) ASSERT_NEAR(bench.reading.position_rad[i], 0.0, 0.5);
  }
  EXPECT_GT(bench.reading.repeated, 0u);
  EXPECT_EQ(cycles, 200) << bench.arm().fault_text();
}

TEST(DynamixelArm, AnswersInPiecesAreOne) {
  LeaderBench bench;
  bench.enabled();
  bench.plan(WireFault::kPartial);
  for (int k = 0; k < 20; ++k) ASSERT_TRUE(bench.cycle(0.05)) << bench.arm().fault_text();
  EXPECT_EQ(bench.reading.repeated, 0u);
}

}  // namespace
}  // namespace palpate::device
