// SPDX-License-Identifier: Apache-2.0
// web_feed.h — serves a running session to web clients, and passes on what they may send: hand
// targets, changes of tissues, acknowledgements of devices, and requests to the run.
//
//   in   hop 5  telemetry of all nodes, SceneState, MeshFrame, RunState
//   out  hop 6  HandTarget  see web_hand.h
//        hop 7  RunRequest  see web_run.h
//        hop 8  TissueChange, hop 9  Acknowledgement  see control.h
//
// Thread: the viewer's; the server has its own.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <span>
#include <string>

#include "common/link/telemetry_subscriber.h"
#include "common/process/process_links.h"
#include "common/process/run_node.h"
#include "viewer_node/audience/thinned_telemetry.h"
#include "viewer_node/feed/side_index.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/live/channels.h"
#include "viewer_node/live/control.h"
#include "viewer_node/live/foxglove.h"
#include "viewer_node/live/hand.h"
#include "viewer_node/live/health.h"
#include "viewer_node/live/log.h"
#include "viewer_node/live/options.h"
#include "viewer_node/live/run.h"
#include "viewer_node/live/scene.h"
#include "viewer_node/server/web_server.h"
#include "viewer_node/task/task_view.h"

namespace palpate::viewer {

class WebFeed {
 public:
  /// Starts to listen; throws SetupError. All references must outlive it.
  /// @param mirrors  of each of context.session.sides   @param task  of the session; may be null
  WebFeed(NodeContext& context, ProcessLinks& links, const WebOptions& options,
          TelemetrySubscriber& subscriber, std::span<const TelemetryMirror> mirrors,
          TaskView* task);

  /// Passes one message of hop 5 on. @param payload  the same message as received
  void take(const TelemetryMessage& message, std::span<const std::byte> payload);
  /// Handles what clients sent and publishes what is due. Call at least every 20 ms.
  void pump(TimePoint now);
  /// Tells clients the verdict on the run. Call it last, and leave them a moment to receive it.
  void end();

 private:
  template <class Batch>
  void take_batch(const Batch& batch, WebChannel kind, std::span<const std::byte> payload);
  void handle(const WebServer::Event& event, TimePoint now);
  /// What was searched, once the task has ended.
  void publish_task_map();
  void allow_recordings(TimePoint now);
  void tell_task(TimePoint now);

  /// What was told to the server.
  struct Shelf {
    bool may_be_read = false;
    std::string written{};

    bool operator==(const Shelf&) const = default;
  };

  NodeContext& context_;
  const TaskView* task_;
  Shelf shelf_;
  TimePoint next_task_{};
  Payload task_map_;            // null: nothing to be shown yet
  bool is_map_of_end_ = false;  // else what is to be searched
  SideIndex sides_;
  WebServer server_;
  WebLog log_;
  WebScene scene_;
  std::deque<WebHand> hands_;  // by side
  WebControl control_;
  WebRun run_;
  WebHealth health_;
  WebFoxglove foxglove_;
  std::optional<ThinnedTelemetry> thinned_;  // of an audience
};

}  // namespace palpate::viewer
