// SPDX-License-Identifier: Apache-2.0
// A leader arm of Damiao motors: the driver through its emulator, on virtual time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "device_node/drivers/damiao/damiao_arm.h"
#include "device_node/drivers/damiao/damiao_frame.h"
#include "device_node/emulators/damiao_emulator.h"
#include "tests/support/alloc_guard.h"
#include "tests/unit/device_node/damiao/bench.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;
using test::DamiaoBench;
using ::testing::HasSubstr;

// one of 4095 steps from −10 to 10 N·m, of a DM4310
constexpr double kUnitNewtonM = 20.0 / 4095;
constexpr std::size_t kLastButOne = 5;
/// A bench of joint 5 alone, a DM4310.
void keep_one(DamiaoBench& bench) {
  bench.joints.erase(bench.joints.begin(), bench.joints.begin() + 4);
  bench.joints.resize(1);
}

// --- life ---------------------------------------------------------------------------------------

TEST(DamiaoArm, IsLimpWhenItIsOpened) {
  DamiaoBench bench;
  bench.open();
  EXPECT_FALSE(bench.arm().is_enabled());
  for (std::size_t i = 0; i < 7; ++i) EXPECT_EQ(bench.state(i), damiao::kOff);
  EXPECT_TRUE(bench.cycle(0.2));
  EXPECT_EQ(bench.made[3], 0.0);
  EXPECT_EQ(bench.acting_newton_m(), 0.0);
  EXPECT_THAT(bench.arm().description(), HasSubstr("joint 4 (id 4): DM4340, firmware 5015"));
}

TEST(DamiaoArm, TorqueThatAnotherProgramLeftEnds) {
  DamiaoBench bench;
  for (std::size_t i = 0; i < 7; ++i) {
    bench.emulator().with_motor(i, [i](EmulatedDamiaoMotor& motor) {
      const auto id = static_cast<unsigned>(i + 1);
      EXPECT_TRUE(motor.hear(damiao_command(id, DamiaoCommand::kEnable), 0.0));
      EXPECT_TRUE(motor.hear(damiao_control(id, {.torque = 0x880}), 0.0));
    });
  }
  bench.pass(2ms);
  ASSERT_GT(bench.acting_newton_m(), 1.0);

  bench.open();
  bench.pass(2ms);

  EXPECT_EQ(bench.acting_newton_m(), 0.0);
}

