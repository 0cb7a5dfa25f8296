// SPDX-License-Identifier: Apache-2.0
// What a leader arm of Dynamixel servos refuses before it may have torque, with the remedy.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "device_node/drivers/dynamixel/dynamixel_arm.h"
#include "device_node/drivers/dynamixel/dynamixel_models.h"
#include "device_node/emulators/dynamixel_emulator.h"
#include "tests/unit/device_node/dynamixel/bench.h"

namespace palpate::device {
namespace {

using test::LeaderBench;
using ::testing::HasSubstr;

TEST(DynamixelSetUp, AnotherModeIsRefusedUnlessItMayBeWritten) {
  LeaderBench bench;
  bench.emulator().with_servo(3, [](EmulatedServo& servo) {
    EXPECT_EQ(servo.write(dynamixel::kOperatingMode, std::array{std::byte{3}}), 0);
    EXPECT_EQ(servo.write(dynamixel::kReturnDelay, std::array{std::byte{250}}), 0);
  });
  EXPECT_THAT(bench.refusal(),
              HasSubstr("joint 4 (id 4): operating mode 3 is not current control"));
  bench.settings.may_write_eeprom = true;
  bench.open();
  EXPECT_EQ(bench.entry(3, dynamixel::kOperatingMode), 0u);
  EXPECT_EQ(bench.entry(3, dynamixel::kReturnDelay), 0u);
}

TEST(DynamixelSetUp, DriveModesThatTurnOrCoupleOrSwitchOnAreRefused) {
  for (const unsigned mode : {0x01U, 0x02U, 0x08U}) {
    LeaderBench bench;
    bench.emulator().with_servo(0, [mode](EmulatedServo& servo) {
      EXPECT_EQ(servo.write(dynamixel::kDriveMode, std::array{static_cast<std::byte>(mode)}), 0);
    });
    EXPECT_THAT(bench.refusal(), HasSubstr("joint 1 (id 1): drive mode"));
  }
}

TEST(DynamixelSetUp, ServosThatCannotDoItAreRefused) {
  const auto refusal_of = [](std::uint16_t model, std::uint8_t firmware) {
    std::vector<ServoSettings> servos = seven_servos();
    servos[6].model = model;
    servos[6].firmware = firmware;
    return LeaderBench(servos).refusal();
  };
  EXPECT_THAT(refusal_of(1060, 45), HasSubstr("XL430-W250: has no current control"));
  EXPECT_THAT(refusal_of(4711, 45), HasSubstr("model 4711 is not known here"));
  EXPECT_THAT(refusal_of(1020, 37), HasSubstr("firmware 37 has no Bus Watchdog"));
  EXPECT_THAT(refusal_of(1020, 45), HasSubstr("cannot be read as one"));
}

// Per mA, per A of another unit, of another model.
TEST(DynamixelSetUp, ATorqueFarFromTheModelsIsRefused) {
  for (const double per_ampere : {0.354e-3, 0.1, 1.1, 354.0}) {
    LeaderBench bench;
    bench.joints[2].torque_newton_m_per_ampere = per_ampere;
    EXPECT_THAT(bench.refusal(),
                HasSubstr("joint 3 (id 3), XL330-M288: torque_newton_m_per_ampere"));
    EXPECT_THAT(bench.refusal(), HasSubstr("must be within 0.117914 … 1.06122"));
  }
  for (const double per_ampere : {0.12, 1.0}) {
    LeaderBench bench;
    bench.joints[2].torque_newton_m_per_ampere = per_ampere;
    EXPECT_EQ(bench.refusal(), "it opens");
  }
}

TEST(DynamixelSetUp, AHardwareErrorIsRefusedWithItsCause) {
  LeaderBench bench;
  bench.emulator().with_servo(5, [](EmulatedServo& servo) { servo.protect(0x24); });
  EXPECT_THAT(bench.refusal(),
              HasSubstr("joint 6 (id 6): reports a hardware error: overheated, overload"));
}

TEST(DynamixelSetUp, AServoThatIsNotThereIsNamed) {
  LeaderBench bench;
  bench.joints[2].id = 77;
  EXPECT_THAT(bench.refusal(), HasSubstr("joint 3 (id 77): does not answer at 4000000 bit/s"));
}

TEST(DynamixelSetUp, WrongSettingsAreRefusedBeforeTheLineIsOpened) {
  const auto refusal_of = [](const auto& change) {
    LeaderBench bench;
    change(bench);
    return bench.refusal();
  };
  EXPECT_THAT(refusal_of([](LeaderBench& b) { b.joints.clear(); }), HasSubstr("1 … 8 joints"));
  EXPECT_THAT(refusal_of([](LeaderBench& b) { b.joints.resize(9); }), HasSubstr("1 … 8 joints"));
  EXPECT_THAT(refusal_of([](LeaderBench& b) { b.joints[1].id = 1; }), HasSubstr("has this id"));
  EXPECT_THAT(refusal_of([](LeaderBench& b) { b.joints[1].id = 253; }), HasSubstr("0 … 252"));
  EXPECT_THAT(refusal_of([](LeaderBench& b) { b.joints[1].sign = 0.5; }), HasSubstr("sign"));
  EXPECT_THAT(refusal_of([](LeaderBench& b) { b.joints[1].gear = 0.0; }), HasSubstr("gear"));
  EXPECT_THAT(refusal_of([](LeaderBench& b) { b.joints[1].current_limit_ampere = 0.0; }),
              HasSubstr("current_limit_ampere"));
  EXPECT_THAT(refusal_of([](LeaderBench& b) { b.joints[1].fastest_rad_per_s = -1.0; }),
              HasSubstr("fastest_rad_per_s"));
  EXPECT_THAT(refusal_of([](LeaderBench& b) { b.joints[1].play_rad = -1.0; }), HasSubstr("play"));
  EXPECT_THAT(refusal_of([](LeaderBench& b) { b.joints[1].highest_rad = 6.0; }),
              HasSubstr("below one turn of the shaft"));
  EXPECT_THAT(
      refusal_of([](LeaderBench& b) { b.joints[1].torque_newton_m_per_ampere = std::nan(""); }),
      HasSubstr("torque_newton_m_per_ampere"));
  EXPECT_THAT(refusal_of([](LeaderBench& b) { b.joints[1].offset_rad = std::nan(""); }),
              HasSubstr("offset_rad"));
  for (double LeaderJoint::*angle :
       {&LeaderJoint::offset_rad, &LeaderJoint::lowest_rad, &LeaderJoint::highest_rad,
        &LeaderJoint::fastest_rad_per_s, &LeaderJoint::play_rad}) {
    EXPECT_THAT(refusal_of([=](LeaderBench& b) { b.joints[1].*angle = -180.0; }),
                HasSubstr("= -180: must be"));
    EXPECT_THAT(refusal_of([=](LeaderBench& b) { b.joints[1].*angle = 180.0; }),
                HasSubstr("is it in degrees?"));
  }
  EXPECT_THAT(refusal_of([](LeaderBench& b) { b.settings.watchdog_units = 0; }),
              HasSubstr("1 … 127"));
  EXPECT_THAT(refusal_of([](LeaderBench& b) { b.settings.answer_limit_s = 0.0; }),
              HasSubstr("answer_limit_s"));
  EXPECT_THAT(refusal_of([](LeaderBench& b) { b.settings.bits_per_second = 12'345; }),
              HasSubstr("12345 bit/s is no speed"));
  EXPECT_THAT(refusal_of([](LeaderBench& b) { b.settings.port = "/nowhere"; }),
              HasSubstr("/nowhere"));
}

// 211 bytes at 57.6 kbit/s are 36.6 ms.
TEST(DynamixelSetUp, ALineThatIsTooSlowIsRefused) {
  LeaderBench bench;
  bench.settings.bits_per_second = 57'600;
  EXPECT_THAT(bench.refusal(),
              HasSubstr("a cycle takes 36.6319 ms at 57600 bit/s; longest_delay_s"));
  bench.settings.longest_delay_s = 0.045;
  EXPECT_THAT(bench.refusal(), HasSubstr("longest_cycle_s must be above 0.0366319"));
  bench.settings.longest_cycle_s = 0.05;
  EXPECT_THAT(bench.refusal(), HasSubstr("watchdog_units must be above 1.8316"));
  bench.settings.watchdog_units = 3;
  bench.enabled();
  EXPECT_TRUE(bench.cycle(0.1));
}

TEST(DynamixelSetUp, ServosBesideTheArmAreLeftAlone) {
  LeaderBench bench;
  bench.joints.resize(3);
  bench.enabled();
  ASSERT_TRUE(bench.cycle(0.1));
  EXPECT_EQ(bench.entry(4, dynamixel::kTorqueEnable), 0u);
}

}  // namespace
}  // namespace palpate::device
