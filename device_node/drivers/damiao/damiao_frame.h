// SPDX-License-Identifier: Apache-2.0
// damiao_frame.h — what Damiao's motors are told and say on a CAN bus, byte by byte: commands,
// control in the MIT mode, feedback, registers.
#pragma once

#include <cstdint>

#include "device_node/drivers/transport/can_port.h"

namespace palpate::device {

/// Frames to one motor: seven bytes FF, then this.
enum class DamiaoCommand : std::uint8_t {
  kClearError = 0xFB,
  kEnable = 0xFC,
  kDisable = 0xFD,
  kZero = 0xFE,  ///< where it stands is 0 from now on
};

namespace damiao {
/// Of frames about registers, to whichever motor they name.
inline constexpr std::uint32_t kEveryone = 0x7FF;
inline constexpr unsigned kMostId = 15;  ///< feedback has four bits of it

// registers
inline constexpr std::uint8_t kTimeout = 9;       // in units of 50 µs, 0: none
inline constexpr std::uint8_t kControlMode = 10;  // 1: MIT
inline constexpr std::uint8_t kSoftware = 14;
inline constexpr std::uint8_t kPositionRange = 21;  // float, rad
inline constexpr std::uint8_t kVelocityRange = 22;  // float, rad/s
inline constexpr std::uint8_t kTorqueRange = 23;    // float, N·m
inline constexpr std::uint32_t kMitMode = 1;

// state of feedback
inline constexpr unsigned kOff = 0x0;
inline constexpr unsigned kOn = 0x1;
inline constexpr unsigned kCommunicationLost = 0xD;

inline constexpr double kMostStiffness = 500.0;  ///< N·m/rad, of a frame
inline constexpr double kMostDamping = 5.0;      ///< N·m·s/rad, of a frame
inline constexpr unsigned kMostTorqueCode = 0xFFF;
}  // namespace damiao

/// Values on the wire are between −range and range.
struct DamiaoRange {
  double position_rad = 0.0;
  double velocity_rad_per_s = 0.0;
  double torque_newton_m = 0.0;
};

/// τ = stiffness·(position − p) + damping·(velocity − ṗ) + torque, at the shaft.
struct DamiaoControl {
  double position_rad = 0.0;
  double velocity_rad_per_s = 0.0;
  double stiffness_newton_m_per_rad = 0.0;  ///< ≥ 0
  double damping_newton_m_s_per_rad = 0.0;  ///< ≥ 0
  double torque_newton_m = 0.0;
};

/// The numbers of a control frame, 16, 12, 12, 12 and 12 bits.
struct DamiaoCodes {
  unsigned position = 0x7FFF;
  unsigned velocity = 0x7FF;
  unsigned stiffness = 0;
  unsigned damping = 0;
  unsigned torque = 0x7FF;
};

/// −range … range as 0 … 2^bits − 1, cut off and rounded down.
[[nodiscard]] unsigned damiao_code(double value, double lowest, double highest,
                                   unsigned bits) noexcept;
[[nodiscard]] double damiao_value(unsigned code, double lowest, double highest,
                                  unsigned bits) noexcept;
[[nodiscard]] DamiaoCodes damiao_codes(const DamiaoControl& control,
                                       const DamiaoRange& range) noexcept;

// to a motor; classic unless is_fd is set
[[nodiscard]] CanFrame damiao_command(unsigned id, DamiaoCommand command) noexcept;
[[nodiscard]] CanFrame damiao_control(unsigned id, const DamiaoCodes& codes) noexcept;
/// Asks for feedback without a command.
[[nodiscard]] CanFrame damiao_refresh(unsigned id) noexcept;
[[nodiscard]] CanFrame damiao_read_register(unsigned id, std::uint8_t which) noexcept;
[[nodiscard]] CanFrame damiao_write_register(unsigned id, std::uint8_t which,
                                             std::uint32_t value) noexcept;

/// What a motor says of itself, to every frame but those of registers.
struct DamiaoFeedback {
  unsigned state = 0;     ///< 0 off, 1 on, 8 … 14 an error
  unsigned position = 0;  ///< codes of DamiaoRange
  unsigned velocity = 0;
  unsigned torque = 0;
  int board_celsius = 0;
  int rotor_celsius = 0;
  std::uint64_t bits = 0;  ///< all of it
};

/// @return  false: no feedback of this motor
[[nodiscard]] bool read_damiao_feedback(const CanFrame& frame, unsigned id,
                                        DamiaoFeedback& feedback) noexcept;
/// The answer to a read or a write of this register.
/// @return  false: none of this motor and register
[[nodiscard]] bool read_damiao_register(const CanFrame& frame, unsigned id, std::uint8_t which,
                                        std::uint32_t& value) noexcept;

}  // namespace palpate::device
