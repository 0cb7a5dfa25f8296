// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/dynamixel/dynamixel_arm.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>

#include "common/core/check.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr double kTurnRad = 2.0 * std::numbers::pi;
/// After which a servo that has got torque says in which turn it is now; shorter than a watchdog.
constexpr Duration kSettling = 5ms;
/// A servo's clock counts ms; a status that is older than this is none of now.
constexpr Duration kStaleAfter = 8ms;
/// A goal that does not arrive so many times in a row is no accident of the line.
constexpr unsigned kMostLostGoals = 3;

double seconds_between(TimePoint from, TimePoint to) { return to_seconds(to - from); }

const char* text_of(LeaderFault fault) {
  switch (fault) {
    case LeaderFault::kNone:
      return "";
    case LeaderFault::kClosed:
      return "the serial port is gone: is the adapter still plugged in?";
    case LeaderFault::kNoAnswer:
      return "does not answer: is its cable loose, or its supply gone?";
    case LeaderFault::kCorrupt:
      return "what comes is no answer: noise on the line, two servos with one id, or another "
             "program on the same port";
    case LeaderFault::kServoError:
      return "refuses what it is told, or loses it";
    case LeaderFault::kHardwareError:
      return "reports a hardware error";
    case LeaderFault::kWrongMode:
      return "is not in current control";
    case LeaderFault::kTorqueOff:
      return "has no torque, and nobody here has switched it off: another program, or its own "
             "shutdown";
    case LeaderFault::kRebooted:
      return "has forgotten its watchdog: it has rebooted";
    case LeaderFault::kWatchdogFired:
      return "its watchdog has ended the torque: no instruction came for the time that it was set";
    case LeaderFault::kStale:
      return "repeats a status: its clock stands still";
    case LeaderFault::kWrapped:
      return "its angle is off by whole turns: it has rebooted or was switched off and on";
    case LeaderFault::kJumped:
      return "its angle changed faster than twice fastest_rad_per_s";
    case LeaderFault::kOutOfRange:
      return "its angle is beyond lowest_rad … highest_rad: is the offset right?";
  }
  return "";
}

}  // namespace

DynamixelArm::DynamixelArm(std::span<const DynamixelJoint> joints,
                           const DynamixelSettings& settings, Clock& clock)
    : count_(joints.size()), settings_(settings), clock_(clock), bus_([&]() -> DynamixelBus {
        if (count_ == 0 || count_ > kMostLeaderJoints) {
          throw SetupError("leader: it has 1 … 8 joints, not " + std::to_string(count_));
        }
        std::copy(joints.begin(), joints.end(), joints_.begin());
        check_joints();
        for (std::size_t i = 0; i < count_; ++i) ids_[i] = static_cast<std::uint8_t>(joints_[i].id);
        try {
          return DynamixelBus(settings.port, settings.bits_per_second,
                              from_seconds(settings.answer_limit_s));
        } catch (const std::runtime_error& error) {
          throw SetupError("leader: " + std::string(error.what()));
        }
      }()) {
  set_up();
}

// --- life ---------------------------------------------------------------------------------------

bool DynamixelArm::enable() noexcept {
  if (fault_ != LeaderFault::kNone) return false;
  if (is_enabled_) return true;
  for (std::size_t i = 0; i < count_; ++i) {
    servos_[i].written = 0;
    // the lease of the motors, before they have any
    const std::array goal{std::byte{0}, std::byte{0}};
    const std::array units{static_cast<std::byte>(settings_.watchdog_units)};
    for (const auto& [address, data] :
         {std::pair<unsigned, std::span<const std::byte>>{dynamixel::kGoalCurrent, goal},
          {dynamixel::kBusWatchdog, units}}) {
      std::uint8_t error = 0;
      Transfer transfer = bus_.write(ids_[i], address, data, error);
      if (transfer == Transfer::kTimeout || transfer == Transfer::kCorrupt) {
        transfer = bus_.write(ids_[i], address, data, error);
      }
      if (transfer != Transfer::kDone) return fail_transfer(transfer);
      if ((error & ~kDynamixelAlert) != 0) {
        fault_detail_ = error;
        return fail(LeaderFault::kServoError, i);
      }
    }
  }
  if (!write_all(dynamixel::kTorqueEnable, 1)) return fail(LeaderFault::kClosed, count_);
  is_enabled_ = true;
  is_known_ = false;
  lost_goals_ = 0;
  const TimePoint before = read_at_;
  for (int times = 0; times < 2; ++times) {
    switched_at_ = read_at_ = clock_.now();
    Transfer transfer = read_blocks();
    if (transfer == Transfer::kTimeout || transfer == Transfer::kCorrupt) transfer = read_blocks();
    if (transfer != Transfer::kDone) return fail_transfer(transfer);
    // the first answer says that they have heard it
    if (times == 0) clock_.sleep_until(clock_.now() + kSettling);
  }
  // servos that get torque may forget in which turn they were
  LeaderReading passed;
  return take_blocks(Turns::kFind, seconds_between(before, clock_.now()), passed);
}

