// SPDX-License-Identifier: Apache-2.0
// process.h — a running session, or a replay, as topics of ROS 2. A viewer: nothing is received.
#pragma once

#include "common/process/process_links.h"
#include "common/process/run_node.h"
#include "deploy/ros/dds/node.h"
#include "deploy/ros/viewer/side_topics.h"

namespace palpate::ros {

struct RosViewerOptions {
  Network network{};
  RosTopicOptions topics{};
};

/// Runs until context.stop. Throws SetupError.
void run_ros_viewer(NodeContext& context, ProcessLinks& links, const RosViewerOptions& options);

}  // namespace palpate::ros
