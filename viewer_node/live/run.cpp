// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/live/run.h"

#include <spdlog/fmt/fmt.h>

#include <chrono>
#include <ctime>
#include <filesystem>
#include <utility>

#include "common/core/check.h"
#include "viewer_node/live/channels.h"

namespace palpate::viewer {
namespace {

/// Local date and time as part of a file name: "20261122-140501".
std::string time_name() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char text[32];
  const std::size_t length = std::strftime(text, sizeof(text), "%Y%m%d-%H%M%S", &local);
  return {text, length};
}

template <class T>
std::string payload_of(const T& message) {
  Codec<T> codec;
  return palpate::payload_of(codec, message);
}

}  // namespace

void PageRecorder::begin(const SceneMirror& scene, TimePoint now) {
  if (folder_.empty() || recording_) return;
  problem_.clear();
  file_ = (std::filesystem::path(folder_) / (context_.session.name + "-" + time_name() + ".mcap"))
              .lexically_normal()
              .string();
  try {
    recording_.emplace(RecordOptions{.file = file_}, context_.session, "viewer_node, page",
                       subscriber_);
  } catch (const SetupError& error) {
    problem_ = error.what();
    context_.log.error("event=recording_failed what=\"{}\"", problem_);
    return;
  }
  began_ = now;
  context_.log.info("event=recording_begun file={}", file_);
  const auto write = [&](const auto& message) {
    const std::string payload = payload_of(message);
    recording_->take(TelemetryMessage(message), std::as_bytes(std::span(payload)));
  };
  if (scene.scene()) write(*scene.scene());
  for (const MeshFrame& frame : scene.whole_frames()) write(frame);
}

void PageRecorder::end(TimePoint now) {
  if (!recording_) return;
  length_ = now - began_;
  recording_->close();
  if (const auto error = recording_->take_error()) problem_ = *error;
  recording_.reset();
  context_.log.info("event=recording_ended file={} length_s={:.3f}", file_, to_seconds(length_));
}

void PageRecorder::take(const TelemetryMessage& message, std::span<const std::byte> payload) {
  if (recording_) recording_->take(message, payload);
}

void PageRecorder::pump(TimePoint now) {
  const auto error = recording_ ? recording_->take_error() : std::nullopt;
  if (!error) return;
  context_.log.error("event=recording_failed what=\"{}\"", *error);
  end(now);
  problem_ = *error;
}

ViewerHealth::Recorder PageRecorder::status(TimePoint now) const {
  return {.is_possible = !folder_.empty(),
          .is_recording = recording_.has_value(),
          .file = file_,
          .length_s = to_seconds(recording_ ? now - began_ : length_),
          .problem = problem_};
}

WebRun::WebRun(NodeContext& context, ProcessLinks& links, TelemetrySubscriber& subscriber,
               const std::string& record_folder, const SceneMirror& scene,
               std::span<const TelemetryMirror> mirrors, TaskView* task, WebServer& server,
               WebLog& log)
    : context_(context),
      server_(server),
      log_(log),
      scene_(scene),
      mirrors_(mirrors),
      task_(task),
      out_(links.side, run_requests_of(context.session, Attachment::Role::kConnect)),
      header_{.session_id = context.session_id},
      recorder_(context, subscriber, record_folder),
      began_at_(context.clock.now()) {}

void WebRun::take(const TelemetryMessage& message, std::span<const std::byte> payload,
                  TimePoint now) {
  recorder_.take(message, payload);
  const auto* run = std::get_if<RunState>(&message);
  if (run == nullptr) return;
  heard_at_ = now;
  // another run begins its markers anew, and the wall clock may have been set back since the last
  if (run->header.session_id != state_.header.session_id) newest_marker_ns_ = 0;
  note_markers(*run);
  state_ = *run;
}

void WebRun::pump(TimePoint now) {
  recorder_.pump(now);
  hand_over_markers(now);
  if (!has_host(now)) state_.replay.reset();
}

/// Writes the markers that are new to the log. Those of a replay belong to the recording.
void WebRun::note_markers(const RunState& run) {
  if (run.replay) return;
  for (const Marker& marker : run.markers) {
    if (marker.at_ns <= newest_marker_ns_) continue;
    newest_marker_ns_ = marker.at_ns;
    log_.write(LogLevel::kInfo, "run",
               fmt::format("event=marker origin={} text=\"{}\"", marker.origin, marker.text));
  }
}

/// To the host, once it is heard and connected. Nodes that were started by hand have none: then
/// this viewer alone knows the markers.
void WebRun::hand_over_markers(TimePoint now) {
  for (; !markers_.empty(); markers_.pop_front()) {
    if (has_host(now)) {
      RunRequest request;
      request.marker = markers_.front().text;
      request.marker_kind = markers_.front().kind;
      if (send(std::move(request), now) != SendResult::kSent) return;
      continue;
    }
    if (now - began_at_ < RunHost::kGoneAfter) return;
    Marker marker = markers_.front();
    marker.at_ns = wall_clock_ns();
    note_newest_tick(mirrors_, marker);
    own_.add(std::move(marker));
    state_ = {};
    state_.markers = own_.newest();
    note_markers(state_);
    if (task_ != nullptr) task_->take(state_);
    recorder_.take(TelemetryMessage(state_), {});
  }
}

SendResult WebRun::send(RunRequest&& request, TimePoint now) {
  header_.sampled_at = now;
  request.header = header_;
  const SendResult result = out_.send(request);
  if (result == SendResult::kSent) ++header_.sequence;
  return result;
}

void WebRun::request(std::uint64_t client, const std::string& payload, TimePoint now) {
  const auto complain = [&](const std::string& text) {
    server_.send_text_to(client, status_text(StatusLevel::kError, text));
  };
  auto request = decode_page_request(payload);
  if (!request) return complain("not a valid palpate.v1.RunRequest");
  if (request->is_recording && recorder_.status(now).is_possible) {
    if (*request->is_recording) {
      recorder_.begin(scene_, now);
    } else {
      recorder_.end(now);
    }
  } else if (request->is_recording) {
    complain("this viewer_node has no folder for recordings; start it with --record-folder");
  }
  if (request->marker && markers_.size() < RunState::kMostMarkers) {
    markers_.push_back({.text = *std::exchange(request->marker, std::nullopt),
                        .origin = "page",
                        .kind = request->marker_kind});
    hand_over_markers(now);
  }
  if (!request->is_for_run()) return;
  if (!has_host(now)) return complain("there is no replay to control");
  if (send(std::move(*request), now) != SendResult::kSent) {
    complain("the run does not take requests");
  }
}

}  // namespace palpate::viewer
