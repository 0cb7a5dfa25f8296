// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/live/channels.h"

#include <algorithm>
#include <iterator>
#include <string>

#include "common/link/codec/viewer_codec.h"

namespace palpate::viewer {
namespace {

struct Definition {
  const char* topic;
  const char* schema;
  bool is_per_side = false;
};
constexpr Definition kDefinitions[] = {
    {"/scene_state", "palpate.v1.SceneState"},
    {"/mesh", "palpate.v1.MeshFrame"},
    {"/device", "palpate.v1.DeviceTelemetry", true},
    {"/mofc", "palpate.v1.MofcTelemetry", true},
    {"/physics", "palpate.v1.PhysicsTelemetry", true},
    {"/health", "palpate.v1.Health"},
    {"/telemetry", "palpate.v1.Telemetry", true},
    {"/tissue/points", "foxglove.PointCloud"},
    {"/scene", "foxglove.SceneUpdate", true},
    {"/tf", "foxglove.FrameTransforms", true},
    {"/log", "foxglove.Log"},
    {"/task_map", "palpate.v1.TaskMap"},
};
constexpr std::size_t kCount = std::size(kDefinitions);
constexpr auto kTaskMap = static_cast<std::size_t>(WebChannel::kTaskMap);
static_assert(kTaskMap + 1 == kCount, "left out without a task, it changes no other's place");
constexpr Definition kAudienceMesh{"/mesh_steps", "palpate.v1.MeshSteps"};

/// Of the first `end` definitions, those that every side has.
std::size_t per_side(std::size_t end) {
  return static_cast<std::size_t>(
      std::count_if(std::begin(kDefinitions), std::begin(kDefinitions) + end,
                    [](const Definition& definition) { return definition.is_per_side; }));
}

}  // namespace

std::string topic_of(const Side& side, const char* name) {
  return (side.name.empty() ? "" : "/" + side.name) + name;
}

std::vector<Channel> web_channels(const Session& session, bool is_audience) {
  std::vector<Channel> channels;
  bool is_first = true;
  for (const Side& side : session.sides) {
    for (std::size_t i = 0; i < kCount; ++i) {
      if (i == kTaskMap && !session.task) continue;
      const bool is_mesh = i == static_cast<std::size_t>(WebChannel::kMesh);
      const Definition& definition = is_mesh && is_audience ? kAudienceMesh : kDefinitions[i];
      if (!is_first && !definition.is_per_side) continue;
      channels.push_back({.topic = definition.is_per_side ? topic_of(side, definition.topic)
                                                          : std::string(definition.topic),
                          .schema_name = definition.schema,
                          .schema = schema_of(definition.schema),
                          .is_state = i != static_cast<std::size_t>(WebChannel::kLog),
                          .is_held = i == static_cast<std::size_t>(WebChannel::kScene)});
    }
    is_first = false;
  }
  return channels;
}

std::size_t index_of(WebChannel channel, std::size_t side) {
  const auto index = static_cast<std::size_t>(channel);
  if (side == 0 || !kDefinitions[index].is_per_side) return index;
  return kTaskMap + (side - 1) * per_side(kCount) + per_side(index);
}

}  // namespace palpate::viewer
