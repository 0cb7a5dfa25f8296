// SPDX-License-Identifier: Apache-2.0
// What is checked and written before an arm may have torque. It may allocate, and throws.
#include <bit>
#include <chrono>
#include <cmath>
#include <set>
#include <string>

#include "common/core/check.h"
#include "device_node/drivers/damiao/damiao_models.h"
#include "device_node/drivers/damiao/damiao_motors.h"
#include "device_node/drivers/leader/leader_arm.h"

namespace palpate::device {
namespace {

/// A ratio that is further from 1 is a wrong unit, not another motor.
constexpr double kLeastRatio = 1.0 / 3.0;
constexpr double kMostRatio = 3.0;
constexpr int kMostFeedbackId = 0x7FE;

}  // namespace

std::string DamiaoMotors::name_of(std::size_t joint) const {
  return leader_joint_name(joint, joints_[joint].id);
}

void DamiaoMotors::check_joints() const {
  std::set<int> ids;
  for (std::size_t i = 0; i < count_; ++i) ids.insert(joints_[i].id);
  for (std::size_t i = 0; i < count_; ++i) {
    const DamiaoJoint& joint = joints_[i];
    const auto refuse = [&](const std::string& what) {
      throw SetupError("leader " + name_of(i) + ": " + what);
    };
    if (joint.feedback_id < 1 || joint.feedback_id > kMostFeedbackId) {
      refuse("feedback_id is 1 … " + std::to_string(kMostFeedbackId) + ", or 0 for id + 16");
    }
    if (!ids.insert(joint.feedback_id).second) {
      refuse("feedback_id " + std::to_string(joint.feedback_id) +
             " is that of another motor or joint; give each its own");
    }
    if (damiao_model(joint.model) == nullptr) {
      std::string names;
      for (const DamiaoModel& model : kDamiaoModels) {
        names += (names.empty() ? "" : ", ") + std::string(model.name);
      }
      refuse("model \"" + joint.model + "\" is not known here; there are " + names);
    }
    if (!std::isfinite(joint.torque_limit_newton_m) || joint.torque_limit_newton_m <= 0.0) {
      refuse("torque_limit_newton_m must be above 0: the most that the motor may get");
    }
    if (!(joint.torque_ratio >= kLeastRatio && joint.torque_ratio <= kMostRatio)) {
      refuse("torque_ratio = " + leader_number(joint.torque_ratio) +
             ": must be 1/3 … 3; 1 is what the motor says of itself");
    }
  }
  if (!(settings_.timeout_s >= 0.002 && settings_.timeout_s <= 1.0)) {
    throw SetupError("leader: timeout_s is 0.002 … 1");
  }
  if (settings_.longest_delay_s <= delay_s()) {
    throw SetupError("leader: longest_delay_s must be above " + leader_number(delay_s()) +
                     ", which is left to the motor");
  }
}

void DamiaoMotors::set_up() {
  // limp first, whatever program had the arm before
  let_go();
  for (std::size_t i = 0; i < count_; ++i) {
    identify(i);
    check_ranges(i);
    set_mode(i);
    motors_[i].former_timeout = ask_register(i, damiao::kTimeout);
    motors_[i].software = ask_register(i, damiao::kSoftware);
  }
}

void DamiaoMotors::identify(std::size_t joint) {
  DamiaoFeedback said;
  Transfer transfer = Transfer::kTimeout;
  for (int tries = 0; tries < 3 && transfer != Transfer::kDone; ++tries) {
    transfer = bus_.command(addresses_[joint], DamiaoCommand::kDisable, said);
    // the rest of what was left on the bus is then known to come
    if (transfer == Transfer::kDown) break;
  }
  if (transfer == Transfer::kDone && said.state == damiao::kCommunicationLost) {
    transfer = bus_.command(addresses_[joint], DamiaoCommand::kClearError, said);
  }
  if (transfer != Transfer::kDone) {
    throw SetupError(
        "leader " + name_of(joint) + ": " +
        (transfer == Transfer::kDown
             ? "the interface is down or off the bus: bring it up again with ip link"
             : "does not answer on " + settings_.port + " with id " +
                   std::to_string(joints_[joint].feedback_id) +
                   "; is it supplied and connected, are these its CAN ID and Master ID, and the "
                   "bit rates its own?"));
  }
  if (said.state > damiao::kOn && said.state != damiao::kCommunicationLost) {
    fault_detail_ = said.state;
    throw SetupError("leader " + name_of(joint) + ": reports a hardware error" +
                     detail_text(LeaderFault::kHardwareError));
  }
}

void DamiaoMotors::check_ranges(std::size_t joint) {
  Motor& motor = motors_[joint];
  const DamiaoModel& model = *damiao_model(joints_[joint].model);
  const auto range = [&](std::uint8_t which) {
    return static_cast<double>(std::bit_cast<float>(ask_register(joint, which)));
  };
  motor.range = {.position_rad = range(damiao::kPositionRange),
                 .velocity_rad_per_s = range(damiao::kVelocityRange),
                 .torque_newton_m = range(damiao::kTorqueRange)};
  const auto is_of_model = [](double value, double of_model) {
    return std::abs(value - of_model) <= 1e-4 * of_model;
  };
  // of the speed nothing depends
  if (!is_of_model(motor.range.position_rad, model.range.position_rad) ||
      !is_of_model(motor.range.torque_newton_m, model.range.torque_newton_m) ||
      !std::isfinite(motor.range.velocity_rad_per_s)) {
    throw SetupError("leader " + name_of(joint) + ": its values are within " +
                     leader_number(motor.range.position_rad) + " rad and " +
                     leader_number(motor.range.torque_newton_m) + " N·m, those of a " +
                     joints_[joint].model + " within " + leader_number(model.range.position_rad) +
                     " and " + leader_number(model.range.torque_newton_m) +
                     ": is the model right? If it is, set PMAX and TMAX as delivered");
  }
  const double most = joints_[joint].torque_limit_newton_m / joints_[joint].torque_ratio;
  const double units = std::min(std::floor(most / unit_newton_m(joint) - 0.5 + 1e-9),
                                0.5 * (damiao::kMostTorqueCode - 1));
  if (units < 0.0) {
    throw SetupError("leader " + name_of(joint) +
                     ": torque_limit_newton_m is below half a unit of the wire, " +
                     leader_number(0.5 * unit_newton_m(joint)) + " N·m, the least there is");
  }
  motor.most_code = static_cast<unsigned>(units) + (damiao::kMostTorqueCode + 1) / 2;
}

void DamiaoMotors::set_mode(std::size_t joint) {
  std::uint32_t mode = ask_register(joint, damiao::kControlMode);
  if (mode != damiao::kMitMode) {
    static_cast<void>(
        bus_.write_register(addresses_[joint], damiao::kControlMode, damiao::kMitMode));
    mode = ask_register(joint, damiao::kControlMode);
  }
  if (mode != damiao::kMitMode) {
    throw SetupError("leader " + name_of(joint) + ": stays in control mode " +
                     std::to_string(mode) + "; set it to MIT (1) with its own tool");
  }
}

std::uint32_t DamiaoMotors::ask_register(std::size_t joint, std::uint8_t which) {
  std::uint32_t value = 0;
  Transfer transfer = Transfer::kTimeout;
  for (int tries = 0; tries < 2 && transfer != Transfer::kDone; ++tries) {
    transfer = bus_.read_register(addresses_[joint], which, value);
  }
  if (transfer != Transfer::kDone) {
    throw SetupError("leader " + name_of(joint) + ": register " + std::to_string(which) +
                     " cannot be read");
  }
  return value;
}

std::string DamiaoMotors::model_text(std::size_t joint) const {
  return joints_[joint].model + ", firmware " + std::to_string(motors_[joint].software);
}

std::string DamiaoMotors::scale_text(std::size_t joint) const {
  const double ratio = joints_[joint].torque_ratio;
  return leader_number(unit_newton_m(joint) * ratio * joints_[joint].gear) +
         (ratio != 1.0 ? " (as configured)" : " (the motor's own constants)");
}

}  // namespace palpate::device
