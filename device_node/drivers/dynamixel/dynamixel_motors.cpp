// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/dynamixel/dynamixel_motors.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <utility>

#include "common/core/check.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

/// A servo's clock counts ms; a status that is older than this is none of now.
constexpr Duration kStaleAfter = 8ms;
/// What enable() waits beyond the watchdog and its doubt.
constexpr Duration kTrialMargin = 5ms;

bool is_bad_answer(Transfer transfer) {
  return transfer == Transfer::kTimeout || transfer == Transfer::kCorrupt;
}

bool is_good(const MotorOutcome& outcome) {
  return outcome.transfer == Transfer::kDone && outcome.fault == LeaderFault::kNone;
}

}  // namespace

DynamixelMotors::DynamixelMotors(std::span<const DynamixelJoint> joints,
                                 const DynamixelSettings& settings, Clock& clock)
    : count_(joints.size()), settings_(settings), clock_(clock), bus_([&]() -> DynamixelBus {
        std::copy(joints.begin(), joints.end(), joints_.begin());
        check_currents();
        for (std::size_t i = 0; i < count_; ++i) ids_[i] = static_cast<std::uint8_t>(joints_[i].id);
        try {
          return DynamixelBus(settings.port, settings.bits_per_second,
                              from_seconds(settings.answer_limit_s));
        } catch (const std::runtime_error& error) {
          throw SetupError("leader: " + std::string(error.what()));
        }
      }()) {}

// --- life ---------------------------------------------------------------------------------------

MotorOutcome DynamixelMotors::set_entry(std::size_t joint, unsigned address,
                                        std::span<const std::byte> data) noexcept {
  std::uint8_t error = 0;
  Transfer transfer = bus_.write(ids_[joint], address, data, error);
  if (is_bad_answer(transfer)) transfer = bus_.write(ids_[joint], address, data, error);
  if (transfer != Transfer::kDone) return {.transfer = transfer, .joint = joint};
  if ((error & ~kDynamixelAlert) == 0) return {};
  fault_detail_ = error;
  return {.fault = LeaderFault::kServoError, .joint = joint};
}

/// The lease of the motors, with none requested. 0 ends one that has fired, which refuses a goal.
MotorOutcome DynamixelMotors::set_watchdogs() noexcept {
  const std::array none{std::byte{0}};
  const std::array goal{std::byte{0}, std::byte{0}};
  const std::array units{static_cast<std::byte>(settings_.watchdog_units)};
  for (std::size_t i = 0; i < count_; ++i) {
    servos_[i].written = 0;
    for (const auto& [address, data] :
         {std::pair<unsigned, std::span<const std::byte>>{dynamixel::kBusWatchdog, none},
          {dynamixel::kGoalCurrent, goal},
          {dynamixel::kBusWatchdog, units}}) {
      if (const MotorOutcome set = set_entry(i, address, data); !is_good(set)) return set;
    }
  }
  return {};
}

/// A register that holds a number is no promise: each servo is left alone for its watchdog, with
/// torque on and none requested, and must say that it has fired.
MotorOutcome DynamixelMotors::try_watchdogs() noexcept {
  for (int times = 0; times < 2; ++times) {
    // the first answer says that they have heard all that was sent
    if (times == 1) {
      clock_.sleep_until(clock_.now() + from_seconds(watchdog_s()) + kTrialMargin);
    }
    Transfer transfer = read();
    if (is_bad_answer(transfer)) transfer = read();
    if (transfer != Transfer::kDone) return {.transfer = transfer, .joint = count_};
  }
  for (std::size_t i = 0; i < count_; ++i) {
    if (block_of(i).bus_watchdog == dynamixel::kWatchdogFired) continue;
    // one that has rebooted, or protects itself, is named by the first read()
    const DynamixelBlock block = block_of(i);
    if (block.torque_enable == 0 || block.hardware_error != 0) continue;
    return {.fault = LeaderFault::kNoWatchdog, .joint = i};
  }
  return {};
}

