// SPDX-License-Identifier: Apache-2.0
// What is checked and written before an arm may have torque. It may allocate, and throws.
#include <algorithm>
#include <cmath>
#include <string>

#include "common/core/check.h"
#include "device_node/drivers/dynamixel/dynamixel_motors.h"
#include "device_node/drivers/leader/leader_arm.h"

namespace palpate::device {
namespace {

/// A torque per ampere that is further from the manual's is a wrong unit, not another servo.
constexpr double kMostOff = 3.0;
constexpr unsigned kProfileBit = 0x04;  // of the drive mode: nothing that current control uses

}  // namespace

std::string DynamixelMotors::name_of(std::size_t joint) const {
  return leader_joint_name(joint, joints_[joint].id);
}

void DynamixelMotors::check_currents() const {
  for (std::size_t i = 0; i < count_; ++i) {
    const double limit = joints_[i].current_limit_ampere;
    if (!std::isfinite(limit) || limit <= 0.0) {
      throw SetupError("leader " + name_of(i) +
                       ": current_limit_ampere must be above 0: the most that the motor may get");
    }
    const double per_ampere = joints_[i].torque_newton_m_per_ampere;
    if (!std::isfinite(per_ampere) || per_ampere < 0.0) {
      throw SetupError("leader " + name_of(i) +
                       ": torque_newton_m_per_ampere must be 0, for the manual's, or above");
    }
  }
  if (settings_.watchdog_units < 1 || settings_.watchdog_units > 127) {
    throw SetupError("leader: watchdog_units is 1 … 127, each 20 ms");
  }
}

void DynamixelMotors::set_up() {
  // limp first, whatever program had the arm before; and answers to every instruction
  static_cast<void>(write_all(dynamixel::kTorqueEnable, 0));
  static_cast<void>(write_all(dynamixel::kStatusReturnLevel, 2));
  is_fast_ = true;
  for (std::size_t i = 0; i < count_; ++i) {
    identify(i);
    check_settings(i);
    is_fast_ = is_fast_ && servos_[i].firmware >= servos_[i].model->fast_read_since;
    if (i == 0) block_address_ = servos_[i].model->indirect_data;
    if (servos_[i].model->indirect_data != block_address_) {
      throw SetupError("leader " + name_of(i) + ": " + servos_[i].model->name + " beside " +
                       servos_[0].model->name +
                       ": servos of the 330 series and others cannot be read as one; put them on "
                       "two lines");
    }
  }
  check_line();
  for (std::size_t i = 0; i < count_; ++i) prepare(i);
}

/// What the bytes of a cycle alone take must leave time for it.
void DynamixelMotors::check_line() const {
  unsigned return_delay = 0;
  for (const Servo& servo : servos_) return_delay = std::max(return_delay, servo.return_delay);
  const double cycle_s = dynamixel_cycle_s(count_, settings_.bits_per_second, 2e-6 * return_delay);
  const auto refuse = [&](const std::string& setting, double least_s) {
    throw SetupError("leader: a cycle takes " + leader_number(1e3 * cycle_s) + " ms at " +
                     std::to_string(settings_.bits_per_second) + " bit/s; " + setting +
                     " must be above " + leader_number(least_s) +
                     ", or the servos' return delay shorter, or their baud rate higher");
  };
  if (settings_.longest_delay_s <= cycle_s + kDynamixelDelayS) {
    refuse("longest_delay_s", cycle_s + kDynamixelDelayS);
  }
  if (settings_.longest_cycle_s <= cycle_s) refuse("longest_cycle_s", cycle_s);
  if (settings_.watchdog_units * dynamixel::kWatchdogUnitS <= cycle_s) {
    refuse("watchdog_units", cycle_s / dynamixel::kWatchdogUnitS);
  }
}

void DynamixelMotors::identify(std::size_t joint) {
  Servo& servo = servos_[joint];
  const DynamixelJoint& config = joints_[joint];
  DynamixelPing answer;
  Transfer transfer = Transfer::kTimeout;
  for (int tries = 0; tries < 3 && transfer != Transfer::kDone; ++tries) {
    transfer = bus_.ping(ids_[joint], answer);
  }
  if (transfer != Transfer::kDone) {
    throw SetupError("leader " + name_of(joint) + ": does not answer at " +
                     std::to_string(settings_.bits_per_second) +
                     " bit/s; is it supplied and connected, and are its id and baud rate these?");
  }
  servo.model = dynamixel_model(answer.model);
  servo.firmware = answer.firmware;
  if (servo.model == nullptr) {
    throw SetupError("leader " + name_of(joint) + ": model " + std::to_string(answer.model) +
                     " is not known here: its units of current are not; add it to "
                     "dynamixel_models.h from its manual");
  }
  const std::string name = name_of(joint) + ", " + servo.model->name;
  if (servo.model->ampere_per_unit <= 0.0) {
    throw SetupError("leader " + name +
                     ": has no current control; leave it out of the joints, or "
                     "replace it by a servo that has");
  }
  if (servo.firmware < servo.model->watchdog_since) {
    throw SetupError("leader " + name + ": firmware " + std::to_string(servo.firmware) +
                     " has no Bus Watchdog, so nothing would end a torque; update it to " +
                     std::to_string(servo.model->watchdog_since) + " or later");
  }
  const double per_ampere = config.torque_newton_m_per_ampere > 0.0
                                ? config.torque_newton_m_per_ampere
                                : servo.model->stall_newton_m_per_ampere;
  const double of_model = servo.model->stall_newton_m_per_ampere;
  if (per_ampere < of_model / kMostOff || per_ampere > of_model * kMostOff) {
    throw SetupError("leader " + name +
                     ": torque_newton_m_per_ampere = " + leader_number(per_ampere) +
                     ": must be within " + leader_number(of_model / kMostOff) + " … " +
                     leader_number(of_model * kMostOff) +
                     ", a factor of 3 about the manual's; is it per mA, or in another unit?");
  }
  servo.newton_m_per_unit = servo.model->ampere_per_unit * per_ampere;
}

void DynamixelMotors::check_settings(std::size_t joint) {
  Servo& servo = servos_[joint];
  std::array<std::byte, 3> modes{};  // return delay, drive mode, operating mode
  ask_register(joint, dynamixel::kReturnDelay, modes);
  if (settings_.may_write_eeprom) {
    // each is written only if it must be: an EEPROM wears
    if (modes[0] != std::byte{0}) {
      set_register(joint, dynamixel::kReturnDelay, std::array{std::byte{0}});
    }
    if (modes[2] != std::byte{dynamixel::kCurrentControl}) {
      set_register(joint, dynamixel::kOperatingMode, std::array{std::byte{0}});
    }
    ask_register(joint, dynamixel::kReturnDelay, modes);
  }
  servo.return_delay = std::to_integer<unsigned>(modes[0]);
  if ((std::to_integer<unsigned>(modes[1]) & ~kProfileBit) != 0) {
    throw SetupError("leader " + name_of(joint) + ": drive mode " +
                     std::to_string(std::to_integer<unsigned>(modes[1])) +
                     " reverses the servo, couples it to another, or switches torque on with a "
                     "goal; set it to 0, and say the direction with `sign`");
  }
  if (modes[2] != std::byte{dynamixel::kCurrentControl}) {
    throw SetupError("leader " + name_of(joint) + ": operating mode " +
                     std::to_string(std::to_integer<unsigned>(modes[2])) +
                     " is not current control (0); set it, or accept that it is written with "
                     "may_write_eeprom");
  }
  std::array<std::byte, 2> limit{};
  ask_register(joint, dynamixel::kCurrentLimit, limit);
  servo.current_limit =
      std::min(static_cast<int>(dynamixel_u16(limit, 0)),
               static_cast<int>(std::min(
                   32'767.0, joints_[joint].current_limit_ampere / servo.model->ampere_per_unit)));
  std::array<std::byte, 1> error{};
  ask_register(joint, dynamixel::kHardwareError, error);
  if (error[0] != std::byte{0}) {
    fault_detail_ = std::to_integer<unsigned>(error[0]);
    throw SetupError("leader " + name_of(joint) + ": reports a hardware error" +
                     detail_text(LeaderFault::kHardwareError));
  }
}

void DynamixelMotors::prepare(std::size_t joint) {
  // 0 also clears a watchdog that has fired, which would refuse the goal
  set_register(joint, dynamixel::kBusWatchdog, std::array{std::byte{0}});
  set_register(joint, dynamixel::kGoalCurrent, std::array{std::byte{0}, std::byte{0}});
  std::array<std::byte, 2 * kDynamixelBlock.size()> addresses{};
  for (std::size_t i = 0; i < kDynamixelBlock.size(); ++i) {
    addresses[2 * i] = static_cast<std::byte>(kDynamixelBlock[i]);
  }
  set_register(joint, dynamixel::kIndirectAddress, addresses);
  std::array<std::byte, 2 * kDynamixelBlock.size()> written{};
  ask_register(joint, dynamixel::kIndirectAddress, written);
  if (written != addresses) {
    throw SetupError("leader " + name_of(joint) +
                     ": does not keep the indirect addresses that make its state one block");
  }
}

void DynamixelMotors::ask_register(std::size_t joint, unsigned address, std::span<std::byte> data) {
  std::uint8_t error = 0;
  Transfer transfer = bus_.read(ids_[joint], address, data, error);
  if (transfer != Transfer::kDone) transfer = bus_.read(ids_[joint], address, data, error);
  if (transfer != Transfer::kDone || (error & ~kDynamixelAlert) != 0) {
    throw SetupError("leader " + name_of(joint) + ": address " + std::to_string(address) +
                     " cannot be read" +
                     (error != 0 ? ", error " + std::to_string(error) : std::string()));
  }
}

void DynamixelMotors::set_register(std::size_t joint, unsigned address,
                                   std::span<const std::byte> data) {
  std::uint8_t error = 0;
  Transfer transfer = bus_.write(ids_[joint], address, data, error);
  if (transfer != Transfer::kDone) transfer = bus_.write(ids_[joint], address, data, error);
  if (transfer != Transfer::kDone || (error & ~kDynamixelAlert) != 0) {
    throw SetupError("leader " + name_of(joint) + ": address " + std::to_string(address) +
                     " cannot be written" +
                     (error != 0 ? ", error " + std::to_string(error) : std::string()));
  }
}

std::string DynamixelMotors::model_text(std::size_t joint) const {
  const Servo& servo = servos_[joint];
  std::string text = servo.model->name;
  text += ", firmware " + std::to_string(servo.firmware);
  if (servo.return_delay > 0) {
    text += ", return delay " + std::to_string(2 * servo.return_delay) + " µs";
  }
  if (servo.model->measures_supply_current) {
    text += " (it measures the current of its supply: its torque is not proportional to the goal)";
  }
  return text;
}

std::string DynamixelMotors::scale_text(std::size_t joint) const {
  const double per_unit = servos_[joint].newton_m_per_unit * joints_[joint].gear;
  return leader_number(per_unit) + (joints_[joint].torque_newton_m_per_ampere > 0.0
                                        ? " (as configured)"
                                        : " (the manual's stall torque)");
}

}  // namespace palpate::device
