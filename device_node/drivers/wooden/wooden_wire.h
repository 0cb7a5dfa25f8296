// SPDX-License-Identifier: Apache-2.0
// wooden_wire.h — the HID reports of the open firmware of WoodenHaptics and Polhem boards:
// little-endian int16.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "device_node/drivers/transport/packet_port.h"

namespace palpate::device {

inline constexpr UsbIds kWoodenIds{.vendor = 0x16c0, .product = 0x0486};
inline constexpr std::size_t kWoodenReportBytes = 64;
inline constexpr std::size_t kWoodenAxes = 3;
using WoodenCounts = std::array<std::int16_t, kWoodenAxes>;

/// Host → device: report id 0, currents a, b, c, command, three attributes, zeros to the end.
struct WoodenCommand {
  WoodenCounts currents_ma{};
  /// 1: sets the counters a, b, c to the attributes; no currents.
  std::int16_t command = 0;
  WoodenCounts attributes{};
};
inline constexpr std::int16_t kWoodenSetCounters = 1;
using WoodenCommandBytes = std::array<std::byte, 1 + kWoodenReportBytes>;
[[nodiscard]] WoodenCommandBytes wooden_command(const WoodenCommand& command) noexcept;
/// The same for the emulator.
/// @return  false for another length or report id
[[nodiscard]] bool read_wooden_command(std::span<const std::byte> bytes,
                                       WoodenCommand& command) noexcept;

/// Device → host: counters a … f, info, zeros to the end.
struct WoodenReading {
  std::array<std::int16_t, 6> encoders{};  ///< d carries the button: + 10000 while it is held
  /// 1 once the board's button was pressed, until the counters are set.
  std::int16_t info = 0;
};
using WoodenReportBytes = std::array<std::byte, kWoodenReportBytes>;
[[nodiscard]] WoodenReportBytes wooden_report(const WoodenReading& reading) noexcept;
/// @return  false for another length, or an info that the firmware does not send
[[nodiscard]] bool read_wooden_report(std::span<const std::byte> bytes,
                                      WoodenReading& reading) noexcept;

[[nodiscard]] constexpr bool is_wooden_button_held(const WoodenReading& reading) noexcept {
  return reading.encoders[3] > 5000;
}

}  // namespace palpate::device
