// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/damiao/damiao_frame.h"

#include <algorithm>
#include <array>

namespace palpate::device {
namespace {

constexpr unsigned kReadRegister = 0x33;
constexpr unsigned kWriteRegister = 0x55;
constexpr unsigned kRefresh = 0xCC;

CanFrame frame_of(std::uint32_t id, const std::array<unsigned, 8>& bytes) noexcept {
  CanFrame frame{.id = id, .size = 8};
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    frame.data[i] = static_cast<std::byte>(bytes[i] & 0xFFU);
  }
  return frame;
}

unsigned byte_of(const CanFrame& frame, std::size_t i) noexcept {
  return std::to_integer<unsigned>(frame.data[i]);
}

}  // namespace

unsigned damiao_code(double value, double lowest, double highest, unsigned bits) noexcept {
  const double share = (std::clamp(value, lowest, highest) - lowest) / (highest - lowest);
  return static_cast<unsigned>(share * static_cast<double>((1U << bits) - 1U));
}

double damiao_value(unsigned code, double lowest, double highest, unsigned bits) noexcept {
  return lowest + code * (highest - lowest) / static_cast<double>((1U << bits) - 1U);
}

DamiaoCodes damiao_codes(const DamiaoControl& control, const DamiaoRange& range) noexcept {
  const auto within = [](double value, double most, unsigned bits) {
    return damiao_code(value, -most, most, bits);
  };
  return {
      .position = within(control.position_rad, range.position_rad, 16),
      .velocity = within(control.velocity_rad_per_s, range.velocity_rad_per_s, 12),
      .stiffness = damiao_code(control.stiffness_newton_m_per_rad, 0.0, damiao::kMostStiffness, 12),
      .damping = damiao_code(control.damping_newton_m_s_per_rad, 0.0, damiao::kMostDamping, 12),
      .torque = within(control.torque_newton_m, range.torque_newton_m, 12)};
}

CanFrame damiao_command(unsigned id, DamiaoCommand command) noexcept {
  return frame_of(id, {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, static_cast<unsigned>(command)});
}

CanFrame damiao_control(unsigned id, const DamiaoCodes& codes) noexcept {
  return frame_of(
      id, {codes.position >> 8U, codes.position, codes.velocity >> 4U,
           (codes.velocity & 0xFU) << 4U | codes.stiffness >> 8U, codes.stiffness,
           codes.damping >> 4U, (codes.damping & 0xFU) << 4U | codes.torque >> 8U, codes.torque});
}

CanFrame damiao_refresh(unsigned id) noexcept {
  return frame_of(damiao::kEveryone, {id, id >> 8U, kRefresh, 0, 0, 0, 0, 0});
}

CanFrame damiao_read_register(unsigned id, std::uint8_t which) noexcept {
  return frame_of(damiao::kEveryone, {id, id >> 8U, kReadRegister, which, 0, 0, 0, 0});
}

CanFrame damiao_write_register(unsigned id, std::uint8_t which, std::uint32_t value) noexcept {
  return frame_of(damiao::kEveryone, {id, id >> 8U, kWriteRegister, which, value, value >> 8U,
                                      value >> 16U, value >> 24U});
}

bool read_damiao_feedback(const CanFrame& frame, unsigned id, DamiaoFeedback& feedback) noexcept {
  if (frame.size != 8 || (byte_of(frame, 0) & 0xFU) != (id & 0xFU)) return false;
  feedback = {.state = byte_of(frame, 0) >> 4U,
              .position = byte_of(frame, 1) << 8U | byte_of(frame, 2),
              .velocity = byte_of(frame, 3) << 4U | byte_of(frame, 4) >> 4U,
              .torque = (byte_of(frame, 4) & 0xFU) << 8U | byte_of(frame, 5),
              .board_celsius = static_cast<int>(byte_of(frame, 6)),
              .rotor_celsius = static_cast<int>(byte_of(frame, 7))};
  for (std::size_t i = 0; i < 8; ++i) feedback.bits = feedback.bits << 8U | byte_of(frame, i);
  return true;
}

bool read_damiao_register(const CanFrame& frame, unsigned id, std::uint8_t which,
                          std::uint32_t& value) noexcept {
  const unsigned kind = byte_of(frame, 2);
  if (frame.size != 8 || byte_of(frame, 0) != (id & 0xFFU) || byte_of(frame, 1) != id >> 8U ||
      (kind != kReadRegister && kind != kWriteRegister) || byte_of(frame, 3) != which) {
    return false;
  }
  value = byte_of(frame, 4) | byte_of(frame, 5) << 8U | byte_of(frame, 6) << 16U |
          byte_of(frame, 7) << 24U;
  return true;
}

}  // namespace palpate::device
