// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/falcon/falcon_wire.h"

namespace palpate::device {
namespace {

constexpr unsigned kZero = 0x41;
constexpr std::size_t kFlagAt = 1 + 4 * kFalconLegs;

FalconMessage falcon_message(const FalconCounts& numbers, unsigned flags) noexcept {
  FalconMessage message{};
  message.front() = std::byte{'<'};
  for (std::size_t leg = 0; leg < kFalconLegs; ++leg) {
    const auto bits = static_cast<std::uint16_t>(numbers[leg]);
    for (std::size_t nibble = 0; nibble < 4; ++nibble) {
      message[1 + 4 * leg + nibble] =
          static_cast<std::byte>(kZero + ((bits >> (4 * nibble)) & 15U));
    }
  }
  message[kFlagAt] = static_cast<std::byte>(kZero + flags);
  message[kFlagAt + 1] = std::byte{kZero};
  message.back() = std::byte{'>'};
  return message;
}

bool read_falcon_message(std::span<const std::byte, kFalconMessageBytes> bytes,
                         FalconCounts& numbers, unsigned largest_flag, unsigned& flags) noexcept {
  if (bytes.front() != std::byte{'<'} || bytes.back() != std::byte{'>'}) return false;
  for (std::size_t leg = 0; leg < kFalconLegs; ++leg) {
    unsigned bits = 0;
    for (std::size_t nibble = 0; nibble < 4; ++nibble) {
      // wraps below the first character: refused, too
      const unsigned value = std::to_integer<unsigned>(bytes[1 + 4 * leg + nibble]) - kZero;
      if (value > 15U) return false;
      bits |= value << (4 * nibble);
    }
    numbers[leg] = static_cast<std::int16_t>(static_cast<std::uint16_t>(bits));
  }
  flags = std::to_integer<unsigned>(bytes[kFlagAt]) - kZero;
  return flags <= largest_flag;
}

}  // namespace

FalconMessage falcon_command(const FalconCounts& motors, std::uint8_t flags) noexcept {
  return falcon_message(motors, flags);
}

FalconMessage falcon_answer(const FalconReading& reading) noexcept {
  return falcon_message(reading.encoders, (reading.buttons & 15U) | ((reading.homed & 7U) << 4U));
}

bool read_falcon_answer(std::span<const std::byte, kFalconMessageBytes> bytes,
                        FalconReading& reading) noexcept {
  unsigned flags = 0;
  if (!read_falcon_message(bytes, reading.encoders, 0x7F, flags)) return false;
  reading.buttons = static_cast<std::uint8_t>(flags & 15U);
  reading.homed = static_cast<std::uint8_t>(flags >> 4U);
  return true;
}

bool read_falcon_command(std::span<const std::byte, kFalconMessageBytes> bytes,
                         FalconCounts& motors, std::uint8_t& flags) noexcept {
  unsigned all = 0;
  if (!read_falcon_message(bytes, motors, 0x0F, all)) return false;
  flags = static_cast<std::uint8_t>(all);
  return true;
}

}  // namespace palpate::device
