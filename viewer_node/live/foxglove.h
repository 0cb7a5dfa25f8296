// SPDX-License-Identifier: Apache-2.0
// web_foxglove.h — /telemetry, /scene, /tf and /tissue/points: the newest state in general schemas,
// for clients that do not know Palpate's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "common/session/session.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/live/scene.h"
#include "viewer_node/server/web_server.h"

namespace palpate::viewer {

class WebFoxglove {
 public:
  /// References must outlive it. @param mirrors  of each of session.sides
  /// @param least_interval  between two messages of a channel
  WebFoxglove(const Session& session, std::span<const TelemetryMirror> mirrors,
              const WebScene& scene, WebServer& server, Duration least_interval)
      : session_(session),
        mirrors_(mirrors),
        scene_(scene),
        server_(server),
        least_interval_(least_interval) {}

  /// Publishes what is due: /telemetry at 50 Hz, the others at 30 Hz, unless the interval is
  /// longer.
  void pump(TimePoint now);
  /// A client subscribed to /tissue/points and needs the vertices even if they do not move.
  void repeat_points() { are_points_due_ = true; }
  /// The same for /scene, of the first side, which holds the surfaces of the tissues.
  void repeat_surfaces() { are_surfaces_due_ = true; }

 private:
  void publish_telemetry(std::size_t side, std::uint64_t at_ns);
  void publish_tool(std::size_t side, std::uint64_t at_ns);
  void publish_points(std::uint64_t at_ns);
  void publish_surfaces(std::uint64_t at_ns, TimePoint now);
  [[nodiscard]] std::vector<std::vector<float>> vertices_m() const;

  const Session& session_;
  std::span<const TelemetryMirror> mirrors_;
  const WebScene& scene_;
  WebServer& server_;
  Duration least_interval_;
  TimePoint next_telemetry_{};
  TimePoint next_tool_{};
  bool are_points_due_ = false;
  std::uint64_t frames_published_ = 0;  // of scene_.frame_count(), as points
  bool are_surfaces_due_ = false;
  TimePoint next_surfaces_{};
  std::uint64_t surface_frames_ = 0;  // of scene_.frame_count(), as surfaces
  std::uint64_t surface_revision_ = 0;
};

}  // namespace palpate::viewer