MotorOutcome DynamixelMotors::enable() noexcept {
  // the watchdogs before any torque
  if (const MotorOutcome set = set_watchdogs(); !is_good(set)) return set;
  Transfer switched = write_all(dynamixel::kTorqueEnable, 1);
  if (switched != Transfer::kDone) return {.transfer = switched, .joint = count_};
  if (const MotorOutcome tried = try_watchdogs(); !is_good(tried)) return tried;
  switched = write_all(dynamixel::kTorqueEnable, 0);
  if (switched != Transfer::kDone) return {.transfer = switched, .joint = count_};
  if (const MotorOutcome set = set_watchdogs(); !is_good(set)) return set;
  return {.transfer = write_all(dynamixel::kTorqueEnable, 1), .joint = count_};
}

void DynamixelMotors::let_go() noexcept {
  for (std::size_t i = 0; i < count_; ++i) servos_[i].written = 0;
  // no servo answers to these; a second time costs a millisecond
  for (int times = 0; times < 2; ++times) {
    static_cast<void>(send_currents());
    static_cast<void>(write_all(dynamixel::kTorqueEnable, 0));
  }
}

MotorOutcome DynamixelMotors::find_silent() noexcept {
  for (std::size_t i = 0; i < count_; ++i) {
    DynamixelPing passed;
    const Transfer answer = bus_.ping(ids_[i], passed);
    if (answer == Transfer::kClosed) break;
    if (answer == Transfer::kDone) continue;
    return {.fault = answer == Transfer::kTimeout ? LeaderFault::kNoAnswer : LeaderFault::kCorrupt,
            .joint = i};
  }
  return {};
}

std::string DynamixelMotors::detail_text(LeaderFault fault) const {
  if (fault == LeaderFault::kServoError && fault_detail_ != 0) {
    return " (error " + std::to_string(fault_detail_) + ")";
  }
  if (fault != LeaderFault::kHardwareError) return {};
  std::string text = ":";
  constexpr std::array<std::pair<unsigned, const char*>, 5> kCauses{
      {{0x01, "supply voltage"},
       {0x04, "overheated"},
       {0x08, "encoder"},
       {0x10, "electric shock or circuit"},
       {0x20, "overload"}}};
  for (const auto& [bit, cause] : kCauses) {
    if ((fault_detail_ & bit) != 0) text += std::string(" ") + cause + ",";
  }
  return text + " remove the cause, then reboot it";
}

// --- cycle --------------------------------------------------------------------------------------

Transfer DynamixelMotors::read() noexcept {
  return bus_.sync_read(is_fast_, block_address_, kDynamixelBlock.size(),
                        std::span(ids_).first(count_), std::span(answers_).first(count_));
}

DynamixelBlock DynamixelMotors::block_of(std::size_t joint) const noexcept {
  const std::span<const std::byte> data = answers_[joint].data;
  return {.torque_enable = std::to_integer<std::uint8_t>(data[0]),
          .hardware_error = std::to_integer<std::uint8_t>(data[1]),
          .bus_watchdog = std::to_integer<std::uint8_t>(data[2]),
          .goal_current = static_cast<std::int16_t>(dynamixel_i16(data, 3)),
          .tick_ms = static_cast<std::uint16_t>(dynamixel_u16(data, 5)),
          .current = static_cast<std::int16_t>(dynamixel_i16(data, 7)),
          .velocity = dynamixel_i32(data, 9),
          .position = dynamixel_i32(data, 13)};
}

MotorState DynamixelMotors::state(std::size_t joint) const noexcept {
  const Servo& servo = servos_[joint];
  const DynamixelBlock block = block_of(joint);
  constexpr double kTurnRad = 2.0 * std::numbers::pi;
  return {.position_rad = block.position * step_rad(),
          .velocity_rad_per_s = block.velocity * dynamixel::kTurnsPerMinute / 60.0 * kTurnRad,
          .torque_newton_m = block.current * servo.newton_m_per_unit,
          .has_torque = block.torque_enable != 0,
          .has_command = block.goal_current == servo.written};
}