void DynamixelArm::let_go() noexcept {
  for (std::size_t i = 0; i < count_; ++i) servos_[i].written = 0;
  is_enabled_ = false;
  // no servo answers to these; a second time costs a millisecond
  for (int times = 0; times < 2; ++times) {
    static_cast<void>(send_currents());
    static_cast<void>(write_all(dynamixel::kTorqueEnable, 0));
  }
}

void DynamixelArm::release() noexcept {
  if (!is_set_up_) return;
  let_go();
  if (fault_ != LeaderFault::kNone) return;
  for (int times = 0; times < 2 && read_blocks() == Transfer::kDone; ++times) {
    bool has_torque = false;
    for (std::size_t i = 0; i < count_; ++i) has_torque |= block_of(i).torque_enable != 0;
    if (!has_torque) return;
    let_go();
  }
}

bool DynamixelArm::fail(LeaderFault fault, std::size_t joint) noexcept {
  if (fault_ != LeaderFault::kNone) return false;
  fault_ = fault;
  fault_joint_ = joint;
  let_go();
  return false;
}

bool DynamixelArm::fail_transfer(Transfer transfer) noexcept {
  if (transfer == Transfer::kClosed) return fail(LeaderFault::kClosed, count_);
  const bool is_silent = transfer == Transfer::kTimeout;
  fail(is_silent ? LeaderFault::kNoAnswer : LeaderFault::kCorrupt, count_);
  // which one: the first that is silent when it is asked alone
  for (std::size_t i = 0; i < count_; ++i) {
    DynamixelPing passed;
    const Transfer answer = bus_.ping(ids_[i], passed);
    if (answer == Transfer::kClosed) break;
    if (answer == Transfer::kDone) continue;
    fault_joint_ = i;
    if (answer == Transfer::kTimeout) fault_ = LeaderFault::kNoAnswer;
    break;
  }
  return false;
}

std::string DynamixelArm::fault_text() const {
  if (fault_ == LeaderFault::kNone) return {};
  std::string text = fault_joint_ < count_ ? name_of(fault_joint_) : "line " + settings_.port;
  text += ": ";
  text += text_of(fault_);
  if (fault_ == LeaderFault::kServoError && fault_detail_ != 0) {
    text += " (error " + std::to_string(fault_detail_) + ")";
  }
  if (fault_ == LeaderFault::kHardwareError) {
    text += ":";
    constexpr std::array<std::pair<unsigned, const char*>, 5> kCauses{
        {{0x01, "supply voltage"},
         {0x04, "overheated"},
         {0x08, "encoder"},
         {0x10, "electric shock or circuit"},
         {0x20, "overload"}}};
    for (const auto& [bit, cause] : kCauses) {
      if ((fault_detail_ & bit) != 0) text += std::string(" ") + cause + ",";
    }
    text += " remove the cause, then reboot it";
  }
  return text;
}

// --- cycle --------------------------------------------------------------------------------------

Transfer DynamixelArm::read_blocks() noexcept {
  return bus_.sync_read(is_fast_, block_address_, kDynamixelBlock.size(),
                        std::span(ids_).first(count_), std::span(answers_).first(count_));
}

