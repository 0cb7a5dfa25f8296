// SPDX-License-Identifier: Apache-2.0
#include "device_node/emulators/damiao_motor.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

namespace palpate::device {
namespace {

constexpr double kShaftTurnRad = 2.0 * std::numbers::pi;
constexpr double kControlS = 0.0001;
constexpr double kTimeoutUnitS = 50e-6;

constexpr unsigned kStateOff = 0x0;
constexpr unsigned kStateOn = 0x1;
constexpr unsigned kFirstError = 0x8;
constexpr unsigned kLostCommunication = 0xD;

constexpr std::uint8_t kTimeoutRegister = 9;
constexpr std::uint8_t kModeRegister = 10;
constexpr std::uint8_t kLastVolatile = 81;

unsigned at(const CanFrame& frame, std::size_t i) noexcept {
  return std::to_integer<unsigned>(frame.data[i]);
}

/// A number of so many bits as one between −most and most.
double scaled(unsigned number, unsigned bits, double most) noexcept {
  return most * (2.0 * number / ((1U << bits) - 1U) - 1.0);
}

/// The other way, cut off and rounded down as its firmware does.
unsigned number_of(double value, unsigned bits, double most) noexcept {
  const double steps = (1U << bits) - 1U;
  return static_cast<unsigned>(std::clamp(0.5 * (value / most + 1.0) * steps, 0.0, steps));
}

}  // namespace

EmulatedDamiaoMotor::EmulatedDamiaoMotor(const DamiaoMotorSettings& settings)
    : settings_(settings), plant_(settings.joint) {
  registers_[7] = settings.feedback_id;
  registers_[8] = settings.id;
  registers_[kModeRegister] = 1;
  registers_[14] = 5015;
  registers_[21] = std::bit_cast<std::uint32_t>(settings.position_range_rad);
  registers_[22] = std::bit_cast<std::uint32_t>(settings.velocity_range_rad_per_s);
  registers_[23] = std::bit_cast<std::uint32_t>(settings.torque_range_newton_m);
  cycle(0.0);
}

// --- frames -------------------------------------------------------------------------------------

CanFrame EmulatedDamiaoMotor::answer(const std::array<unsigned, 8>& bytes) const noexcept {
  CanFrame frame{.id = settings_.feedback_id, .size = 8};
  for (std::size_t i = 0; i < 8; ++i) frame.data[i] = static_cast<std::byte>(bytes[i] & 0xFFU);
  return frame;
}

CanFrame EmulatedDamiaoMotor::feedback() const noexcept {
  const unsigned p = number_of(said_rad_, 16, settings_.position_range_rad);
  const unsigned v = number_of(said_rad_per_s_, 12, settings_.velocity_range_rad_per_s);
  const unsigned t = number_of(said_newton_m_, 12, settings_.torque_range_newton_m);
  return answer({state_ << 4U | (settings_.id & 0xFU), p >> 8U, p, v >> 4U,
                 (v & 0xFU) << 4U | t >> 8U, t, 31, 29});
}

std::optional<CanFrame> EmulatedDamiaoMotor::hear(const CanFrame& frame, double now_s) noexcept {
  constexpr std::uint32_t kOfRegisters = 0x7FF;
  if (!is_there || frame.size != 8) return std::nullopt;
  if (frame.id == kOfRegisters) {
    if ((at(frame, 0) | at(frame, 1) << 8U) != settings_.id) return std::nullopt;
    heard_at_s_ = now_s;
    return hear_of_registers(frame);
  }
  if (frame.id != settings_.id) return std::nullopt;
  heard_at_s_ = now_s;
  const bool is_command = std::all_of(frame.data.begin(), frame.data.begin() + 7,
                                      [](std::byte value) { return value == std::byte{0xFF}; });
  const unsigned last = at(frame, 7);
  if (is_command && last >= 0xFB && last <= 0xFE) {
    if (last == 0xFB && state_ >= kFirstError) state_ = kStateOff;
    if (last == 0xFC && state_ == kStateOff) state_ = kStateOn;
    if (last == 0xFD && state_ == kStateOn) state_ = kStateOff;
    if (last == 0xFE && state_ == kStateOff) {
      settings_.zero_rad = -plant_.link_rad();
      turns_ = 0;
    }
  } else if (registers_[kModeRegister] == 1) {
    control(frame);
  }
  cycle(now_s);
  return feedback();
}

void EmulatedDamiaoMotor::control(const CanFrame& frame) noexcept {
  goal_rad_ = scaled(at(frame, 0) << 8U | at(frame, 1), 16, settings_.position_range_rad);
  goal_rad_per_s_ =
      scaled(at(frame, 2) << 4U | at(frame, 3) >> 4U, 12, settings_.velocity_range_rad_per_s);
  stiffness_ = 500.0 * ((at(frame, 3) & 0xFU) << 8U | at(frame, 4)) / 4095.0;
  damping_ = 5.0 * (at(frame, 5) << 4U | at(frame, 6) >> 4U) / 4095.0;
  goal_newton_m_ =
      scaled((at(frame, 6) & 0xFU) << 8U | at(frame, 7), 12, settings_.torque_range_newton_m);
}

std::optional<CanFrame> EmulatedDamiaoMotor::hear_of_registers(const CanFrame& frame) noexcept {
  const unsigned kind = at(frame, 2);
  const auto which = static_cast<std::uint8_t>(at(frame, 3));
  if (kind == 0xCC) return feedback();
  if (which > kLastVolatile || (kind != 0x33 && kind != 0x55)) return std::nullopt;
  std::uint32_t value = registers_[which];
  if (kind == 0x55) {
    const std::uint32_t wanted =
        at(frame, 4) | at(frame, 5) << 8U | at(frame, 6) << 16U | at(frame, 7) << 24U;
    const bool is_taken = which == kTimeoutRegister || (which == kModeRegister && wanted >= 1 &&
                                                        wanted <= 4 && state_ == kStateOff);
    if (is_taken) value = wanted;
    if (keeps_registers) registers_[which] = value;
  }
  return answer({settings_.id, settings_.id >> 8U, kind, which, value, value >> 8U, value >> 16U,
                 value >> 24U});
}

// --- life ---------------------------------------------------------------------------------------

void EmulatedDamiaoMotor::power_cycle() noexcept {
  registers_[kTimeoutRegister] = 0;
  registers_[kModeRegister] = 1;
  state_ = kStateOff;
  stiffness_ = damping_ = goal_newton_m_ = torque_newton_m_ = 0.0;
  turns_ = 0;  // an encoder of one turn
}

void EmulatedDamiaoMotor::protect(unsigned state) noexcept { state_ = state; }

double EmulatedDamiaoMotor::shaft_rad() const noexcept {
  return plant_.link_rad() + settings_.zero_rad + turns_ * kShaftTurnRad;
}

void EmulatedDamiaoMotor::advance(double now_s, double step_s, double hand_newton_m) noexcept {
  if (now_s >= next_cycle_s_) cycle(now_s);
  plant_.advance(step_s, torque_newton_m_, hand_newton_m);
}

void EmulatedDamiaoMotor::cycle(double now_s) noexcept {
  next_cycle_s_ =
      (std::floor((now_s - settings_.cycle_phase_s) / kControlS + 1e-9) + 1.0) * kControlS +
      settings_.cycle_phase_s;
  const double timeout_s = kTimeoutUnitS * registers_[kTimeoutRegister];
  if (has_timeout && state_ == kStateOn && timeout_s > 0.0 && now_s - heard_at_s_ > timeout_s) {
    state_ = kLostCommunication;
  }
  double told = 0.0;
  if (is_there && state_ == kStateOn) {
    told = stiffness_ * (goal_rad_ - shaft_rad()) +
           damping_ * (goal_rad_per_s_ - plant_.link_rad_per_s()) + goal_newton_m_;
    const double most = settings_.torque_range_newton_m;
    told = std::clamp(told, -most, most);
    was_unguarded = was_unguarded || (registers_[kTimeoutRegister] == 0 &&
                                      std::abs(told) > 0.51 * 2.0 * most / 4095.0);
  }
  torque_newton_m_ = gain * settings_.torque_ratio * told;
  if (is_stuck) return;
  said_rad_ = shaft_rad();
  said_rad_per_s_ = plant_.link_rad_per_s();
  said_newton_m_ = gain == 0.0 ? 0.0 : told;  // a motor without supply has no current
}

}  // namespace palpate::device
