// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/leader/leader_arm.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <set>

#include "common/core/check.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr double kTurnRad = 2.0 * std::numbers::pi;
/// After which a motor that has got torque says in which turn it is now; shorter than a watchdog.
constexpr Duration kSettling = 5ms;
/// A pause of so many watchdogs has ended the torque, if there is one: of less than that some may
/// have passed before the last bytes had left the computer.
constexpr double kSurelyFired = 2.0;
constexpr double kMostRadPerS = 100.0;
constexpr double kMostPlayRad = 0.5;
/// A command that does not arrive so many times in a row is no accident of the line.
constexpr unsigned kMostLostCommands = 3;

double seconds_between(TimePoint from, TimePoint to) { return to_seconds(to - from); }

bool is_positive(double value) { return std::isfinite(value) && value > 0.0; }

/// Worth a second request.
bool is_bad_answer(Transfer transfer) {
  return transfer == Transfer::kTimeout || transfer == Transfer::kCorrupt;
}

const char* text_of(LeaderFault fault) {
  switch (fault) {
    case LeaderFault::kNone:
      return "";
    case LeaderFault::kClosed:
      return "the port is gone: is the adapter still plugged in?";
    case LeaderFault::kNoAnswer:
      return "does not answer: is its cable loose, or its supply gone?";
    case LeaderFault::kCorrupt:
      return "what comes is no answer: noise on the line, two motors with one id, or another "
             "program on the same port";
    case LeaderFault::kServoError:
      return "refuses what it is told, or loses it";
    case LeaderFault::kHardwareError:
      return "reports a hardware error";
    case LeaderFault::kTorqueOff:
      return "has no torque, and nobody here has switched it off: another program, or its own "
             "shutdown";
    case LeaderFault::kRebooted:
      return "has forgotten its watchdog: it has rebooted";
    case LeaderFault::kWatchdogFired:
      return "its watchdog has ended the torque: no instruction came for the time that it was set. "
             "Make a new arm; if it happens again, give the loop real-time priority or the "
             "watchdog more time";
    case LeaderFault::kNoWatchdog:
      return "does not keep its watchdog: nothing would end a torque. Update its firmware, or "
             "replace it";
    case LeaderFault::kStale:
      return "repeats a status: its clock stands still";
    case LeaderFault::kWrapped:
      return "its angle is off by whole turns: it has rebooted or was switched off and on";
    case LeaderFault::kJumped:
      return "its angle changed faster than twice fastest_rad_per_s";
    case LeaderFault::kOutOfRange:
      return "its angle is beyond lowest_rad … highest_rad: is the offset right?";
    case LeaderFault::kBusDown:
      return "the interface is down or off the bus: bring it up again with ip link";
    case LeaderFault::kBusFull:
      return "what is sent does not leave: are the motors supplied and connected, the bit rates "
             "theirs, and the bus terminated?";
  }
  return "";
}

}  // namespace

// --- checks -------------------------------------------------------------------------------------

std::string leader_joint_name(std::size_t joint, int id) {
  return "joint " + std::to_string(joint + 1) + " (id " + std::to_string(id) + ")";
}

std::string leader_number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%g", value);
  return text.data();
}

