// SPDX-License-Identifier: Apache-2.0
// dynamixel_arm.h — what DynamixelLeader does, on any clock.
#pragma once

#include <span>

#include "common/core/clock.h"
#include "device_node/drivers/dynamixel/dynamixel_leader.h"
#include "device_node/drivers/leader/leader_arm.h"

namespace palpate::device {

class DynamixelArm : public LeaderArm {
 public:
  /// @throws SetupError
  DynamixelArm(std::span<const DynamixelJoint> joints, const DynamixelSettings& settings,
               Clock& clock);
};

}  // namespace palpate::device
