// SPDX-License-Identifier: Apache-2.0
// web_scene.h — /scene_state and /mesh: the scene and its motion, for web clients.
//
//   in   hop 5  SceneState, MeshFrame
//
// physics_node sends the scene again whenever a viewer subscribes to it. Web clients get each scene
// once: when it is new, or when they subscribe. An audience gets MeshSteps instead of MeshFrame.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/link/telemetry_subscriber.h"
#include "viewer_node/feed/scene_mirror.h"
#include "viewer_node/server/web_server.h"

namespace palpate::viewer {

class WebScene {
 public:
  /// Subscribes to SceneState. References must outlive it.
  /// @param audience_interval  0: every frame is published as it comes; else MeshSteps, so often
  WebScene(TelemetrySubscriber& subscriber, WebServer& server, Duration audience_interval);

  /// Publishes a scene, unless it is known already. True if it replaces an earlier scene.
  /// @param payload  the message as received
  bool take(const SceneState& scene, std::span<const std::byte> payload);
  /// Publishes a frame; ignores frames that do not fit the scene.
  void take(const MeshFrame& frame, std::span<const std::byte> payload);

  /// Sends a new subscriber of /scene_state the scene, if there is one.
  void send_scene_to(std::uint64_t client);
  /// Sends a new subscriber of /mesh all tissues that have moved.
  void send_meshes_to(std::uint64_t client);
  /// Subscribes to MeshFrame while a client needs it: physics_node computes vertices on demand.
  void pump(TimePoint now);

  [[nodiscard]] const SceneMirror& mirror() const { return mirror_; }
  /// Accepted frames so far.
  [[nodiscard]] std::uint64_t frame_count() const { return frame_count_; }

 private:
  void publish_steps(TimePoint now);

  TelemetrySubscriber& subscriber_;
  WebServer& server_;
  Duration audience_interval_;
  TimePoint next_steps_{};
  std::uint64_t frames_published_ = 0;  // of frame_count_, as MeshSteps
  SceneMirror mirror_;
  Payload scene_payload_;  // null before the first scene
  /// All tissues that have moved, the same for all who come between two frames.
  std::vector<Payload> whole_;
  std::optional<std::uint64_t> whole_of_;  // frame_count_ then; none: not known
  Codec<MeshFrame> mesh_codec_;
  std::uint64_t frame_count_ = 0;
  bool is_subscribed_ = false;  // to MeshFrame
};

}  // namespace palpate::viewer
