// SPDX-License-Identifier: Apache-2.0
#include "device_node/emulators/dynamixel_servo.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::device {
namespace {

constexpr double kTurnRad = 2.0 * std::numbers::pi;
constexpr double kCycleS = 0.001;
constexpr unsigned kIndirectAddresses = 168;
constexpr unsigned kIndirectCount = 20;

// of a status
constexpr std::uint8_t kRangeError = 0x04;
constexpr std::uint8_t kLengthError = 0x05;
constexpr std::uint8_t kLimitError = 0x06;
constexpr std::uint8_t kAccessError = 0x07;

constexpr std::uint8_t kFired = 0xFF;

}  // namespace

EmulatedServo::EmulatedServo(const ServoSettings& settings)
    : settings_(settings), plant_(settings.joint) {
  set(0, 2, settings.model);
  set(6, 1, settings.firmware);
  set(7, 1, settings.id);
  set(11, 1, 0);
  set(38, 2, settings.current_limit);
  reboot();
  cycle(0.0);
}

unsigned EmulatedServo::u16(unsigned address) const noexcept {
  return table_[address] | static_cast<unsigned>(table_[address + 1]) << 8U;
}

void EmulatedServo::set(unsigned address, unsigned bytes, std::uint32_t value) noexcept {
  for (unsigned i = 0; i < bytes; ++i) {
    table_[address + i] = static_cast<std::uint8_t>(value >> (8U * i) & 0xFFU);
  }
}

void EmulatedServo::reboot() noexcept {
  std::fill(table_.begin() + 64, table_.end(), std::uint8_t{0});
  set(68, 1, 2);
  for (unsigned i = 0; i < kIndirectCount; ++i) {
    set(kIndirectAddresses + 2 * i, 2, settings_.indirect_data + i);
  }
  torque_newton_m_ = 0.0;
  turns_ = 0;  // an encoder of one turn
}

void EmulatedServo::protect(std::uint8_t hardware_error) noexcept {
  set(70, 1, hardware_error);
  set(64, 1, 0);
}

unsigned EmulatedServo::target_of(unsigned address) const noexcept {
  const unsigned first = settings_.indirect_data;
  if (address < first || address >= first + kIndirectCount) return address;
  const unsigned target = u16(kIndirectAddresses + 2 * (address - first));
  return target < table_.size() ? target : address;
}

std::uint8_t EmulatedServo::read(unsigned address, std::span<std::byte> data) noexcept {
  if (address + data.size() > table_.size()) return kAccessError;
  for (std::size_t i = 0; i < data.size(); ++i) {
    data[i] = static_cast<std::byte>(table_[target_of(address + static_cast<unsigned>(i))]);
  }
  return 0;
}

std::uint8_t EmulatedServo::write(unsigned address, std::span<const std::byte> data) noexcept {
  if (address + data.size() > table_.size() || address < 9) return kAccessError;
  if (address < 64 && table_[64] != 0) return kAccessError;  // the EEPROM is locked
  if (address >= kIndirectAddresses && address < kIndirectAddresses + 2 * kIndirectCount) {
    for (std::size_t i = 0; i + 1 < data.size(); i += 2) {
      const unsigned target =
          std::to_integer<unsigned>(data[i]) | std::to_integer<unsigned>(data[i + 1]) << 8U;
      if (target < 64 || target > 227) return kRangeError;
    }
    for (std::size_t i = 0; i < data.size(); ++i) {
      table_[address + i] = std::to_integer<std::uint8_t>(data[i]);
    }
    return 0;
  }
  return write_entry(address, data);
}

std::uint8_t EmulatedServo::write_entry(unsigned address,
                                        std::span<const std::byte> data) noexcept {
  const unsigned first = std::to_integer<unsigned>(data[0]);
  switch (address) {
    case 9:   // return delay
    case 10:  // drive mode
    case 11:  // operating mode
      if (data.size() != 1) return kLengthError;
      break;
    case 64:  // torque
      if (data.size() != 1) return kLengthError;
      if (first > 1) return kRangeError;
      if (has_alert() && first == 1) return kAccessError;
      was_unguarded = was_unguarded || (first == 1 && table_[98] == 0);
      if (first != table_[64]) turns_ = 0;  // the position is that within a turn again
      break;
    case 68:  // status return level
      if (data.size() != 1) return kLengthError;
      break;
    case 98:  // watchdog
      if (data.size() != 1) return kLengthError;
      if (first > 127) return kRangeError;
      break;
    case 102: {  // goal current
      if (data.size() != 2) return kLengthError;
      if (table_[98] == kFired) return kRangeError;
      const auto goal = static_cast<std::int16_t>(first | std::to_integer<unsigned>(data[1]) << 8U);
      if (static_cast<unsigned>(std::abs(goal)) > u16(38)) return kLimitError;
      break;
    }
    default:
      return kAccessError;
  }
  for (std::size_t i = 0; i < data.size(); ++i) {
    table_[address + i] = std::to_integer<std::uint8_t>(data[i]);
  }
  return 0;
}

void EmulatedServo::advance(double now_s, double step_s, double hand_newton_m) noexcept {
  if (now_s >= next_cycle_s_) cycle(now_s);
  plant_.advance(step_s, torque_newton_m_, hand_newton_m);
}

void EmulatedServo::cycle(double now_s) noexcept {
  next_cycle_s_ = (std::floor((now_s - settings_.tick_phase_s) / kCycleS + 1e-9) + 1.0) * kCycleS +
                  settings_.tick_phase_s;
  const unsigned units = table_[98];
  const bool is_watching = has_watchdog && table_[64] != 0 && units > 0 && units != kFired;
  if (is_watching && now_s - heard_at_s_ > 0.020 * units) {
    set(98, 1, kFired);
    set(102, 2, 0);
  }
  const auto goal = static_cast<std::int16_t>(u16(102));
  const bool has_torque = is_there && table_[64] != 0 && table_[11] == 0;
  const double units_made = has_torque ? goal : 0.0;
  torque_newton_m_ = gain * units_made * settings_.ampere_per_unit * settings_.newton_m_per_ampere;
  if (is_stuck) return;
  const double turns = (plant_.link_rad() + settings_.zero_rad) / kTurnRad + turns_;
  set(120, 2, static_cast<std::uint32_t>(std::floor(1000.0 * now_s + 0.5)) & 0x7FFFU);
  // a motor without supply has no current
  set(126, 2,
      static_cast<std::uint32_t>(static_cast<std::int32_t>(gain == 0.0 ? 0.0 : units_made)));
  set(128, 4,
      static_cast<std::uint32_t>(static_cast<std::int32_t>(
          std::lround(plant_.link_rad_per_s() / kTurnRad * 60.0 / 0.229))));
  set(132, 4, static_cast<std::uint32_t>(static_cast<std::int32_t>(std::lround(4096.0 * turns))));
}

}  // namespace palpate::device
