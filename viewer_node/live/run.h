// SPDX-License-Identifier: Apache-2.0
// web_run.h — markers, the control of a replay and the page's recordings: what web clients may ask
// of the run.
//
//   in   hop 5  RunState    palpate launch or palpate replay → viewer
//   out  hop 7  RunRequest  viewer → the same
//
// Thread: the viewer's.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "common/link/codec/viewer_codec.h"
#include "common/link/telemetry_subscriber.h"
#include "common/link/zmq_sender.h"
#include "common/process/process_links.h"
#include "common/process/run_host.h"
#include "common/process/run_node.h"
#include "viewer_node/feed/scene_mirror.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/live/log.h"
#include "viewer_node/recording/recording.h"
#include "viewer_node/server/web_server.h"
#include "viewer_node/task/task_view.h"

namespace palpate::viewer {

/// Recordings that a page begins and ends: SESSION-DATE-TIME.mcap in one folder.
class PageRecorder {
 public:
  /// @param folder  empty: pages cannot record. References must outlive it.
  PageRecorder(NodeContext& context, TelemetrySubscriber& subscriber, std::string folder)
      : context_(context), subscriber_(subscriber), folder_(std::move(folder)) {}

  /// A failure to begin is in status().problem. @param scene  written first: it was sent earlier
  void begin(const SceneMirror& scene, TimePoint now);
  void end(TimePoint now);
  void take(const TelemetryMessage& message, std::span<const std::byte> payload);
  /// Call it a few times a second: ends a recording that failed.
  void pump(TimePoint now);

  [[nodiscard]] ViewerHealth::Recorder status(TimePoint now) const;

 private:
  NodeContext& context_;
  TelemetrySubscriber& subscriber_;
  std::string folder_;
  std::optional<Recording> recording_;
  std::string file_;
  std::string problem_;
  TimePoint began_{};
  Duration length_{};
};

class WebRun {
 public:
  /// References must outlive it. @param record_folder  see PageRecorder
  /// @param mirrors  of each side   @param task  of the session; may be null
  WebRun(NodeContext& context, ProcessLinks& links, TelemetrySubscriber& subscriber,
         const std::string& record_folder, const SceneMirror& scene,
         std::span<const TelemetryMirror> mirrors, TaskView* task, WebServer& server, WebLog& log);

  /// One message of hop 5.
  void take(const TelemetryMessage& message, std::span<const std::byte> payload, TimePoint now);
  /// A client sent a RunRequest.
  void request(std::uint64_t client, const std::string& payload, TimePoint now);
  void pump(TimePoint now);

  /// For /health.
  [[nodiscard]] ViewerHealth::Recorder recorder(TimePoint now) const {
    return recorder_.status(now);
  }
  [[nodiscard]] const RunState& state() const { return state_; }

 private:
  [[nodiscard]] bool has_host(TimePoint now) const {
    return state_.header.session_id != 0 && now - heard_at_ <= RunHost::kGoneAfter;
  }
  void note_markers(const RunState& run);
  void hand_over_markers(TimePoint now);
  [[nodiscard]] SendResult send(RunRequest&& request, TimePoint now);

  NodeContext& context_;
  WebServer& server_;
  WebLog& log_;
  const SceneMirror& scene_;
  std::span<const TelemetryMirror> mirrors_;
  TaskView* task_;
  ZmqSender<RunRequest> out_;
  Header header_;
  PageRecorder recorder_;
  RunState state_;  // the host's newest, or of this viewer alone
  TimePoint heard_at_{};
  TimePoint began_at_;
  std::deque<Marker> markers_;  // set by pages, not handed over yet
  MarkerLog own_;               // without a host
  std::uint64_t newest_marker_ns_ = 0;
};

}  // namespace palpate::viewer
