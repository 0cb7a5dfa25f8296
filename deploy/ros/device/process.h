// SPDX-License-Identifier: Apache-2.0
// process.h — a device behind topics of ROS 2, for the plug-in palpate_ros_device.so in
// device_node: measured_cp and what else the arm publishes comes in, servo_cf goes out.
#pragma once

#include <optional>
#include <string>

#include "common/process/run_node.h"
#include "deploy/ros/dds/node.h"
#include "deploy/ros/device/pose_gate.h"

namespace palpate::ros {

struct RosDeviceOptions {
  Network network{};
  std::string name_space;            ///< not that of palpate ros: their topics have the same names
  Offer offer = Offer::kSensorData;  ///< of the forces
  DeviceAxes axes{};
  std::string base_frame;                ///< frame_id of the poses; empty: that of the first one
  std::optional<Duration> button_limit;  ///< a button that nobody told for longer is released
};

/// Runs until context.stop. Throws SetupError.
void run_ros_device(NodeContext& context, const RosDeviceOptions& options);

}  // namespace palpate::ros
