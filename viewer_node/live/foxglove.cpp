// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/live/foxglove.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>
#include <vector>

#include "common/link/codec/viewer_codec.h"
#include "viewer_node/live/channels.h"

namespace palpate::viewer {
namespace {

constexpr Duration kTelemetryInterval = std::chrono::milliseconds(20);  // tools warn above 60 Hz
constexpr Duration kSurfacesInterval = std::chrono::milliseconds(500);  // they are large
constexpr Duration kToolInterval = std::chrono::milliseconds(33);

}  // namespace

void WebFoxglove::pump(TimePoint now) {
  const std::uint64_t at_ns = wall_clock_ns();
  if (now >= next_telemetry_) {
    next_telemetry_ = now + std::max(kTelemetryInterval, least_interval_);
    for (std::size_t side = 0; side < mirrors_.size(); ++side) publish_telemetry(side, at_ns);
  }
  if (now >= next_tool_) {
    next_tool_ = now + std::max(kToolInterval, least_interval_);
    for (std::size_t side = 0; side < mirrors_.size(); ++side) publish_tool(side, at_ns);
    publish_points(at_ns);
    publish_surfaces(at_ns, now);
  }
}

void WebFoxglove::publish_telemetry(std::size_t side, std::uint64_t at_ns) {
  const std::size_t channel = index_of(WebChannel::kTelemetry, side);
  if (!server_.has_subscriber(channel)) return;
  const TelemetryMirror::JoinedTick* const newest = mirrors_[side].newest_of_device();
  const TelemetryMirror::JoinedTick* const joined = mirrors_[side].newest_joined();
  if (newest == nullptr) return;
  const auto& tick = joined != nullptr ? *joined : *newest;
  const MofcCounters& mofc = mirrors_[side].mofc_counters();
  server_.publish(
      channel, at_ns,
      make_payload(encode_telemetry(at_ns, *tick.device, tick.mofc, mofc.transparency())));
}

void WebFoxglove::publish_tool(std::size_t side, std::uint64_t at_ns) {
  const std::size_t tool = index_of(WebChannel::kTool, side);
  const std::size_t transforms = index_of(WebChannel::kTransforms, side);
  if (!server_.has_subscriber(tool) && !server_.has_subscriber(transforms)) return;
  const TelemetryMirror::JoinedTick* const newest = mirrors_[side].newest_of_device();
  const TelemetryMirror::JoinedTick* const joined = mirrors_[side].newest_joined();
  if (newest == nullptr) return;
  const DeviceTick& device = *newest->device;
  const Vector3 requested_newton =
      joined != nullptr ? joined->mofc->requested_force_on_hand_newton : Vector3(Vector3::Zero());
  static const SceneState kUnknownScene;
  const SceneState& scene = scene_.mirror().scene() ? *scene_.mirror().scene() : kUnknownScene;
  server_.publish(tool, at_ns, make_payload(encode_tool(at_ns, device, scene, requested_newton)));
  const std::string frame = with_side(session_.sides[side].name, "tool");
  server_.publish(transforms, at_ns, make_payload(encode_transforms(at_ns, frame, device)));
}

void WebFoxglove::publish_points(std::uint64_t at_ns) {
  const std::size_t channel = index_of(WebChannel::kPoints);
  const bool is_due = are_points_due_ || scene_.frame_count() != frames_published_;
  const std::optional<SceneState>& scene = scene_.mirror().scene();
  if (!is_due || !scene || !server_.has_subscriber(channel)) return;
  are_points_due_ = false;
  frames_published_ = scene_.frame_count();
  server_.publish(channel, at_ns, make_payload(encode_point_cloud(at_ns, vertices_m())));
}

void WebFoxglove::publish_surfaces(std::uint64_t at_ns, TimePoint now) {
  const std::size_t channel = index_of(WebChannel::kTool, 0);
  const std::optional<SceneState>& scene = scene_.mirror().scene();
  if (now < next_surfaces_ || !scene || !server_.has_subscriber(channel)) return;
  are_surfaces_due_ |=
      scene_.frame_count() != surface_frames_ || scene->revision != surface_revision_;
  if (!std::exchange(are_surfaces_due_, false)) return;
  next_surfaces_ = now + std::max(kSurfacesInterval, least_interval_);
  surface_frames_ = scene_.frame_count();
  surface_revision_ = scene->revision;
  server_.publish(channel, at_ns, make_payload(encode_tissues(at_ns, *scene, vertices_m())));
}

/// Of each tissue. @pre there is a scene
std::vector<std::vector<float>> WebFoxglove::vertices_m() const {
  std::vector<std::vector<float>> parts;
  for (std::size_t tissue = 0; tissue < scene_.mirror().scene()->tissues.size(); ++tissue) {
    parts.push_back(scene_.mirror().vertices_m(tissue));
  }
  return parts;
}

}  // namespace palpate::viewer
