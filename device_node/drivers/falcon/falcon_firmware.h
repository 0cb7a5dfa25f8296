// SPDX-License-Identifier: Apache-2.0
// falcon_firmware.h — the Falcon's boot loader: it takes the firmware's image byte by byte and
// echoes each.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "device_node/drivers/falcon/ftdi_line.h"

namespace palpate::device {

inline constexpr std::uint16_t kFalconBootDivisor = 0x4138;  ///< 9600 baud
inline constexpr std::uint16_t kFalconLoadDivisor = 0x15;    ///< 140 kbaud
inline constexpr std::uint16_t kFalconRunDivisor = 0x02;     ///< 1.5 Mbaud
inline constexpr std::array<std::byte, 3> kFalconGreeting{std::byte{0x0A}, std::byte{0x43},
                                                          std::byte{0x0D}};
inline constexpr std::array<std::byte, 5> kFalconWelcome{
    std::byte{0x00}, std::byte{0x0A}, std::byte{0x44}, std::byte{0x2C}, std::byte{0x0D}};

/// @throws std::runtime_error  it cannot be read, is empty, or larger than any image of a Falcon
[[nodiscard]] std::vector<std::byte> read_falcon_image(const std::string& file);

/// Sends the image once; the Falcon runs it afterwards.
/// @throws std::runtime_error  the boot loader does not answer, or echoes something else
void load_falcon_firmware(FtdiLine& line, std::span<const std::byte> image);

/// Sets the line up for messages to the running firmware.
/// @throws std::runtime_error  the chip refuses
void set_falcon_running(FtdiLine& line);

}  // namespace palpate::device
