// SPDX-License-Identifier: Apache-2.0
// Arbitrary bytes as packets of Dynamixel's Protocol 2.0: one that is accepted says what it would
// be sent as; one answer of several servos is accepted whole or not at all; an emulated servo takes
// any address and any data.
//
// The input is one byte, how many servos were asked, and then the packet.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/core/check.h"
#include "device_node/drivers/dynamixel/dynamixel_packet.h"
#include "device_node/emulators/dynamixel_servo.h"

namespace {

using namespace palpate::device;

void check_message(const std::vector<std::byte>& input) {
  std::vector<std::byte> packet = input;
  DynamixelMessage message;
  if (read_dynamixel(packet, message) != PacketFault::kNone) return;
  PALPATE_REQUIRE(message.parameters.size() + 10 <= input.size());
  // a sender may leave stuffing out where it must not, but nothing else may differ
  DynamixelPacket again(message.id, message.instruction);
  const std::span<const std::byte> sent = again.bytes(message.parameters).finish();
  if (sent.size() == input.size()) {
    PALPATE_REQUIRE(std::equal(sent.begin(), sent.end(), input.begin()));
  }
  if (message.parameters.size() < 3) return;
  EmulatedServo servo(ServoSettings{});
  const unsigned address = dynamixel_u16(message.parameters, 0);
  static_cast<void>(servo.write(address, message.parameters.subspan(2)));
  std::array<std::byte, 17> data{};
  static_cast<void>(servo.read(address, data));
  servo.advance(0.002, 50e-6, 0.1);
}

void check_answer(std::size_t servos, const std::vector<std::byte>& packet) {
  constexpr std::size_t kDataBytes = 17;
  std::vector<FastPart> parts(servos);
  if (read_fast_status(packet, kDataBytes, parts) != PacketFault::kNone) return;
  PALPATE_REQUIRE(packet.size() == fast_status_bytes(servos, kDataBytes));
  for (const FastPart& part : parts) PALPATE_REQUIRE(part.data.size() == kDataBytes);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto* bytes = reinterpret_cast<const std::byte*>(data);
  const std::vector<std::byte> packet(bytes + 1, bytes + size);
  check_message(packet);
  check_answer(1 + data[0] % 8, packet);
  if (packet.size() >= kDynamixelHeaderBytes) {
    const std::size_t whole =
        dynamixel_packet_bytes(std::span(packet).first<kDynamixelHeaderBytes>());
    PALPATE_REQUIRE(whole <= kMostDynamixelBytes);
  }
  return 0;
}
