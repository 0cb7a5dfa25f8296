// SPDX-License-Identifier: Apache-2.0
// damiao_arm.h — what DamiaoLeader does, on any clock.
#pragma once

#include <span>

#include "common/core/clock.h"
#include "device_node/drivers/damiao/damiao_leader.h"
#include "device_node/drivers/leader/leader_arm.h"

namespace palpate::device {

class DamiaoArm : public LeaderArm {
 public:
  /// @throws SetupError
  DamiaoArm(std::span<const DamiaoJoint> joints, const DamiaoSettings& settings, Clock& clock);
};

}  // namespace palpate::device