void check_leader(std::span<const LeaderJoint> joints, const LeaderSettings& settings, int least_id,
                  int most_id) {
  if (joints.empty() || joints.size() > kMostLeaderJoints) {
    throw SetupError("leader: it has 1 … 8 joints, not " + std::to_string(joints.size()));
  }
  std::set<int> ids;
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const LeaderJoint& joint = joints[i];
    const auto refuse = [&](const std::string& what) {
      throw SetupError("leader " + leader_joint_name(i, joint.id) + ": " + what);
    };
    if (joint.id < least_id || joint.id > most_id) {
      refuse("an id is " + std::to_string(least_id) + " … " + std::to_string(most_id));
    }
    if (!ids.insert(joint.id).second) refuse("another joint has this id; give each its own");
    if (joint.sign != 1.0 && joint.sign != -1.0) refuse("sign is 1 or -1");
    if (!is_positive(joint.gear)) refuse("gear must be above 0");
    const double most_rad = std::max(kTurnRad, kTurnRad / joint.gear);
    const auto check_angle = [&](const char* name, double rad) {
      if (std::abs(rad) <= most_rad) return;
      refuse(std::string(name) + " = " + leader_number(rad) + ": must be within ±" +
             leader_number(most_rad) + " rad, one turn; is it in degrees?");
    };
    check_angle("offset_rad", joint.offset_rad);
    check_angle("lowest_rad", joint.lowest_rad);
    check_angle("highest_rad", joint.highest_rad);
    if (!is_positive(joint.fastest_rad_per_s) || joint.fastest_rad_per_s > kMostRadPerS) {
      refuse("fastest_rad_per_s = " + leader_number(joint.fastest_rad_per_s) +
             ": must be above 0, at most " + leader_number(kMostRadPerS) + "; is it in degrees?");
    }
    if (!(joint.play_rad >= 0.0 && joint.play_rad <= kMostPlayRad)) {
      refuse("play_rad = " + leader_number(joint.play_rad) + ": must be 0 … " +
             leader_number(kMostPlayRad) + " rad; is it in degrees?");
    }
    const double range_rad = joint.highest_rad - joint.lowest_rad;
    if (!is_positive(range_rad) || range_rad >= kTurnRad / joint.gear) {
      refuse(
          "the range lowest_rad … highest_rad must be above 0 and below one turn of the shaft, " +
          leader_number(kTurnRad / joint.gear) +
          " rad of the joint: which turn an angle belongs to follows from it");
    }
  }
  if (!is_positive(settings.answer_limit_s) || settings.answer_limit_s > 1.0 ||
      !is_positive(settings.longest_delay_s) || settings.longest_delay_s > 1.0 ||
      !is_positive(settings.longest_cycle_s) || settings.longest_cycle_s > 1.0) {
    throw SetupError(
        "leader: answer_limit_s, longest_delay_s and longest_cycle_s are above 0, at most 1");
  }
}

// --- life ---------------------------------------------------------------------------------------

LeaderArm::LeaderArm(std::span<const LeaderJoint> joints, const LeaderSettings& settings,
                     std::unique_ptr<LeaderBus> bus, Clock& clock)
    : count_(joints.size()), settings_(settings), bus_(std::move(bus)), clock_(clock) {
  std::copy(joints.begin(), joints.end(), joints_.begin());
  bus_->set_up();
  switched_at_ = read_at_ = clock_.now();
  const Transfer transfer = bus_->read();
  if (transfer != Transfer::kDone) fail_transfer(transfer);
  LeaderReading passed;
  if (fault_ == LeaderFault::kNone) static_cast<void>(take_states(Turns::kFind, 0.0, passed));
  if (fault_ != LeaderFault::kNone) throw SetupError("leader " + fault_text());
}

bool LeaderArm::enable() noexcept {
  if (fault_ != LeaderFault::kNone) return false;
  if (is_enabled_) return true;
  written_.fill(0);
  const MotorOutcome outcome = bus_->enable();
  if (outcome.transfer != Transfer::kDone) return fail_transfer(outcome.transfer);
  if (outcome.fault != LeaderFault::kNone) return fail(outcome.fault, outcome.joint);
  is_enabled_ = true;
  is_known_ = false;
  lost_commands_ = 0;
  const TimePoint before = read_at_;
  for (int times = 0; times < 2; ++times) {
    switched_at_ = read_at_ = clock_.now();
    Transfer transfer = bus_->read();
    if (is_bad_answer(transfer)) transfer = bus_->read();
    if (transfer != Transfer::kDone) return fail_transfer(transfer);
    spoken_at_ = clock_.now();
    // the first answer says that they have heard it
    if (times == 0) clock_.sleep_until(clock_.now() + kSettling);
  }
  // motors that get torque may forget in which turn they were
  LeaderReading passed;
  return take_states(Turns::kFind, seconds_between(before, clock_.now()), passed);
}

void LeaderArm::let_go() noexcept {
  written_.fill(0);
  is_enabled_ = false;
  bus_->let_go();
}

