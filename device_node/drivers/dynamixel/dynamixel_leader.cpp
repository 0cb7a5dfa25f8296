// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/dynamixel/dynamixel_leader.h"

#include <memory>

#include "device_node/drivers/dynamixel/dynamixel_arm.h"
#include "device_node/drivers/dynamixel/dynamixel_motors.h"
#include "device_node/drivers/dynamixel/dynamixel_packet.h"

namespace palpate::device {
namespace {

std::unique_ptr<LeaderBus> open_motors(std::span<const DynamixelJoint> joints,
                                       const DynamixelSettings& settings, Clock& clock) {
  check_leader(leader_joints(joints), settings, 0, static_cast<int>(kMostDynamixelId));
  return std::make_unique<DynamixelMotors>(joints, settings, clock);
}

}  // namespace

DynamixelArm::DynamixelArm(std::span<const DynamixelJoint> joints,
                           const DynamixelSettings& settings, Clock& clock)
    : LeaderArm(leader_joints(joints), settings, open_motors(joints, settings, clock), clock) {}

DynamixelLeader::DynamixelLeader(std::span<const DynamixelJoint> joints,
                                 const DynamixelSettings& settings)
    : Leader(std::make_unique<DynamixelArm>(joints, settings, leader_clock())) {}

double dynamixel_cycle_s(std::size_t servos, unsigned bits_per_second, double return_delay_s) {
  const std::size_t request = kDynamixelHeaderBytes + 7 + servos;
  const std::size_t answer = fast_status_bytes(servos, kDynamixelBlock.size());
  const std::size_t goals = kDynamixelHeaderBytes + 7 + 3 * servos;
  return 10.0 * static_cast<double>(request + answer + goals) /
             static_cast<double>(bits_per_second) +
         return_delay_s;
}

}  // namespace palpate::device