TEST(DamiaoArm, TimeoutsAreSetBeforeTorqueAndComeBackAtTheEnd) {
  DamiaoBench bench;
  bench.settings.timeout_s = 0.030;
  bench.emulator().with_motor(2, [](EmulatedDamiaoMotor& motor) { motor.set_reg(9, 12'345); });
  bench.enabled();
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_EQ(bench.state(i), damiao::kOn);
    EXPECT_EQ(bench.reg(i, damiao::kTimeout), 600u);  // of 50 µs
    bench.emulator().with_motor(i, [](EmulatedDamiaoMotor& m) { EXPECT_FALSE(m.was_unguarded); });
  }
  ASSERT_TRUE(bench.cycle(0.1));

  bench.close();
  bench.settle();

  EXPECT_EQ(bench.reg(2, damiao::kTimeout), 12'345u);
  EXPECT_EQ(bench.reg(3, damiao::kTimeout), 0u);
}

TEST(DamiaoArm, ReleaseAndTheDestructorSwitchTheMotorsOff) {
  DamiaoBench bench;
  bench.enabled();
  ASSERT_TRUE(bench.cycle(0.1));
  ASSERT_GT(bench.acting_newton_m(), 0.5);

  bench.arm().release();
  bench.settle();

  EXPECT_EQ(bench.acting_newton_m(), 0.0);
  EXPECT_EQ(bench.state(2), damiao::kOff);
  EXPECT_TRUE(bench.arm().read(bench.reading));
  ASSERT_TRUE(bench.arm().enable()) << bench.arm().fault_text();
  EXPECT_TRUE(bench.cycle(0.1));
}

TEST(DamiaoArm, ClassicFramesDoToo) {
  DamiaoBench bench;
  bench.settings.is_fd = false;
  bench.enabled();
  for (int k = 0; k < 5; ++k) ASSERT_TRUE(bench.cycle(0.1)) << bench.arm().fault_text();
}

// --- values -------------------------------------------------------------------------------------

// No code of the wire is 0: the codes beside it are half a unit each.
TEST(DamiaoArm, TorqueIsRoundedTowardsZeroAndToldAsItIs) {
  DamiaoBench bench;
  keep_one(bench);
  bench.enabled();
  const auto made_of = [&](double units) {
    EXPECT_TRUE(bench.cycle(units * kUnitNewtonM)) << bench.arm().fault_text();
    static_cast<void>(bench.acting_newton_m());
    bench.emulator().with_motor(4, [&](EmulatedDamiaoMotor& motor) {
      EXPECT_NEAR(motor.torque_newton_m(), bench.made[0], 1e-12);
    });
    return bench.made[0] / kUnitNewtonM;
  };
  EXPECT_NEAR(made_of(100.6), 100.5, 1e-9);
  EXPECT_NEAR(made_of(100.4), 99.5, 1e-9);
  EXPECT_NEAR(made_of(-100.6), -100.5, 1e-9);
  EXPECT_NEAR(made_of(0.2), 0.5, 1e-9);
  EXPECT_NEAR(made_of(-0.2), -0.5, 1e-9);
  EXPECT_NEAR(made_of(0.0), -0.5, 1e-9);  // as openarm_can's 0
  EXPECT_NEAR(made_of(7.5), 7.5, 1e-9);   // what a code makes is that code again
}

TEST(DamiaoArm, TorqueIsCutOffAtTheLimitAndNoneIfItIsNoNumber) {
  DamiaoBench bench;
  bench.joints[4].torque_limit_newton_m = 0.2;
  bench.joints[5].torque_limit_newton_m = 100.0;  // the range is 10 N·m
  bench.enabled();
  ASSERT_TRUE(bench.cycle(50.0));
  EXPECT_NEAR(bench.made[4], 40.5 * kUnitNewtonM, 1e-9);  // ⌊0.2/u − ½⌋ + ½
  EXPECT_NEAR(bench.made[5], 10.0, 1e-9);
  EXPECT_NEAR(bench.arm().largest_torque_newton_m(4), 40.5 * kUnitNewtonM, 1e-9);
  ASSERT_TRUE(bench.cycle(-50.0));
  EXPECT_NEAR(bench.made[4], -40.5 * kUnitNewtonM, 1e-9);
  EXPECT_NEAR(bench.made[5], -10.0, 1e-9);
  ASSERT_TRUE(bench.cycle(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_NEAR(bench.made[4], -0.5 * kUnitNewtonM, 1e-9);
  ASSERT_TRUE(bench.cycle(std::numeric_limits<double>::infinity()));
  EXPECT_NEAR(bench.made[5], -0.5 * kUnitNewtonM, 1e-9);
}

// A joint that turns against its motor, half as far; the motor makes 80 % of what it says.
TEST(DamiaoArm, SignGearOffsetAndRatioHoldForAngleAndTorque) {
  std::vector<DamiaoMotorSettings> motors = seven_damiao_motors();
  motors[4].torque_ratio = 0.8;
  DamiaoBench bench(motors);
  keep_one(bench);
  bench.joints[0].sign = -1.0;
  bench.joints[0].gear = 2.0;
  bench.joints[0].offset_rad = 0.5;  // q = −0.3/2 + 0.5
  bench.joints[0].lowest_rad = -1.0;
  bench.joints[0].highest_rad = 1.5;
  bench.joints[0].torque_ratio = 0.8;
  bench.enabled();
  ASSERT_TRUE(bench.cycle(0.3));
  EXPECT_NEAR(bench.reading.position_rad[0], 0.35, 1e-3);
  EXPECT_NEAR(bench.made[0], 0.3, 2.0 * 0.8 * kUnitNewtonM);
  EXPECT_LE(bench.made[0], 0.3);
  static_cast<void>(bench.acting_newton_m());
  bench.emulator().with_motor(4, [&](EmulatedDamiaoMotor& motor) {
    EXPECT_NEAR(motor.torque_newton_m(), -0.5 * bench.made[0], 1e-12);
  });
}

TEST(DamiaoArm, TurnsAreFoundFromTheRange) {
  DamiaoBench bench;
  for (std::size_t i = 0; i < 3; ++i) {
    bench.emulator().with_motor(
        i, [i](EmulatedDamiaoMotor& motor) { motor.turn(static_cast<int>(i) - 1); });
  }
  bench.pass(2ms);
  bench.enabled();
  ASSERT_TRUE(bench.cycle());
  for (std::size_t i = 0; i < 7; ++i) EXPECT_NEAR(bench.reading.position_rad[i], 0.0, 2e-3);
}

// --- time ---------------------------------------------------------------------------------------

TEST(DamiaoArm, WhatWasWrittenIsKnownUnlessItCameLateOrNotAtAll) {
  DamiaoBench bench;
  bench.settings.longest_delay_s = 0.003;  // 1 ms of it is the motor's
  DamiaoArm& arm = bench.enabled();
  const LeaderValues torque{0.05, 0.05, 0.05, 0.05, 0.05, 0.05, 0.05};
  ASSERT_TRUE(bench.cycle(0.05));
  ASSERT_TRUE(arm.read(bench.reading));
  EXPECT_TRUE(bench.reading.is_known);
  EXPECT_NEAR(bench.reading.elapsed_s, 0.002 + 0.003, 1e-9);

  bench.pass(3ms);  // between the reading and its answer
  ASSERT_TRUE(bench.write(torque));
  ASSERT_TRUE(arm.read(bench.reading));
  EXPECT_FALSE(bench.reading.is_known);

  bench.settings.answer_limit_s = 0.02;
  bench.emulator().with_motor(3, [](EmulatedDamiaoMotor& motor) { motor.is_there = false; });
  ASSERT_TRUE(bench.write(torque));  // nobody says that it came
  bench.emulator().with_motor(3, [](EmulatedDamiaoMotor& motor) { motor.is_there = true; });
  ASSERT_TRUE(arm.read(bench.reading)) << arm.fault_text();
  EXPECT_FALSE(bench.reading.is_known);
}

TEST(DamiaoArm, ACycleThatTakesTooLongIsLimp) {
  DamiaoBench bench;
  bench.settings.timeout_s = 0.2;  // longer than the cycle
  bench.enabled();
  ASSERT_TRUE(bench.cycle(0.3));
  bench.pass(30ms);
  ASSERT_GT(bench.acting_newton_m(), 1.5);
  ASSERT_TRUE(bench.arm().read(bench.reading));
  EXPECT_FALSE(bench.reading.is_known);
  bench.pass(2ms);
  // half a unit of each: 2 · 0.0132 + 2 · 0.0068 + 3 · 0.0024
  EXPECT_LT(bench.acting_newton_m(), 0.05);
}

TEST(DamiaoArm, TheLeaseIsACycleAndTheTimeoutWithItsDoubt) {
  DamiaoBench bench;
  bench.settings.longest_cycle_s = 0.010;
  bench.settings.longest_delay_s = 0.005;
  bench.settings.timeout_s = 0.040;
  EXPECT_NEAR(bench.open().lease_s(), 0.010 + 0.005 + 0.045, 1e-12);
  // two steps of the wire, the play, and 6 rad/s for 5 ms to either side
  EXPECT_NEAR(bench.arm().resolution_rad(0), 2.0 * 25.0 / 65'535 + 0.001 + 2 * 6.0 * 0.005, 1e-12);
}

TEST(DamiaoArm, TheTimeoutEndsTheTorqueWhenTheProgramStops) {
  for (const double timeout_s : {0.020, 0.050}) {
    DamiaoBench bench;
    bench.settings.timeout_s = timeout_s;
    bench.enabled();
    for (int k = 0; k < 5; ++k) ASSERT_TRUE(bench.cycle(0.1));
    const double last_s = bench.emulator().now_s() - 0.002;  // of the last write
    bench.pass(500ms);
    static_cast<void>(bench.acting_newton_m());
    EXPECT_GE(bench.emulator().torque_until_s(), last_s + timeout_s - 1e-4);
    EXPECT_LE(bench.emulator().torque_until_s(), last_s + timeout_s + 0.001);

    EXPECT_FALSE(bench.cycle());
    EXPECT_EQ(bench.arm().fault(), LeaderFault::kWatchdogFired) << bench.arm().fault_text();
    EXPECT_FALSE(bench.arm().enable());  // a new object is needed, and it can be made
    bench.enabled();
    EXPECT_TRUE(bench.cycle());
  }
}

TEST(DamiaoArm, ACycleAllocatesNothingAndEndsInTime) {
  DamiaoBench bench;
  bench.enabled();
  for (int k = 0; k < 5; ++k) ASSERT_TRUE(bench.cycle(0.05));
  {
    const test::AllocGuard guard;
    const std::uint64_t mallocs = test::mallocs_of_this_thread();
    for (int k = 0; k < 200; ++k) ASSERT_TRUE(bench.cycle(0.05));
    EXPECT_EQ(guard.count(), 0u);
    EXPECT_EQ(test::mallocs_of_this_thread(), mallocs);
  }

  // one that finds a fault: a read twice, then each motor once
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
  std::size_t joint;
};
class DamiaoFaults : public testing::TestWithParam<FaultCase> {};

TEST_P(DamiaoFaults, MakeTheArmLimpAndAreNamed) {
  DamiaoBench bench;
  bench.enabled();
  for (int k = 0; k < 5; ++k) ASSERT_TRUE(bench.cycle(0.1)) << bench.arm().fault_text();
  ASSERT_GT(bench.acting_newton_m(), 0.5);
  const LeaderValues before = bench.reading.position_rad;

  bench.plan(GetParam().wire);
  bool is_good = true;
  for (int k = 0; k < 30 && is_good; ++k) {
    is_good = bench.cycle(k % 2 == 0 ? 0.6 : 0.1);
    if (!is_good) break;
    for (std::size_t i = 0; i < 7; ++i) {  // never a jump
      EXPECT_NEAR(bench.reading.position_rad[i], before[i], 0.2);
    }
  }

  EXPECT_FALSE(is_good);
  EXPECT_EQ(bench.arm().fault(), GetParam().fault) << bench.arm().fault_text();
  EXPECT_EQ(bench.arm().fault_joint(), GetParam().joint) << bench.arm().fault_text();
  EXPECT_FALSE(bench.arm().fault_text().empty());
  EXPECT_FALSE(bench.arm().is_enabled());
  EXPECT_FALSE(bench.cycle(0.1));
  bench.pass(25ms);  // motors that hear nothing have their timeout
  EXPECT_EQ(bench.acting_newton_m(), 0.0);
}

INSTANTIATE_TEST_SUITE_P(
    All, DamiaoFaults,
    testing::Values(FaultCase{WireFault::kSilent, LeaderFault::kNoAnswer, 0},
                    FaultCase{WireFault::kUnplugged, LeaderFault::kClosed, 7},
                    FaultCase{WireFault::kGarbage, LeaderFault::kCorrupt, 0},
                    FaultCase{WireFault::kShort, LeaderFault::kCorrupt, 0},
                    FaultCase{WireFault::kWrongId, LeaderFault::kNoAnswer, 0},
                    // of the DM4310: a step of 0.5 N·m is 19 units of a DM8009 and 102 of these
                    FaultCase{WireFault::kStuck, LeaderFault::kStale, 0},
                    FaultCase{WireFault::kServoGone, LeaderFault::kNoAnswer, kLastButOne},
                    FaultCase{WireFault::kServoReboot, LeaderFault::kRebooted, kLastButOne},
                    FaultCase{WireFault::kServoOverload, LeaderFault::kHardwareError, kLastButOne},
                    FaultCase{WireFault::kBusOff, LeaderFault::kBusDown, 7}),
    [](const auto& info) {
      return "WireFault" + std::to_string(static_cast<int>(info.param.wire));
    });

// Its torque is made a little less for that, and what it is told is said.
TEST(DamiaoArm, AStatusThatIsFrozenUnderAConstantTorqueIsFound) {
  DamiaoBench bench;
  bench.enabled();
  for (int k = 0; k < 100; ++k) ASSERT_TRUE(bench.cycle(0.6)) << bench.arm().fault_text();
  bench.plan(WireFault::kStuck);
  int cycles = 0;
  bool is_less = false;
  while (cycles < 200 && bench.cycle(0.6)) {
    ++cycles;
    EXPECT_LE(bench.made[5], 0.6);
    is_less = is_less || bench.made[5] < 0.6 - 0.07;  // 16 steps of a DM4310
  }
  EXPECT_TRUE(is_less);
  EXPECT_EQ(bench.arm().fault(), LeaderFault::kStale) << bench.arm().fault_text();
  EXPECT_LE(cycles, 65);  // 100 + 20 ms, in cycles of 2 ms
}

TEST(DamiaoArm, AnArmThatRestsUnderAConstantTorqueIsSound) {
  DamiaoBench bench;
  bench.enabled();
  double sum = 0.0;
  for (int k = 0; k < 1000; ++k) {
    ASSERT_TRUE(bench.cycle(0.6)) << bench.arm().fault_text();
    sum += bench.made[5];
  }
  EXPECT_GT(sum / 1000.0, 0.95 * 0.6);
}

TEST(DamiaoArm, EachErrorIsNamedWithItsCause) {
  for (const auto& [state, cause] : {std::pair{0x8U, "supply voltage too high"},
                                     {0x9U, "supply voltage too low"},
                                     {0xAU, "current too high"},
                                     {0xBU, "board overheated"},
                                     {0xCU, "winding overheated"},
                                     {0xEU, "overload"},
                                     {0x3U, "unknown state 3"}}) {
    DamiaoBench bench;
    bench.enabled();
    ASSERT_TRUE(bench.cycle(0.1));
    bench.emulator().with_motor(2, [s = state](EmulatedDamiaoMotor& m) { m.protect(s); });
    EXPECT_FALSE(bench.cycle());
    EXPECT_EQ(bench.arm().fault(), LeaderFault::kHardwareError);
    EXPECT_THAT(bench.arm().fault_text(),
                HasSubstr("joint 3 (id 3): reports a hardware error: " + std::string(cause)));
  }
}

TEST(DamiaoArm, ATurnTooManyIsNoJump) {
  DamiaoBench bench;
  bench.enabled();
  ASSERT_TRUE(bench.cycle(0.1));
  bench.emulator().with_motor(2, [](EmulatedDamiaoMotor& motor) { motor.turn(-1); });
  bench.pass(1ms);
  EXPECT_FALSE(bench.cycle());
  EXPECT_EQ(bench.arm().fault(), LeaderFault::kWrapped);
  EXPECT_EQ(bench.arm().fault_joint(), 2u);
}

TEST(DamiaoArm, TorqueThatIsSwitchedOffElsewhereIsNamed) {
  DamiaoBench bench;
  bench.enabled();
  ASSERT_TRUE(bench.cycle(0.1));
  bench.emulator().with_motor(1, [&](EmulatedDamiaoMotor& motor) {
    EXPECT_TRUE(motor.hear(damiao_command(2, DamiaoCommand::kDisable), bench.emulator().now_s()));
  });
  EXPECT_FALSE(bench.cycle());
  EXPECT_EQ(bench.arm().fault(), LeaderFault::kTorqueOff);
  EXPECT_EQ(bench.arm().fault_joint(), 1u);
}

TEST(DamiaoArm, AnAngleBeyondItsRangeIsNamed) {
  DamiaoBench bench(seven_damiao_motors(), [](std::size_t joint, double, double rad_per_s, double) {
    return joint == 4 ? 1.5 - 0.3 * rad_per_s : 0.0;
  });
  bench.joints[4].highest_rad = 1.0;
  bench.enabled();
  int cycles = 0;
  while (cycles < 1000 && bench.cycle()) ++cycles;
  EXPECT_EQ(bench.arm().fault(), LeaderFault::kOutOfRange) << bench.arm().fault_text();
  EXPECT_EQ(bench.arm().fault_joint(), 4u);
}

TEST(DamiaoArm, LostAnswersAreAskedForAgain) {
  DamiaoBench bench;
  bench.settings.answer_limit_s = std::min(0.2, to_seconds(test::patience(10ms)));
  bench.enabled();
  bench.plan(WireFault::kDropped);
  int cycles = 0;
  while (cycles < 50 && bench.cycle(0.05)) ++cycles;
  EXPECT_GT(bench.reading.repeated, 0u);
  // at 30 % of the reads one is missing: twice in a row ends it, and it is said
  if (cycles < 50) {
    EXPECT_EQ(bench.arm().fault(), LeaderFault::kNoAnswer);
  }
}

TEST(DamiaoArm, AnswersThatComeTwiceAreOne) {
  DamiaoBench bench;
  keep_one(bench);
  bench.enabled();
  bench.plan(WireFault::kDoubled);
  for (int k = 0; k < 20; ++k) ASSERT_TRUE(bench.cycle(0.05)) << bench.arm().fault_text();
  EXPECT_EQ(bench.reading.repeated, 0u);
}

// --- watchdog -----------------------------------------------------------------------------------

TEST(DamiaoArm, ATimeoutThatIsNotKeptIsNoLease) {
  DamiaoBench bench;
  bench.emulator().with_motor(3, [](EmulatedDamiaoMotor& m) { m.keeps_registers = false; });
  bench.open();
  EXPECT_FALSE(bench.arm().enable());
  EXPECT_EQ(bench.arm().fault(), LeaderFault::kNoWatchdog);
  EXPECT_EQ(bench.arm().fault_joint(), 3u);
  for (std::size_t i = 0; i < 7; ++i) EXPECT_EQ(bench.state(i), damiao::kOff);
}

// The register holds the number, and nothing comes of it: it is tried before there is a torque.
TEST(DamiaoArm, ATimeoutThatEndsNoTorqueIsFoundBeforeThereIsOne) {
  DamiaoBench bench;
  bench.plan(WireFault::kNoWatchdog);
  bench.open();
  EXPECT_FALSE(bench.arm().enable());
  EXPECT_EQ(bench.arm().fault(), LeaderFault::kNoWatchdog);
  bench.settle();
  EXPECT_EQ(bench.acting_newton_m(), 0.0);
}

}  // namespace
}  // namespace palpate::device