void LeaderArm::release() noexcept {
  let_go();
  if (fault_ != LeaderFault::kNone) return;
  for (int times = 0; times < 2 && bus_->read() == Transfer::kDone; ++times) {
    bool has_torque = false;
    for (std::size_t i = 0; i < count_; ++i) has_torque |= bus_->state(i).has_torque;
    if (!has_torque) return;
    let_go();
  }
}

bool LeaderArm::fail(LeaderFault fault, std::size_t joint) noexcept {
  if (fault_ != LeaderFault::kNone) return false;
  fault_ = fault;
  fault_joint_ = joint;
  let_go();
  return false;
}

bool LeaderArm::fail_transfer(Transfer transfer) noexcept {
  switch (transfer) {
    case Transfer::kClosed:
      return fail(LeaderFault::kClosed, count_);
    case Transfer::kDown:
      return fail(LeaderFault::kBusDown, count_);
    case Transfer::kFull:
      return fail(LeaderFault::kBusFull, count_);
    default:
      break;
  }
  fail(transfer == Transfer::kTimeout ? LeaderFault::kNoAnswer : LeaderFault::kCorrupt, count_);
  const MotorOutcome silent = bus_->find_silent();
  if (silent.fault != LeaderFault::kNone) {
    fault_joint_ = silent.joint;
    if (silent.fault == LeaderFault::kNoAnswer) fault_ = LeaderFault::kNoAnswer;
  }
  return false;
}

std::string LeaderArm::fault_text() const {
  if (fault_ == LeaderFault::kNone) return {};
  std::string text = fault_joint_ < count_
                         ? leader_joint_name(fault_joint_, joints_[fault_joint_].id)
                         : "line " + settings_.port;
  if (fault_ == LeaderFault::kNoWatchdog && fault_joint_ == count_) {
    text += ", no motor has ended its torque in a pause";
  }
  text += ": ";
  text += text_of(fault_);
  return text + bus_->detail_text(fault_);
}

// --- cycle --------------------------------------------------------------------------------------

bool LeaderArm::read(LeaderReading& reading) noexcept {
  if (fault_ != LeaderFault::kNone) return false;
  const TimePoint before = read_at_;
  TimePoint now = clock_.now();
  const bool has_surely_fired =
      is_enabled_ && seconds_between(spoken_at_, now) > kSurelyFired * bus_->watchdog_s();
  if (is_enabled_ && now - switched_at_ > from_seconds(settings_.longest_cycle_s)) {
    // nobody knows for how long what was written has acted
    for (std::size_t i = 0; i < count_; ++i) written_[i] = bus_->command(i, 0.0).units;
    is_known_ = false;
    if (!send()) return false;
  }
  read_at_ = now;
  Transfer transfer = bus_->read();
  if (is_bad_answer(transfer)) {
    ++repeated_;
    read_at_ = clock_.now();
    transfer = bus_->read();
  }
  if (transfer != Transfer::kDone) return fail_transfer(transfer);
  now = clock_.now();
  spoken_at_ = now;
  if (!take_states(Turns::kKeep, seconds_between(before, now), reading)) return false;
  if (has_surely_fired) return fail(LeaderFault::kNoWatchdog, count_);
  reading.elapsed_s = seconds_between(switched_at_, now) + settings_.longest_delay_s;
  reading.is_known = is_known_;
  reading.repeated = repeated_;
  return true;
}

bool LeaderArm::take_states(Turns turns, double elapsed_s, LeaderReading& reading) noexcept {
  bool is_command_lost = false;
  for (std::size_t i = 0; i < count_; ++i) {
    const LeaderFault said = bus_->check(i, is_enabled_, clock_.now());
    if (said != LeaderFault::kNone) return fail(said, i);
    const MotorState state = bus_->state(i);
    // nobody here has switched it on
    if (!is_enabled_ && state.has_torque) return fail(LeaderFault::kServoError, i);
    const LeaderFault placed = place(i, state.position_rad, turns, elapsed_s);
    if (placed != LeaderFault::kNone) return fail(placed, i);
    is_command_lost = is_command_lost || (is_enabled_ && !state.has_command);
    if (is_command_lost && lost_commands_ + 1 >= kMostLostCommands) {
      return fail(LeaderFault::kServoError, i);
    }
    const LeaderJoint& joint = joints_[i];
    reading.position_rad[i] = position_rad_[i];
    reading.velocity_rad_per_s[i] = joint.sign * state.velocity_rad_per_s / joint.gear;
    reading.torque_newton_m[i] = joint.sign * state.torque_newton_m * joint.gear;
  }
  lost_commands_ = is_command_lost ? lost_commands_ + 1 : 0;
  is_known_ = is_known_ && !is_command_lost;
  return true;
}

