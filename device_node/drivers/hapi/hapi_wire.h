// SPDX-License-Identifier: Apache-2.0
// hapi_wire.h — the messages of Haply's hAPI boards (serial): bytes and little-endian float32,
// without frame or check sum.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate::device {

inline constexpr std::size_t kHapiMotors = 2;

/// The board's set-up for a pantograph: motors and encoders on two ports.
struct HapiBoard {
  std::uint8_t device_id = 5;
  std::array<std::uint8_t, kHapiMotors> motor_ports{1, 2};  ///< 1 … 4, different
  std::array<std::uint8_t, kHapiMotors> motor_directions{0, 1};
  std::array<std::uint8_t, kHapiMotors> encoder_ports{1, 2};
  std::array<std::uint8_t, kHapiMotors> encoder_directions{0, 1};
  std::array<float, kHapiMotors> encoder_offsets_deg{180.0F, 0.0F};
  std::array<float, kHapiMotors> encoder_resolutions{13824.0F, 13824.0F};  ///< counts a turn
};

/// Type 1: `[1][id]`, for motors and encoders `[mask of ports][direction a port]`, no sensors, no
/// PWM, then `offset, resolution` an encoder.
inline constexpr std::size_t kHapiSetUpBytes = 2 + 2 * (1 + kHapiMotors) + 2 + 8 * kHapiMotors;
[[nodiscard]] std::array<std::byte, kHapiSetUpBytes> hapi_set_up(const HapiBoard& board) noexcept;

/// Type 2: `[2][id]` and the torque of each motor [N·m]; the board answers with a reading.
inline constexpr std::size_t kHapiTorqueBytes = 2 + 4 * kHapiMotors;
[[nodiscard]] std::array<std::byte, kHapiTorqueBytes> hapi_torques(
    std::uint8_t device_id, const std::array<float, kHapiMotors>& torques_newton_m) noexcept;

/// `[id]` and the angle of each encoder, degrees.
inline constexpr std::size_t kHapiReadingBytes = 1 + 4 * kHapiMotors;
/// @return  false for another id or angles that no encoder gives (not finite, beyond ±10 turns)
[[nodiscard]] bool read_hapi_angles(std::span<const std::byte, kHapiReadingBytes> bytes,
                                    std::uint8_t device_id,
                                    std::array<float, kHapiMotors>& angles_deg) noexcept;

}  // namespace palpate::device
