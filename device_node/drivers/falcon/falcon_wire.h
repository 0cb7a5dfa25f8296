// SPDX-License-Identifier: Apache-2.0
// falcon_wire.h — the messages of the Falcon's running firmware: 16 characters each way. Numbers
// are 4 nibbles, the least significant first, each + 0x41.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "device_node/drivers/transport/packet_port.h"

namespace palpate::device {

inline constexpr UsbIds kFalconIds{.vendor = 0x0403, .product = 0xcb48};
inline constexpr std::size_t kFalconLegs = 3;
inline constexpr std::size_t kFalconMessageBytes = 16;
using FalconMessage = std::array<std::byte, kFalconMessageBytes>;
using FalconCounts = std::array<std::int16_t, kFalconLegs>;

// Flags to the device.
inline constexpr std::uint8_t kFalconHoming = 0x01;
inline constexpr std::uint8_t kFalconGreen = 0x02;
inline constexpr std::uint8_t kFalconBlue = 0x04;
inline constexpr std::uint8_t kFalconRed = 0x08;

/// What the device reports.
struct FalconReading {
  FalconCounts encoders{};
  std::uint8_t buttons = 0;  ///< 4 bits
  std::uint8_t homed = 0;    ///< bit i: the encoder of leg i has passed its index
};
inline constexpr std::uint8_t kFalconAllHomed = 0b111;

/// `<`, motors, flags, a character of no known meaning, `>`.
[[nodiscard]] FalconMessage falcon_command(const FalconCounts& motors, std::uint8_t flags) noexcept;
/// What a device answers.
[[nodiscard]] FalconMessage falcon_answer(const FalconReading& reading) noexcept;

/// @return  false for what is not framed or has a character out of range
[[nodiscard]] bool read_falcon_answer(std::span<const std::byte, kFalconMessageBytes> bytes,
                                      FalconReading& reading) noexcept;
/// The same of a command, for the emulator.
[[nodiscard]] bool read_falcon_command(std::span<const std::byte, kFalconMessageBytes> bytes,
                                       FalconCounts& motors, std::uint8_t& flags) noexcept;

}  // namespace palpate::device
