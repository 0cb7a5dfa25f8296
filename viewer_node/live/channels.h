// SPDX-License-Identifier: Apache-2.0
// web_channels.h — the channels that the web server advertises: topics, schemas, and their order.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "common/session/session.h"
#include "viewer_node/server/foxglove_client.h"

namespace palpate::viewer {

/// In the order of advertisement: all of these for the first side, then for each further side the
/// channels that every side has.
enum class WebChannel : std::uint8_t {
  kScene,
  kMesh,
  kDevice,
  kMofc,
  kPhysics,
  kHealth,
  kTelemetry,
  kPoints,
  kTool,
  kTransforms,
  kLog,
  kTaskMap,  ///< of a session with a task, which has no sides
};

/// "/device"; of a side "/left/device". @param name  with its slash
[[nodiscard]] std::string topic_of(const Side& side, const char* name);

/// The channels of a session with all its sides.
/// @param is_audience  kMesh is /mesh_steps instead of /mesh
[[nodiscard]] std::vector<Channel> web_channels(const Session& session, bool is_audience = false);
/// Index of a channel in web_channels(). @param side  index in session.sides; ignored by
/// channels that all sides share
[[nodiscard]] std::size_t index_of(WebChannel channel, std::size_t side = 0);

}  // namespace palpate::viewer
