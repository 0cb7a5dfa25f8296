// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/damiao/damiao_motors.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "common/core/check.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

/// Of longest_delay_s: how old an angle may be in the motor, and until a torque acts. Its loops run
/// at 10 kHz and more; nobody documents it.
constexpr double kMotorDelayS = 0.001;
/// That the timeout may be late by: what enable() waits beyond it, and then it has ended the
/// torque.
constexpr Duration kTimeoutDoubt = 5ms;
constexpr double kTimeoutUnitS = 50e-6;
/// A motor measures its torque, so what it says changes when the torque does: by so many units, for
/// so long.
constexpr Duration kStaleAfter = 20ms;
constexpr unsigned kStaleUnits = 16;
/// An arm at rest under a constant torque says the same all the time, and so does one whose status
/// is frozen. After so long the torque is made less by kStaleUnits, which tells them apart.
constexpr Duration kProbeAfter = 100ms;

/// Where −range … range has its 0, between two codes.
constexpr double kMiddleCode = 0.5 * damiao::kMostTorqueCode;

bool is_bad_answer(Transfer transfer) {
  return transfer == Transfer::kTimeout || transfer == Transfer::kCorrupt;
}

}  // namespace

DamiaoMotors::DamiaoMotors(std::span<const DamiaoJoint> joints, const DamiaoSettings& settings,
                           Clock& clock)
    : count_(joints.size()), settings_(settings), clock_(clock), bus_([&]() -> DamiaoBus {
        std::copy(joints.begin(), joints.end(), joints_.begin());
        for (std::size_t i = 0; i < count_; ++i) {
          DamiaoJoint& joint = joints_[i];
          if (joint.feedback_id == 0) joint.feedback_id = joint.id + 16;
          addresses_[i] = {.id = static_cast<unsigned>(joint.id),
                           .feedback_id = static_cast<unsigned>(joint.feedback_id)};
        }
        check_joints();
        try {
          return {settings.port, settings.is_fd, from_seconds(settings.answer_limit_s)};
        } catch (const std::runtime_error& error) {
          throw SetupError("leader: " + std::string(error.what()));
        }
      }()) {}

DamiaoMotors::~DamiaoMotors() {
  for (std::size_t i = 0; i < count_; ++i) {
    if (!motors_[i].has_timeout) continue;
    const Transfer transfer =
        bus_.write_register(addresses_[i], damiao::kTimeout, motors_[i].former_timeout);
    if (transfer != Transfer::kDone && !is_bad_answer(transfer)) break;
  }
}

// --- life ---------------------------------------------------------------------------------------

std::uint32_t DamiaoMotors::timeout_units() const noexcept {
  return static_cast<std::uint32_t>(std::lround(settings_.timeout_s / kTimeoutUnitS));
}

MotorOutcome DamiaoMotors::set_timeout(std::size_t joint) noexcept {
  Transfer transfer = Transfer::kTimeout;
  for (int times = 0; times < 2 && is_bad_answer(transfer); ++times) {
    transfer = bus_.write_register(addresses_[joint], damiao::kTimeout, timeout_units());
  }
  // one that refuses answers with another value
  if (transfer != Transfer::kDone && transfer != Transfer::kCorrupt) {
    return {.transfer = transfer, .joint = joint};
  }
  motors_[joint].has_timeout = true;
  std::uint32_t kept = 0;
  transfer = bus_.read_register(addresses_[joint], damiao::kTimeout, kept);
  if (transfer == Transfer::kTimeout) {
    transfer = bus_.read_register(addresses_[joint], damiao::kTimeout, kept);
  }
  if (transfer != Transfer::kDone) return {.transfer = transfer, .joint = joint};
  const bool is_kept = kept == timeout_units();
  return {.fault = is_kept ? LeaderFault::kNone : LeaderFault::kNoWatchdog, .joint = joint};
}

MotorOutcome DamiaoMotors::switch_on() noexcept {
  for (std::size_t i = 0; i < count_; ++i) {
    // what it has from before may be a torque
    const CanFrame none =
        damiao_control(addresses_[i].id, {.torque = static_cast<unsigned>(command(i, 0.0).units)});
    DamiaoBus::Answered passed;
    const auto one = std::span(addresses_).subspan(i, 1);
    DamiaoFeedback said;
    for (const CanFrame& frame :
         {none, damiao_command(addresses_[i].id, DamiaoCommand::kEnable), none}) {
      Transfer transfer = Transfer::kTimeout;
      for (int times = 0; times < 2 && is_bad_answer(transfer); ++times) {
        transfer = bus_.exchange({&frame, 1}, one, {&said, 1}, passed);
      }
      if (transfer != Transfer::kDone) return {.transfer = transfer, .joint = i};
    }
    fault_detail_ = said.state;
    if (said.state > damiao::kOn) return {.fault = LeaderFault::kHardwareError, .joint = i};
    if (said.state != damiao::kOn) return {.fault = LeaderFault::kServoError, .joint = i};
  }
  return {};
}