LeaderFault LeaderArm::place(std::size_t joint, double shaft_rad, Turns turns,
                             double elapsed_s) noexcept {
  const LeaderJoint& config = joints_[joint];
  const double turn_rad = kTurnRad / config.gear;
  const double raw_rad = config.sign * shaft_rad / config.gear + config.offset_rad;
  if (turns == Turns::kFind) {
    turns_rad_[joint] = turn_rad * std::ceil((config.lowest_rad - raw_rad) / turn_rad);
  }
  const double position_rad = raw_rad + turns_rad_[joint];
  if (turns == Turns::kKeep) {
    const double moved_rad = std::abs(position_rad - position_rad_[joint]);
    const double most_rad =
        2.0 * config.fastest_rad_per_s * elapsed_s + 2.0 * bus_->step_rad() / config.gear;
    if (moved_rad > most_rad) {
      const double whole = std::round(moved_rad / turn_rad);
      const bool is_turn = whole >= 1.0 && std::abs(moved_rad - whole * turn_rad) <= most_rad;
      return is_turn ? LeaderFault::kWrapped : LeaderFault::kJumped;
    }
  }
  if (!(position_rad >= config.lowest_rad && position_rad <= config.highest_rad)) {
    return LeaderFault::kOutOfRange;
  }
  position_rad_[joint] = position_rad;
  return LeaderFault::kNone;
}

bool LeaderArm::write(const LeaderValues& torque_newton_m, LeaderValues& made_newton_m) noexcept {
  made_newton_m = {};
  if (fault_ != LeaderFault::kNone) return false;
  const TimePoint begin = clock_.now();
  if (!is_enabled_) {
    switched_at_ = begin;
    is_known_ = true;  // that none acts
    return true;
  }
  for (std::size_t i = 0; i < count_; ++i) {
    const LeaderJoint& joint = joints_[i];
    const double wanted = std::isfinite(torque_newton_m[i]) ? torque_newton_m[i] : 0.0;
    const MotorCommand command = bus_->command(i, joint.sign * wanted / joint.gear);
    written_[i] = command.units;
    made_newton_m[i] = joint.sign * command.newton_m * joint.gear;
  }
  if (!send()) {
    made_newton_m = {};
    return false;
  }
  is_known_ =
      seconds_between(read_at_, clock_.now()) + bus_->delay_s() <= settings_.longest_delay_s;
  switched_at_ = begin;
  return true;
}

bool LeaderArm::send() noexcept {
  const Transfer transfer = bus_->write(std::span(written_).first(count_));
  spoken_at_ = clock_.now();
  return transfer == Transfer::kDone || fail_transfer(transfer);
}

// --- what the clamp is told ---------------------------------------------------------------------

double LeaderArm::lease_s() const noexcept {
  return settings_.longest_cycle_s + settings_.longest_delay_s + bus_->watchdog_s();
}

double LeaderArm::resolution_rad(std::size_t joint) const noexcept {
  const LeaderJoint& config = joints_[joint];
  return bus_->step_rad() / config.gear + config.play_rad +
         2.0 * config.fastest_rad_per_s * settings_.longest_delay_s;
}

double LeaderArm::largest_torque_newton_m(std::size_t joint) const noexcept {
  return bus_->largest_newton_m(joint) * joints_[joint].gear;
}

std::string LeaderArm::description() const {
  std::string text;
  for (std::size_t i = 0; i < count_; ++i) {
    text += leader_joint_name(i, joints_[i].id) + ": " + bus_->model_text(i) + ", at most " +
            leader_number(largest_torque_newton_m(i)) + " N·m in steps of " + bus_->scale_text(i) +
            ", resolution " + leader_number(resolution_rad(i)) + " rad\n";
  }
  return text;
}

}  // namespace palpate::device
