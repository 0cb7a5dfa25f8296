// SPDX-License-Identifier: Apache-2.0
// Packets of Dynamixel's Protocol 2.0, byte by byte. Each golden message names its source:
//   [P2]   ROBOTIS e-manual, "DYNAMIXEL Protocol 2.0", emanual.robotis.com/docs/en/dxl/protocol2,
//          the example of the section
//   [SDK]  what the rules of DynamixelSDK 2ded684 (2026-05-06, c++/src/dynamixel_sdk/
//          protocol2_packet_handler.cpp) make of the same call, worked out by hand
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/random.h"
#include "device_node/drivers/dynamixel/dynamixel_leader.h"
#include "device_node/drivers/dynamixel/dynamixel_models.h"
#include "device_node/drivers/dynamixel/dynamixel_packet.h"
#include "tests/property/seeds.h"

namespace palpate::device {
namespace {

using Instruction = DynamixelInstruction;

std::string hex(std::span<const std::byte> bytes) {
  std::string text;
  for (const std::byte b : bytes) {
    text += "0123456789ABCDEF"[std::to_integer<unsigned>(b) >> 4U];
    text += "0123456789ABCDEF"[std::to_integer<unsigned>(b) & 15U];
    text += ' ';
  }
  if (!text.empty()) text.pop_back();
  return text;
}

std::vector<std::byte> bytes_of(std::string_view text) {
  std::vector<std::byte> bytes;
  for (std::size_t at = 0; at + 1 < text.size(); at += 3) {
    bytes.push_back(
        static_cast<std::byte>(std::stoi(std::string(text.substr(at, 2)), nullptr, 16)));
  }
  return bytes;
}

DynamixelMessage read_good(std::vector<std::byte>& packet) {
  DynamixelMessage message;
  EXPECT_EQ(read_dynamixel(packet, message), PacketFault::kNone);
  return message;
}

// --- what is sent -------------------------------------------------------------------------------

TEST(DynamixelPacket, PingIsThatOfTheManual) {  // [P2] Ping, example 1
  EXPECT_EQ(hex(DynamixelPacket(1, Instruction::kPing).finish()), "FF FF FD 00 01 03 00 01 19 4E");
}

TEST(DynamixelPacket, PingToEveryoneIsThatOfTheManual) {  // [P2] Ping, example 2
  EXPECT_EQ(hex(DynamixelPacket(kDynamixelEveryone, Instruction::kPing).finish()),
            "FF FF FD 00 FE 03 00 01 31 42");
}

TEST(DynamixelPacket, ReadIsThatOfTheManual) {  // [P2] Read: present position of id 1
  EXPECT_EQ(
      hex(DynamixelPacket(1, Instruction::kRead).u16(dynamixel::kPresentPosition).u16(4).finish()),
      "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15");
}

TEST(DynamixelPacket, WriteIsThatOfTheManual) {  // [P2] Write: goal position 512 of id 1
  EXPECT_EQ(hex(DynamixelPacket(1, Instruction::kWrite).u16(116).u16(512).u16(0).finish()),
            "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89");
}

TEST(DynamixelPacket, RebootIsThatOfTheManual) {  // [P2] Reboot
  EXPECT_EQ(hex(DynamixelPacket(1, Instruction::kReboot).finish()),
            "FF FF FD 00 01 03 00 08 2F 4E");
}

TEST(DynamixelPacket, SyncReadIsThatOfTheManual) {  // [P2] Sync Read: positions of 1 and 2
  EXPECT_EQ(hex(DynamixelPacket(kDynamixelEveryone, Instruction::kSyncRead)
                    .u16(132)
                    .u16(4)
                    .u8(1)
                    .u8(2)
                    .finish()),
            "FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA");
}

TEST(DynamixelPacket, FastSyncReadIsThatOfTheManual) {  // [P2] Fast Sync Read: ids 3, 7, 4
  EXPECT_EQ(hex(DynamixelPacket(kDynamixelEveryone, Instruction::kFastSyncRead)
                    .u16(132)
                    .u16(4)
                    .u8(3)
                    .u8(7)
                    .u8(4)
                    .finish()),
            "FF FF FD 00 FE 0A 00 8A 84 00 04 00 03 07 04 20 F2");
}

TEST(DynamixelPacket, SyncWriteIsThatOfTheManual) {  // [P2] Sync Write: goals of 1 and 2
  EXPECT_EQ(hex(DynamixelPacket(kDynamixelEveryone, Instruction::kSyncWrite)
                    .u16(116)
                    .u16(4)
                    .u8(1)
                    .u16(150)
                    .u16(0)
                    .u8(2)
                    .u16(170)
                    .u16(0)
                    .finish()),
            "FF FF FD 00 FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87");
}

// [P2] Packet Process: FF FF FD in the parameters becomes FF FF FD FD; the length counts it.
// [SDK] addStuffing() does so for each of them, also where the last byte ends one.
TEST(DynamixelPacket, WhatLooksLikeAHeaderIsStuffed) {
  EXPECT_EQ(hex(DynamixelPacket(1, Instruction::kWrite)
                    .u16(116)
                    .u16(0xFFFF)
                    .u16(0xFFFD)
                    .finish()
                    .first(15)),
            "FF FF FD 00 01 0A 00 03 74 00 FF FF FD FD FF");
  EXPECT_EQ(hex(DynamixelPacket(1, Instruction::kWrite)
                    .u16(116)
                    .bytes(bytes_of("FF FF FD FF FF FD"))
                    .finish()
                    .first(18)),
            "FF FF FD 00 01 0D 00 03 74 00 FF FF FD FD FF FF FD FD");
}

TEST(DynamixelPacket, MoreThanAPacketHoldsIsNone) {
  DynamixelPacket packet(1, Instruction::kWrite);
  for (int i = 0; i < 400; ++i) packet.u8(7);
  EXPECT_TRUE(packet.finish().empty());
}

// --- what is read -------------------------------------------------------------------------------

TEST(DynamixelStatus, PingOfTheManual) {  // [P2] Ping, example 1: model 1030, firmware 38
  std::vector<std::byte> packet = bytes_of("FF FF FD 00 01 07 00 55 00 06 04 26 65 5D");
  const DynamixelMessage message = read_good(packet);
  EXPECT_EQ(message.id, 1);
  EXPECT_EQ(message.instruction, Instruction::kStatus);
  ASSERT_EQ(message.parameters.size(), 4u);
  EXPECT_EQ(message.parameters[0], std::byte{0});
  EXPECT_EQ(dynamixel_u16(message.parameters, 1), 1030u);
  EXPECT_STREQ(dynamixel_model(1030)->name, "XM430-W210");
  EXPECT_EQ(message.parameters[3], std::byte{38});
}

TEST(DynamixelStatus, PositionOfTheManual) {  // [P2] Sync Read: 2,079 of id 2
  std::vector<std::byte> packet = bytes_of("FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE");
  const DynamixelMessage message = read_good(packet);
  EXPECT_EQ(message.id, 2);
  EXPECT_EQ(dynamixel_i32(message.parameters, 1), 2079);
}

// [P2] Reboot: a status without data.
TEST(DynamixelStatus, WithoutDataOfTheManual) {
  std::vector<std::byte> packet = bytes_of("FF FF FD 00 01 04 00 55 00 A1 0C");
  EXPECT_EQ(read_good(packet).parameters.size(), 1u);
}

TEST(DynamixelStatus, NegativeNumbersAreTwosComplements) {
  const std::vector<std::byte> bytes = bytes_of("FE FF FF FF 18 FC");
  EXPECT_EQ(dynamixel_i32(bytes, 0), -2);
  EXPECT_EQ(dynamixel_i16(bytes, 4), -1000);
}

// [P2] Fast Sync Read, the three parts of its example as one packet.
constexpr std::string_view kFastAnswer =
    "FF FF FD 00 FE 19 00 55 00 03 A6 00 00 00 84 08 00 07 1F 08 00 00 16 CA 00 04 FF 03 00 00 "
    "D1 9E";

TEST(DynamixelFastStatus, IsThatOfTheManual) {
  const std::vector<std::byte> packet = bytes_of(kFastAnswer);
  ASSERT_EQ(packet.size(), fast_status_bytes(3, 4));
  std::array<FastPart, 3> parts{};
  ASSERT_EQ(read_fast_status(packet, 4, parts), PacketFault::kNone);
  EXPECT_EQ(parts[0].id, 3);
  EXPECT_EQ(parts[1].id, 7);
  EXPECT_EQ(parts[2].id, 4);
  EXPECT_EQ(dynamixel_i32(parts[0].data, 0), 166);
  EXPECT_EQ(dynamixel_i32(parts[1].data, 0), 2079);
  EXPECT_EQ(dynamixel_i32(parts[2].data, 0), 1023);
}

TEST(DynamixelFastStatus, EachWrongBitIsFound) {
  const std::vector<std::byte> good = bytes_of(kFastAnswer);
  for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
    std::vector<std::byte> packet = good;
    packet[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
    std::array<FastPart, 3> parts{};
    EXPECT_NE(read_fast_status(packet, 4, parts), PacketFault::kNone) << "bit " << bit;
  }
}

TEST(DynamixelFastStatus, OfAnotherLengthOrCountIsRefused) {
  const std::vector<std::byte> packet = bytes_of(kFastAnswer);
  std::array<FastPart, 3> parts{};
  EXPECT_EQ(read_fast_status(packet, 3, parts), PacketFault::kLength);
  EXPECT_EQ(read_fast_status(packet, 4, std::span(parts).first(2)), PacketFault::kLength);
  EXPECT_EQ(read_fast_status(std::span(packet).first(20), 4, parts), PacketFault::kLength);
  EXPECT_EQ(read_fast_status({}, 4, parts), PacketFault::kLength);
}

TEST(DynamixelStatus, EachWrongBitIsFound) {
  const std::vector<std::byte> good = bytes_of("FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE");
  for (std::size_t bit = 0; bit < 8 * good.size(); ++bit) {
    std::vector<std::byte> packet = good;
    packet[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
    DynamixelMessage message;
    EXPECT_NE(read_dynamixel(packet, message), PacketFault::kNone) << "bit " << bit;
  }
}

TEST(DynamixelStatus, WhatIsShortLongOrNoneIsRefused) {
  const std::vector<std::byte> good = bytes_of("FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE");
  for (std::size_t size = 0; size < good.size(); ++size) {
    std::vector<std::byte> packet(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size));
    DynamixelMessage message;
    EXPECT_EQ(read_dynamixel(packet, message), PacketFault::kLength);
  }
  std::vector<std::byte> longer = good;
  longer.push_back(std::byte{0});
  DynamixelMessage message;
  EXPECT_EQ(read_dynamixel(longer, message), PacketFault::kLength);
}

// Of bytes that are often FF and FD, so that many look like headers.
TEST(DynamixelPacket, AnyParametersComeBackAsTheyWere) {
  for (const std::uint64_t seed : test::seeds(200)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    std::vector<std::byte> data(1 + random.below(100));
    for (std::byte& value : data) {
      value = random.chance(0.5)   ? std::byte{0xFF}
              : random.chance(0.5) ? std::byte{0xFD}
                                   : static_cast<std::byte>(random.below(256));
    }
    DynamixelPacket packet(9, Instruction::kWrite);
    const std::span<const std::byte> sent = packet.bytes(data).finish();
    ASSERT_FALSE(sent.empty());
    // no header within, so that a reader that lost its place finds the next packet
    for (std::size_t at = 5; at + 4 <= sent.size() - 2; ++at) {
      const bool is_header = sent[at] == std::byte{0xFF} && sent[at + 1] == std::byte{0xFF} &&
                             sent[at + 2] == std::byte{0xFD} && sent[at + 3] != std::byte{0xFD};
      EXPECT_FALSE(is_header) << at;
    }
    std::vector<std::byte> received(sent.begin(), sent.end());
    const DynamixelMessage message = read_good(received);
    EXPECT_TRUE(
        std::equal(message.parameters.begin(), message.parameters.end(), data.begin(), data.end()));
  }
}

// --- models and time ----------------------------------------------------------------------------

TEST(DynamixelModels, AreSortedAndHaveTheirUnits) {
  EXPECT_TRUE(std::is_sorted(kDynamixelModels.begin(), kDynamixelModels.end(),
                             [](const auto& a, const auto& b) { return a.number < b.number; }));
  EXPECT_EQ(dynamixel_model(1), nullptr);
  // 4.1 N·m at 2.3 A and 12 V
  EXPECT_NEAR(dynamixel_model(1020)->stall_newton_m_per_ampere, 1.783, 1e-3);
  EXPECT_EQ(dynamixel_model(1060)->ampere_per_unit, 0.0);  // XL430: no current control
}

// Seven servos: request 7 + 1 + 4 + 7 + 2 = 21 bytes, answer 8 + 7·21 = 155, goals 7 + 1 + 4 + 7·3
// + 2 = 35; 211 bytes of 10 bits.
TEST(DynamixelCycle, TakesWhatItsBytesTake) {
  EXPECT_NEAR(dynamixel_cycle_s(7, 4'000'000, 0.0), 0.5275e-3, 1e-9);
  EXPECT_NEAR(dynamixel_cycle_s(7, 1'000'000, 0.0), 2.11e-3, 1e-9);
  EXPECT_NEAR(dynamixel_cycle_s(7, 57'600, 0.0005), 36.632e-3 + 0.5e-3, 1e-6);
}

}  // namespace
}  // namespace palpate::device