MotorOutcome DamiaoMotors::enable() noexcept {
  // the lease of the motors, before they have any torque
  for (std::size_t i = 0; i < count_; ++i) {
    const MotorOutcome set = set_timeout(i);
    if (set.transfer != Transfer::kDone || set.fault != LeaderFault::kNone) return set;
  }
  MotorOutcome on = switch_on();
  if (on.transfer != Transfer::kDone || on.fault != LeaderFault::kNone) return on;
  // a register that holds a number is no promise: that it ends a torque is tried
  clock_.sleep_until(clock_.now() + from_seconds(settings_.timeout_s) + kTimeoutDoubt);
  Transfer transfer = read();
  if (is_bad_answer(transfer)) transfer = read();
  if (transfer != Transfer::kDone) return {.transfer = transfer, .joint = count_};
  for (std::size_t i = 0; i < count_; ++i) {
    if (feedback_[i].state == damiao::kOn) return {.fault = LeaderFault::kNoWatchdog, .joint = i};
    if (feedback_[i].state != damiao::kCommunicationLost) continue;
    transfer = bus_.command(addresses_[i], DamiaoCommand::kClearError, feedback_[i]);
    if (is_bad_answer(transfer)) {
      transfer = bus_.command(addresses_[i], DamiaoCommand::kClearError, feedback_[i]);
    }
    if (transfer != Transfer::kDone) return {.transfer = transfer, .joint = i};
  }
  on = switch_on();
  for (Motor& motor : motors_) {
    motor.has_command = true;
    motor.said_since = clock_.now();
    motor.least_told = motor.most_told = static_cast<unsigned>(kMiddleCode);
    motor.has_varied = motor.is_probed = false;
  }
  return on;
}

void DamiaoMotors::let_go() noexcept {
  // no answer is waited for
  for (int times = 0; times < 2; ++times) {
    for (std::size_t i = 0; i < count_; ++i) {
      for (const CanFrame& frame : {damiao_control(addresses_[i].id, {}),
                                    damiao_command(addresses_[i].id, DamiaoCommand::kDisable)}) {
        // a bus that takes nothing leaves it to the motors' own timeout
        if (bus_.send(frame) != Transfer::kDone) return;
      }
    }
  }
}

MotorOutcome DamiaoMotors::find_silent() noexcept {
  for (std::size_t i = 0; i < count_; ++i) {
    DamiaoFeedback passed;
    const Transfer answer = bus_.refresh(addresses_[i], passed);
    if (answer == Transfer::kDone) continue;
    if (!is_bad_answer(answer)) break;
    return {.fault = answer == Transfer::kTimeout ? LeaderFault::kNoAnswer : LeaderFault::kCorrupt,
            .joint = i};
  }
  return {};
}

std::string DamiaoMotors::detail_text(LeaderFault fault) const {
  if (fault != LeaderFault::kHardwareError) return {};
  constexpr std::array<std::pair<unsigned, const char*>, 7> kCauses{
      {{0x8, "supply voltage too high"},
       {0x9, "supply voltage too low"},
       {0xA, "current too high"},
       {0xB, "board overheated"},
       {0xC, "winding overheated"},
       {damiao::kCommunicationLost, "communication lost"},
       {0xE, "overload"}}};
  for (const auto& [state, cause] : kCauses) {
    if (state == fault_detail_) {
      return std::string(": ") + cause + "; remove the cause, then switch it off and on";
    }
  }
  return ": unknown state " + std::to_string(fault_detail_);
}

// --- cycle --------------------------------------------------------------------------------------

Transfer DamiaoMotors::read() noexcept {
  std::array<CanFrame, kMostLeaderJoints> frames;
  for (std::size_t i = 0; i < count_; ++i) frames[i] = damiao_refresh(addresses_[i].id);
  DamiaoBus::Answered passed;
  return bus_.exchange(std::span(frames).first(count_), addresses(),
                       std::span(feedback_).first(count_), passed);
}

Transfer DamiaoMotors::write(std::span<const int> units) noexcept {
  std::array<CanFrame, kMostLeaderJoints> frames;
  for (std::size_t i = 0; i < count_; ++i) {
    const auto code = static_cast<unsigned>(units[i]);
    motors_[i].least_told = std::min(motors_[i].least_told, code);
    motors_[i].most_told = std::max(motors_[i].most_told, code);
    if (!motors_[i].has_varied && motors_[i].most_told >= motors_[i].least_told + kStaleUnits) {
      motors_[i].has_varied = true;
      motors_[i].told_since = clock_.now();
    }
    // gains 0: the frame is a torque and nothing else
    frames[i] = damiao_control(addresses_[i].id, {.torque = code});
  }
  std::array<DamiaoFeedback, kMostLeaderJoints> passed{};
  DamiaoBus::Answered answered;
  const Transfer transfer = bus_.exchange(std::span(frames).first(count_), addresses(),
                                          std::span(passed).first(count_), answered);
  for (std::size_t i = 0; i < count_; ++i) motors_[i].has_command = answered[i];
  // an answer that does not come is told by the next state()
  return is_bad_answer(transfer) ? Transfer::kDone : transfer;
}