DynamixelBlock DynamixelArm::block_of(std::size_t joint) const noexcept {
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

bool DynamixelArm::read(LeaderReading& reading) noexcept {
  if (fault_ != LeaderFault::kNone) return false;
  const TimePoint before = read_at_;
  TimePoint now = clock_.now();
  if (is_enabled_ && now - switched_at_ > from_seconds(settings_.longest_cycle_s)) {
    // nobody knows for how long what was written has acted
    for (std::size_t i = 0; i < count_; ++i) servos_[i].written = 0;
    is_known_ = false;
    if (!send_currents()) return fail(LeaderFault::kClosed, count_);
  }
  read_at_ = now;
  Transfer transfer = read_blocks();
  if (transfer == Transfer::kTimeout || transfer == Transfer::kCorrupt) {
    ++repeated_;
    read_at_ = clock_.now();
    transfer = read_blocks();
  }
  if (transfer != Transfer::kDone) return fail_transfer(transfer);
  now = clock_.now();
  if (!take_blocks(Turns::kKeep, seconds_between(before, now), reading)) return false;
  reading.elapsed_s = seconds_between(switched_at_, now) + settings_.longest_delay_s;
  reading.is_known = is_known_;
  reading.repeated = repeated_;
  return true;
}

bool DynamixelArm::take_blocks(Turns turns, double elapsed_s, LeaderReading& reading) noexcept {
  bool is_goal_lost = false;
  for (std::size_t i = 0; i < count_; ++i) {
    Servo& servo = servos_[i];
    const DynamixelBlock block = block_of(i);
    const LeaderFault state = state_fault(i, block);
    if (state != LeaderFault::kNone) return fail(state, i);
    const LeaderFault placed = place(i, block.position, turns, elapsed_s);
    if (placed != LeaderFault::kNone) return fail(placed, i);
    is_goal_lost = is_goal_lost || (is_enabled_ && block.goal_current != servo.written);
    if (is_goal_lost && lost_goals_ + 1 >= kMostLostGoals) return fail(LeaderFault::kServoError, i);

    reading.position_rad[i] = servo.position_rad;
    reading.velocity_rad_per_s[i] = block.velocity * dynamixel::kTurnsPerMinute / 60.0 *
                                    dynamixel::kStepsPerTurn * servo.rad_per_step;
    reading.current_ampere[i] = joints_[i].sign * block.current * servo.model->ampere_per_unit;
  }
  lost_goals_ = is_goal_lost ? lost_goals_ + 1 : 0;
  is_known_ = is_known_ && !is_goal_lost;
  return true;
}

LeaderFault DynamixelArm::state_fault(std::size_t joint, const DynamixelBlock& block) noexcept {
  Servo& servo = servos_[joint];
  const std::uint8_t error = answers_[joint].error;
  if ((error & kDynamixelAlert) != 0 || block.hardware_error != 0) {
    fault_detail_ = block.hardware_error;
    return LeaderFault::kHardwareError;
  }
  if (error != 0) {
    fault_detail_ = error;
    return LeaderFault::kServoError;
  }
  if (is_enabled_) {
    if (block.bus_watchdog == dynamixel::kWatchdogFired) return LeaderFault::kWatchdogFired;
    if (block.bus_watchdog != settings_.watchdog_units) return LeaderFault::kRebooted;
    if (block.torque_enable == 0) return LeaderFault::kTorqueOff;
  } else if (block.torque_enable != 0) {
    return LeaderFault::kServoError;  // nobody here has switched it on
  }
  const TimePoint now = clock_.now();
  if (!has_read_[joint] || block.tick_ms != servo.tick_ms) {
    has_read_[joint] = true;
    servo.tick_ms = block.tick_ms;
    servo.tick_changed_at = now;
  } else if (now - servo.tick_changed_at >= kStaleAfter) {
    return LeaderFault::kStale;
  }
  return LeaderFault::kNone;
}

LeaderFault DynamixelArm::place(std::size_t joint, std::int32_t steps, Turns turns,
                                double elapsed_s) noexcept {
  const DynamixelJoint& config = joints_[joint];
  Servo& servo = servos_[joint];
  const double turn_rad = kTurnRad / config.gear;
  const double raw_rad = servo.rad_per_step * steps + config.offset_rad;
  if (turns == Turns::kFind) {
    servo.turns_rad = turn_rad * std::ceil((config.lowest_rad - raw_rad) / turn_rad);
  }
  const double position_rad = raw_rad + servo.turns_rad;
  if (turns == Turns::kKeep) {
    const double moved_rad = std::abs(position_rad - servo.position_rad);
    const double most_rad =
        2.0 * config.fastest_rad_per_s * elapsed_s + 2.0 * std::abs(servo.rad_per_step);
    if (moved_rad > most_rad) {
      const double whole = std::round(moved_rad / turn_rad);
      const bool is_turn = whole >= 1.0 && std::abs(moved_rad - whole * turn_rad) <= most_rad;
      return is_turn ? LeaderFault::kWrapped : LeaderFault::kJumped;
    }
  }
  if (!(position_rad >= config.lowest_rad && position_rad <= config.highest_rad)) {
    return LeaderFault::kOutOfRange;
  }
  servo.position_rad = position_rad;
  return LeaderFault::kNone;
}

bool DynamixelArm::write(const LeaderValues& torque_newton_m,
                         LeaderValues& made_newton_m) noexcept {
  made_newton_m = {};
  if (fault_ != LeaderFault::kNone) return false;
  const TimePoint begin = clock_.now();
  if (!is_enabled_) {
    switched_at_ = begin;
    is_known_ = true;  // that none acts
    return true;
  }
  for (std::size_t i = 0; i < count_; ++i) {
    Servo& servo = servos_[i];
    const double wanted = torque_newton_m[i] / servo.newton_m_per_unit;
    const double most = servo.current_limit;
    const double units = std::isfinite(wanted) ? std::trunc(std::clamp(wanted, -most, most)) : 0.0;
    servo.written = static_cast<std::int16_t>(joints_[i].sign * units);
    made_newton_m[i] = units * servo.newton_m_per_unit;
  }
  if (!send_currents()) {
    made_newton_m = {};
    return fail(LeaderFault::kClosed, count_);
  }
  const double line_s =
      10.0 * static_cast<double>(14 + 3 * count_) / static_cast<double>(settings_.bits_per_second);
  is_known_ = seconds_between(read_at_, clock_.now()) + line_s + kLeaderServoDelayS <=
              settings_.longest_delay_s;
  switched_at_ = begin;
  return true;
}

bool DynamixelArm::send_currents() noexcept {
  std::array<std::byte, 2 * kMostLeaderJoints> goals{};
  for (std::size_t i = 0; i < count_; ++i) {
    const auto goal = static_cast<std::uint16_t>(servos_[i].written);
    goals[2 * i] = static_cast<std::byte>(goal & 0xFFU);
    goals[2 * i + 1] = static_cast<std::byte>(goal >> 8U);
  }
  return bus_.sync_write(dynamixel::kGoalCurrent, 2, std::span(ids_).first(count_),
                         std::span(goals).first(2 * count_)) == Transfer::kDone;
}

bool DynamixelArm::write_all(unsigned address, unsigned value) noexcept {
  std::array<std::byte, kMostLeaderJoints> values{};
  values.fill(static_cast<std::byte>(value));
  return bus_.sync_write(address, 1, std::span(ids_).first(count_),
                         std::span(values).first(count_)) == Transfer::kDone;
}

// --- what the clamp is told ---------------------------------------------------------------------

double DynamixelArm::lease_s() const noexcept {
  return settings_.longest_cycle_s + settings_.longest_delay_s +
         (settings_.watchdog_units + 1) * dynamixel::kWatchdogUnitS;
}

double DynamixelArm::resolution_rad(std::size_t joint) const noexcept {
  return std::abs(servos_[joint].rad_per_step) + joints_[joint].play_rad +
         2.0 * joints_[joint].fastest_rad_per_s * settings_.longest_delay_s;
}

double DynamixelArm::largest_torque_newton_m(std::size_t joint) const noexcept {
  return servos_[joint].current_limit * servos_[joint].newton_m_per_unit;
}

}  // namespace palpate::device
