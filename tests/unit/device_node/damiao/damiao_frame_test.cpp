// SPDX-License-Identifier: Apache-2.0
// Frames of Damiao motors, byte by byte. Each golden frame names its source:
//   [OA]  what openarm_can 9866604 (2026-08-01, src/openarm/damiao_motor/dm_motor_control.cpp)
//   makes
//         of the same call, or of the same bytes, compiled and run
//   [OAC] the same commit, setup/cli/commands: the frame is written out there
//   [K]   linux/can.h and linux/can/error.h of the kernel's interface
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/random.h"
#include "device_node/drivers/damiao/damiao_frame.h"
#include "device_node/drivers/damiao/damiao_leader.h"
#include "device_node/drivers/damiao/damiao_models.h"
#include "device_node/drivers/transport/can_port.h"

namespace palpate::device {
namespace {

/// "001#FFFC": identifier and data.
std::string text_of(const CanFrame& frame) {
  constexpr std::string_view kDigits = "0123456789ABCDEF";
  std::string text;
  for (const unsigned shift : {8U, 4U, 0U}) text += kDigits[frame.id >> shift & 15U];
  text += '#';
  for (std::size_t i = 0; i < frame.size; ++i) {
    text += kDigits[std::to_integer<unsigned>(frame.data[i]) >> 4U];
    text += kDigits[std::to_integer<unsigned>(frame.data[i]) & 15U];
  }
  return text;
}

CanFrame frame_of(std::uint32_t id, const std::vector<unsigned>& bytes) {
  CanFrame frame{.id = id, .size = static_cast<std::uint8_t>(bytes.size())};
  for (std::size_t i = 0; i < bytes.size(); ++i) frame.data[i] = static_cast<std::byte>(bytes[i]);
  return frame;
}

std::string control(unsigned id, std::string_view model, const DamiaoControl& values) {
  return text_of(damiao_control(id, damiao_codes(values, damiao_model(model)->range)));
}

// --- what is sent -------------------------------------------------------------------------------

TEST(DamiaoFrame, CommandsAreThoseOfOpenArm) {  // [OA], the last one [OAC] clear_error
  EXPECT_EQ(text_of(damiao_command(1, DamiaoCommand::kEnable)), "001#FFFFFFFFFFFFFFFC");
  EXPECT_EQ(text_of(damiao_command(1, DamiaoCommand::kDisable)), "001#FFFFFFFFFFFFFFFD");
  EXPECT_EQ(text_of(damiao_command(1, DamiaoCommand::kZero)), "001#FFFFFFFFFFFFFFFE");
  EXPECT_EQ(text_of(damiao_command(1, DamiaoCommand::kClearError)), "001#FFFFFFFFFFFFFFFB");
}

TEST(DamiaoFrame, ControlIsThatOfOpenArm) {  // [OA], the first two from its examples/demo.cpp
  EXPECT_EQ(
      control(1, "DM4310", {.stiffness_newton_m_per_rad = 2.0, .damping_newton_m_s_per_rad = 1.0}),
      "001#7FFF7FF0103337FF");
  EXPECT_EQ(control(1, "DM4310", {.torque_newton_m = 0.1}), "001#7FFF7FF000000813");
  EXPECT_EQ(control(1, "DM4310", {}), "001#7FFF7FF0000007FF");
  EXPECT_EQ(control(2, "DM8009", {.torque_newton_m = -3.5}), "002#7FFF7FF00000077A");
  EXPECT_EQ(control(3, "DM4340",
                    {.position_rad = 1.2,
                     .velocity_rad_per_s = -2.5,
                     .stiffness_newton_m_per_rad = 30.0,
                     .damping_newton_m_s_per_rad = 0.8,
                     .torque_newton_m = 4.0}),
            "003#8C495FF0F528F924");
}

TEST(DamiaoFrame, ValuesBeyondTheirRangeAreCutOff) {  // [OA]
  EXPECT_EQ(control(2, "DM8009",
                    {.position_rad = 99.0,
                     .velocity_rad_per_s = -99.0,
                     .stiffness_newton_m_per_rad = 900.0,
                     .damping_newton_m_s_per_rad = 9.0,
                     .torque_newton_m = 99.0}),
            "002#FFFF000FFFFFFFFF");
}

TEST(DamiaoFrame, RegistersAreThoseOfOpenArm) {  // [OA]; the timeout [OAC] write_motor_param
  EXPECT_EQ(text_of(damiao_write_register(1, damiao::kControlMode, damiao::kMitMode)),
            "7FF#0100550A01000000");
  EXPECT_EQ(text_of(damiao_read_register(1, damiao::kTimeout)), "7FF#0100330900000000");
  EXPECT_EQ(text_of(damiao_read_register(3, damiao::kPositionRange)), "7FF#0300331500000000");
  EXPECT_EQ(text_of(damiao_write_register(1, damiao::kTimeout, 400)), "7FF#0100550990010000");
  EXPECT_EQ(text_of(damiao_refresh(2)), "7FF#0200CC0000000000");
}

// A frame with both gains 0 says a torque: whatever the angle and the speed in it.
TEST(DamiaoFrame, WithoutGainsOnlyTheTorqueCounts) {
  const std::string text = control(1, "DM4310", {.torque_newton_m = 0.1});
  EXPECT_EQ(text.substr(4 + 7, 6), "000000");  // 12 bits of stiffness, 12 of damping
}

// --- what is read -------------------------------------------------------------------------------

TEST(DamiaoFeedback, IsThatOfOpenArm) {  // [OA]; the state, the upper half of the first byte
  DamiaoFeedback said;
  const CanFrame frame = frame_of(0x11, {0x11, 0x8A, 0x3D, 0x7F, 0x48, 0x13, 0x1F, 0x1D});
  ASSERT_TRUE(read_damiao_feedback(frame, 1, said));
  EXPECT_EQ(said.state, damiao::kOn);
  EXPECT_NEAR(damiao_value(said.position, -12.5, 12.5, 16), 1.000038148, 1e-9);
  EXPECT_NEAR(damiao_value(said.velocity, -30.0, 30.0, 12), -0.168498168, 1e-9);
  EXPECT_NEAR(damiao_value(said.torque, -10.0, 10.0, 12), 0.095238095, 1e-9);
  EXPECT_EQ(said.board_celsius, 31);
  EXPECT_EQ(said.rotor_celsius, 29);
}

TEST(DamiaoFeedback, OfAnotherMotorOrLengthIsRefused) {
  DamiaoFeedback said;
  EXPECT_FALSE(read_damiao_feedback(frame_of(0x11, {0x12, 0, 0, 0, 0, 0, 0, 0}), 1, said));
  EXPECT_FALSE(read_damiao_feedback(frame_of(0x11, {0x11, 0, 0, 0, 0, 0, 0}), 1, said));
}

TEST(DamiaoRegister, IsThatOfOpenArm) {  // [OA]
  std::uint32_t value = 0;
  ASSERT_TRUE(read_damiao_register(frame_of(0x11, {1, 0, 0x33, 21, 0x00, 0x00, 0x48, 0x41}), 1,
                                   damiao::kPositionRange, value));
  EXPECT_EQ(std::bit_cast<float>(value), 12.5F);
  ASSERT_TRUE(read_damiao_register(frame_of(0x11, {1, 0, 0x55, 9, 0x90, 0x01, 0, 0}), 1,
                                   damiao::kTimeout, value));
  EXPECT_EQ(value, 400u);
}

TEST(DamiaoRegister, OfAnotherMotorRegisterOrKindIsRefused) {
  std::uint32_t value = 7;
  for (const auto& bytes : std::vector<std::vector<unsigned>>{{2, 0, 0x33, 9, 0, 0, 0, 0},
                                                              {1, 1, 0x33, 9, 0, 0, 0, 0},
                                                              {1, 0, 0xAA, 9, 0, 0, 0, 0},
                                                              {1, 0, 0x33, 8, 0, 0, 0, 0},
                                                              {1, 0, 0x33, 9}}) {
    EXPECT_FALSE(read_damiao_register(frame_of(0x11, bytes), 1, damiao::kTimeout, value));
  }
  EXPECT_EQ(value, 7u);
}

TEST(DamiaoCode, ComesBackWithinAStep) {
  Random random(5);
  for (int k = 0; k < 2000; ++k) {
    const double most = random.uniform(0.5, 60.0);
    const double value = random.uniform(-most, most);
    const double again = damiao_value(damiao_code(value, -most, most, 12), -most, most, 12);
    EXPECT_LE(again, value + 1e-9);
    EXPECT_GE(again, value - 2.0 * most / 4095 - 1e-9);
  }
}

// --- the kernel's frames ------------------------------------------------------------------------

TEST(CanFrames, HaveTheKernelsBytes) {  // [K]
  CanFrame frame = damiao_command(1, DamiaoCommand::kEnable);
  const CanBytes classic = to_bytes(frame);
  EXPECT_EQ(classic.size, 16u);  // can_frame: identifier, length, three bytes, data
  EXPECT_EQ(classic.bytes[0], std::byte{1});
  EXPECT_EQ(classic.bytes[4], std::byte{8});
  EXPECT_EQ(classic.bytes[15], std::byte{0xFC});

  frame.is_fd = true;  // [OA] dm_motor_device.cpp: canfd_frame with CANFD_BRS
  const CanBytes fd = to_bytes(frame);
  EXPECT_EQ(fd.size, 72u);
  EXPECT_EQ(fd.bytes[4], std::byte{8});
  EXPECT_EQ(fd.bytes[5], std::byte{1});
  EXPECT_EQ(fd.bytes[15], std::byte{0xFC});
}

TEST(CanFrames, ComeBackAsTheyWere) {
  for (const bool is_fd : {false, true}) {
    CanFrame frame = damiao_read_register(3, damiao::kTimeout);
    frame.is_fd = is_fd;
    const CanBytes raw = to_bytes(frame);
    CanFrame again;
    ASSERT_EQ(read_can(std::span(raw.bytes).first(raw.size), again), CanKind::kData);
    EXPECT_EQ(text_of(again), text_of(frame));
    EXPECT_EQ(again.is_fd, is_fd);
  }
}

TEST(CanFrames, WhatIsNoDataFrameIsTold) {  // [K]: flags of the identifier
  const auto kind_of = [](std::uint32_t id, std::size_t size, unsigned length) {
    std::vector<std::byte> bytes(size);
    if (size >= 5) {
      std::memcpy(bytes.data(), &id, sizeof(id));
      bytes[4] = static_cast<std::byte>(length);
    }
    CanFrame frame;
    return read_can(bytes, frame);
  };
  EXPECT_EQ(kind_of(0x8000'0011U, 16, 8), CanKind::kOther);   // extended
  EXPECT_EQ(kind_of(0x4000'0011U, 16, 8), CanKind::kOther);   // a request
  EXPECT_EQ(kind_of(0x2000'0004U, 16, 8), CanKind::kOther);   // of the controller
  EXPECT_EQ(kind_of(0x2000'0040U, 16, 8), CanKind::kBusOff);  // CAN_ERR_BUSOFF
  EXPECT_EQ(kind_of(0x11, 16, 9), CanKind::kCorrupt);
  EXPECT_EQ(kind_of(0x11, 72, 65), CanKind::kCorrupt);
  EXPECT_EQ(kind_of(0x11, 72, 64), CanKind::kData);
  EXPECT_EQ(kind_of(0x11, 15, 8), CanKind::kCorrupt);
  EXPECT_EQ(kind_of(0x11, 73, 8), CanKind::kCorrupt);
  EXPECT_EQ(kind_of(0, 0, 0), CanKind::kCorrupt);
}

// Seven motors, 28 frames: of 135 bits, or of 34 and 113.
TEST(DamiaoCycle, TakesWhatItsBitsTake) {
  EXPECT_NEAR(damiao_cycle_s(7, 1'000'000, 0), 28 * 135e-6, 1e-12);
  EXPECT_NEAR(damiao_cycle_s(7, 1'000'000, 5'000'000), 28 * (34e-6 + 113 * 0.2e-6), 1e-12);
}

}  // namespace
}  // namespace palpate::device