MotorState DamiaoMotors::state(std::size_t joint) const noexcept {
  const DamiaoFeedback& said = feedback_[joint];
  const DamiaoRange& range = motors_[joint].range;
  return {.position_rad = damiao_value(said.position, -range.position_rad, range.position_rad, 16),
          .velocity_rad_per_s =
              damiao_value(said.velocity, -range.velocity_rad_per_s, range.velocity_rad_per_s, 12),
          .torque_newton_m =
              joints_[joint].torque_ratio *
              damiao_value(said.torque, -range.torque_newton_m, range.torque_newton_m, 12),
          .has_torque = said.state == damiao::kOn,
          .has_command = motors_[joint].has_command};
}

LeaderFault DamiaoMotors::check(std::size_t joint, bool is_enabled, TimePoint now) noexcept {
  Motor& motor = motors_[joint];
  const DamiaoFeedback& said = feedback_[joint];
  fault_detail_ = said.state;
  if (said.state == damiao::kCommunicationLost) {
    // one that is off may say so of the time since its last frame
    return is_enabled ? LeaderFault::kWatchdogFired : LeaderFault::kNone;
  }
  if (said.state > damiao::kOn) return LeaderFault::kHardwareError;
  if (!is_enabled) return LeaderFault::kNone;
  if (said.state == damiao::kOff) {
    std::uint32_t kept = 0;
    const bool is_told =
        bus_.read_register(addresses_[joint], damiao::kTimeout, kept) == Transfer::kDone;
    return is_told && kept != timeout_units() ? LeaderFault::kRebooted : LeaderFault::kTorqueOff;
  }
  if (said.bits != motor.said) {
    motor.said = said.bits;
    motor.said_since = now;
    motor.least_told = damiao::kMostTorqueCode;
    motor.most_told = 0;
    motor.has_varied = motor.is_probed = false;
    return LeaderFault::kNone;
  }
  if (motor.has_varied && now - motor.told_since >= kStaleAfter) return LeaderFault::kStale;
  motor.is_probed = now - motor.said_since >= kProbeAfter;
  return LeaderFault::kNone;
}

// --- values -------------------------------------------------------------------------------------

double DamiaoMotors::unit_newton_m(std::size_t joint) const noexcept {
  return 2.0 * motors_[joint].range.torque_newton_m / damiao::kMostTorqueCode;
}

MotorCommand DamiaoMotors::command(std::size_t joint, double newton_m) const noexcept {
  // no code is 0; the two beside it are half a unit
  constexpr double kRounding = 1e-9;  // so that what a code makes is that code again
  const double ratio = joints_[joint].torque_ratio;
  double units = newton_m / ratio / unit_newton_m(joint);
  if (motors_[joint].is_probed) {
    units = std::copysign(std::max(0.0, std::abs(units) - kStaleUnits), units);
  }
  const auto most = static_cast<double>(motors_[joint].most_code);
  double code = 0.0;
  if (newton_m > 0.0) {
    code = std::clamp(std::floor(kMiddleCode + units + kRounding), std::ceil(kMiddleCode), most);
  } else {
    code = std::clamp(std::ceil(kMiddleCode + units - kRounding), damiao::kMostTorqueCode - most,
                      std::floor(kMiddleCode));
  }
  return {.units = static_cast<int>(code),
          .newton_m = (code - kMiddleCode) * unit_newton_m(joint) * ratio};
}

double DamiaoMotors::largest_newton_m(std::size_t joint) const noexcept {
  return (motors_[joint].most_code - kMiddleCode) * unit_newton_m(joint) *
         joints_[joint].torque_ratio;
}

double DamiaoMotors::step_rad() const noexcept {
  // two, as nobody says how a motor rounds
  double most_rad = 0.0;
  for (std::size_t i = 0; i < count_; ++i) {
    most_rad = std::max(most_rad, 2.0 * motors_[i].range.position_rad / 0xFFFF);
  }
  return 2.0 * most_rad;
}

double DamiaoMotors::delay_s() const noexcept { return kMotorDelayS; }

double DamiaoMotors::watchdog_s() const noexcept {
  return settings_.timeout_s + to_seconds(kTimeoutDoubt);
}

}  // namespace palpate::device
