// SPDX-License-Identifier: Apache-2.0
// process.h — any publisher of forces in ROS 2 as the physics of a session.
#pragma once

#include <string>

#include "common/process/process_links.h"
#include "common/process/run_node.h"
#include "deploy/ros/dds/node.h"
#include "deploy/ros/physics/wrench_gate.h"

namespace palpate::ros {

struct RosPhysicsOptions {
  Network network{};
  std::string name_space = "palpate";
  std::string force_topic = "measured_cf";  ///< in the name space; with a leading / not
  Offer offer = Offer::kSensorData;         ///< of the poses
  WrenchSettings wrench{};
};

/// Runs until context.stop. Throws SetupError.
void run_ros_physics(NodeContext& context, ProcessLinks& links, const RosPhysicsOptions& options);

}  // namespace palpate::ros