LeaderFault DynamixelMotors::check(std::size_t joint, bool is_enabled, TimePoint now) noexcept {
  Servo& servo = servos_[joint];
  const DynamixelBlock block = block_of(joint);
  const std::uint8_t error = answers_[joint].error;
  if ((error & kDynamixelAlert) != 0 || block.hardware_error != 0) {
    fault_detail_ = block.hardware_error;
    return LeaderFault::kHardwareError;
  }
  if (error != 0) {
    fault_detail_ = error;
    return LeaderFault::kServoError;
  }
  if (is_enabled) {
    if (block.bus_watchdog == dynamixel::kWatchdogFired) return LeaderFault::kWatchdogFired;
    if (block.bus_watchdog != settings_.watchdog_units) return LeaderFault::kRebooted;
    if (block.torque_enable == 0) return LeaderFault::kTorqueOff;
  }
  if (!servo.has_read || block.tick_ms != servo.tick_ms) {
    servo.has_read = true;
    servo.tick_ms = block.tick_ms;
    servo.tick_changed_at = now;
  } else if (now - servo.tick_changed_at >= kStaleAfter) {
    return LeaderFault::kStale;
  }
  return LeaderFault::kNone;
}

Transfer DynamixelMotors::write(std::span<const int> units) noexcept {
  for (std::size_t i = 0; i < count_; ++i) {
    servos_[i].written = static_cast<std::int16_t>(units[i]);
  }
  return send_currents();
}

Transfer DynamixelMotors::send_currents() noexcept {
  std::array<std::byte, 2 * kMostLeaderJoints> goals{};
  for (std::size_t i = 0; i < count_; ++i) {
    const auto goal = static_cast<std::uint16_t>(servos_[i].written);
    goals[2 * i] = static_cast<std::byte>(goal & 0xFFU);
    goals[2 * i + 1] = static_cast<std::byte>(goal >> 8U);
  }
  return bus_.sync_write(dynamixel::kGoalCurrent, 2, std::span(ids_).first(count_),
                         std::span(goals).first(2 * count_));
}

Transfer DynamixelMotors::write_all(unsigned address, unsigned value) noexcept {
  std::array<std::byte, kMostLeaderJoints> values{};
  values.fill(static_cast<std::byte>(value));
  return bus_.sync_write(address, 1, std::span(ids_).first(count_),
                         std::span(values).first(count_));
}

// --- values -------------------------------------------------------------------------------------

MotorCommand DynamixelMotors::command(std::size_t joint, double newton_m) const noexcept {
  const Servo& servo = servos_[joint];
  const double most = servo.current_limit;
  const double units = std::trunc(std::clamp(newton_m / servo.newton_m_per_unit, -most, most));
  return {.units = static_cast<int>(units), .newton_m = units * servo.newton_m_per_unit};
}

double DynamixelMotors::largest_newton_m(std::size_t joint) const noexcept {
  return servos_[joint].current_limit * servos_[joint].newton_m_per_unit;
}

double DynamixelMotors::step_rad() const noexcept {
  return 2.0 * std::numbers::pi / dynamixel::kStepsPerTurn;
}

double DynamixelMotors::delay_s() const noexcept {
  const double line_s =
      10.0 * static_cast<double>(14 + 3 * count_) / static_cast<double>(settings_.bits_per_second);
  return line_s + kDynamixelDelayS;
}

double DynamixelMotors::watchdog_s() const noexcept {
  // one unit more, as nobody says when within a unit it counts
  return (settings_.watchdog_units + 1) * dynamixel::kWatchdogUnitS;
}

}  // namespace palpate::device
