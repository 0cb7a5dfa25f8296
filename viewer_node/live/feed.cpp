// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/live/feed.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "common/core/user/utf8.h"
#include "common/core/version.h"
#include "common/link/codec/viewer_codec.h"
#include "common/task/score.h"

namespace palpate::viewer {
namespace {

constexpr Duration kTaskInterval = std::chrono::milliseconds(500);

/// By side; an empty one: no page may lead its hand.
std::vector<std::string> hand_topics(const Session& session, const ProcessLinks& links,
                                     bool is_audience) {
  std::vector<std::string> topics;
  for (const Side& side : session.sides) {
    const bool is_led = !is_audience && may_lead_hand(side, links);
    topics.push_back(is_led ? topic_of(side, "/hand_target") : "");
  }
  return topics;
}

/// An audience only watches.
ServerDescription description_of(const NodeContext& context, const ProcessLinks& links,
                                 bool is_audience) {
  return {.name = std::string("viewer_node ") + version(),
          .session_id = fmt::format("{:x}", context.session_id),
          .session_name = context.session.name,
          .channels = web_channels(context.session, is_audience),
          .hand_topics = hand_topics(context.session, links, is_audience),
          .accepts_requests = !is_audience,
          .accepts_changes = !is_audience && may_change_tissue(context.session),
          .accepts_acknowledgements = !is_audience && context.session.viewer.has_control};
}

/// The log's lines for the tissues whose constants differ; empty if the scenes differ otherwise.
std::vector<std::string> changes_between(const SceneState& before, const SceneState& after) {
  std::vector<std::string> lines;
  if (before.header.session_id != after.header.session_id ||
      before.tissues.size() != after.tissues.size()) {
    return lines;
  }
  for (std::size_t i = 0; i < after.tissues.size(); ++i) {
    const TissueSurface& was = before.tissues[i];
    const TissueSurface& is = after.tissues[i];
    if (was.stiffness_newton_per_m == is.stiffness_newton_per_m &&
        was.damping_newton_s_per_m == is.damping_newton_s_per_m) {
      continue;
    }
    std::string name = is.name;
    std::replace(name.begin(), name.end(), '"', '\'');
    lines.push_back(fmt::format(
        "event=tissue_changed tissue=\"{}\" stiffness_newton_per_m={} damping_newton_s_per_m={}",
        name, is.stiffness_newton_per_m, is.damping_newton_s_per_m));
  }
  return lines;
}

}  // namespace

WebFeed::WebFeed(NodeContext& context, ProcessLinks& links, const WebOptions& options,
                 TelemetrySubscriber& subscriber, std::span<const TelemetryMirror> mirrors,
                 TaskView* task)
    : context_(context),
      task_(task),
      sides_(context.session),
      server_((check_control(context.session, options),
               web_config(options, context.session.viewer.web)),
              description_of(context, links, options.audience > 0)),
      log_(context.session, server_),
      scene_(subscriber, server_, options.audience_interval()),
      control_(context, links, mirrors, server_),
      run_(context, links, subscriber, page_record_folder(options), scene_.mirror(), mirrors, task,
           server_, log_),
      health_(context.session, mirrors, subscriber, server_, log_),
      foxglove_(context.session, mirrors, scene_, server_, options.audience_interval()) {
  for (const Side& side : context.session.sides) hands_.emplace_back(context, links, server_, side);
  if (options.audience > 0) thinned_.emplace(context.session, server_, options.audience_interval());
  const WebConfig& configured = context.session.viewer.web;
  if (options.listen.empty() && options.descriptor < 0 && configured.port != 0 &&
      server_.port() != configured.port) {
    context.log.warn("event=port_in_use port={} instead={}", configured.port, server_.port());
  }
  context.log.info("event=web url={}", server_.url());
}

void WebFeed::take(const TelemetryMessage& message, std::span<const std::byte> payload) {
  if (const auto* scene = std::get_if<SceneState>(&message)) {
    const std::optional<SceneState>& known = scene_.mirror().scene();
    std::vector<std::string> lines;
    if (known) lines = changes_between(*known, *scene);
    if (scene_.take(*scene, payload)) {
      if (lines.empty()) lines.emplace_back("event=scene_sent_anew");
      for (const std::string& line : lines) log_.write(LogLevel::kInfo, "physics_node", line);
    }
  } else if (const auto* frame = std::get_if<MeshFrame>(&message)) {
    scene_.take(*frame, payload);
  } else if (const auto* mofc = std::get_if<MofcBatch>(&message)) {
    take_batch(*mofc, WebChannel::kMofc, payload);
  } else if (const auto* physics = std::get_if<PhysicsBatch>(&message)) {
    take_batch(*physics, WebChannel::kPhysics, payload);
  } else if (const auto* device = std::get_if<DeviceBatch>(&message)) {
    take_batch(*device, WebChannel::kDevice, payload);
  }
  run_.take(message, payload, context_.clock.now());
}

template <class Batch>
void WebFeed::take_batch(const Batch& batch, WebChannel kind, std::span<const std::byte> payload) {
  const auto side = sides_.of(batch.side);
  if (!side) return;
  health_.note(*side, batch);
  log_.note(*side, batch, context_.clock.now());
  if (thinned_) {
    thinned_->take(*side, batch);
    return;
  }
  const std::size_t channel = index_of(kind, *side);
  if (!server_.has_subscriber(channel)) return;
  server_.publish(channel, wall_clock_ns(),
                  make_payload({reinterpret_cast<const char*>(payload.data()), payload.size()}));
}

void WebFeed::pump(TimePoint now) {
  scene_.pump(now);
  if (thinned_) thinned_->pump(now);
  for (const WebServer::Event& event : server_.take_events()) handle(event, now);
  for (WebHand& hand : hands_) hand.pump(now);
  run_.pump(now);
  log_.pump(now);
  health_.pump(now, [&] {
    ViewerHealth own{.hand_holder = hands_.front().holder(),
                     .recorder = run_.recorder(now),
                     .run = run_.state()};
    if (hands_.size() > 1) {
      for (const WebHand& hand : hands_) own.sides.emplace_back().hand_holder = hand.holder();
    }
    if (task_ != nullptr) own.task = task_->state();
    return own;
  });
  foxglove_.pump(now);
  if (task_ != nullptr) publish_task_map();
  allow_recordings(now);
  tell_task(now);
}

/// For who watches many stations.
void WebFeed::tell_task(TimePoint now) {
  if (now < next_task_) return;
  next_task_ = now + kTaskInterval;
  nlohmann::ordered_json json{{"session", context_.session.name}, {"task", nullptr}};
  if (task_ != nullptr) {
    json["task"] = state_json(task_->state());
    if (task_->has_ended()) json["task"]["score"] = score_json(task_->score());
  }
  server_.set_task(json_text(json) + "\n");
}

/// A recording tells where everything is.
void WebFeed::allow_recordings(TimePoint now) {
  const ViewerHealth::Recorder recorder = run_.recorder(now);
  const bool is_hiding =
      task_ != nullptr && context_.session.task->hides_places() && !task_->may_reveal();
  Shelf shelf{.may_be_read = !is_hiding};
  if (recorder.is_recording) {
    shelf.written = std::filesystem::path(recorder.file).filename().string();
  }
  if (shelf == shelf_) return;
  shelf_ = shelf;
  server_.set_recordings(shelf.may_be_read, shelf.written);
}

void WebFeed::publish_task_map() {
  const bool has_ended = task_->has_ended();
  if (has_ended != is_map_of_end_) task_map_ = nullptr;  // an end, or a replay that has gone back
  is_map_of_end_ = has_ended;
  if (task_map_ || !(has_ended || task_->knows_area())) return;
  task_map_ = make_payload(encode_task_map(task_->map()));
  server_.publish(index_of(WebChannel::kTaskMap), wall_clock_ns(), task_map_);
}

void WebFeed::end() {
  if (!run_.state().replay) health_.tell_verdicts();
}

void WebFeed::handle(const WebServer::Event& event, TimePoint now) {
  switch (event.kind) {
    case WebServer::Event::Kind::kSubscribed:
      if (event.channel == index_of(WebChannel::kScene)) scene_.send_scene_to(event.client);
      if (event.channel == index_of(WebChannel::kMesh)) scene_.send_meshes_to(event.client);
      if (event.channel == index_of(WebChannel::kPoints)) foxglove_.repeat_points();
      if (event.channel == index_of(WebChannel::kTool, 0)) foxglove_.repeat_surfaces();
      if (event.channel == index_of(WebChannel::kLog)) log_.send_history_to(event.client);
      if (event.channel == index_of(WebChannel::kTaskMap) && task_map_) {
        server_.send_to(event.client, event.channel, wall_clock_ns(), task_map_);
      }
      return;
    case WebServer::Event::Kind::kHandTarget:
      hands_.at(event.channel).take(event.client, event.payload, now);
      return;
    case WebServer::Event::Kind::kRunRequest:
      run_.request(event.client, event.payload, now);
      return;
    case WebServer::Event::Kind::kTissueChange:
      control_.change(event.client, event.payload, now);
      return;
    case WebServer::Event::Kind::kAcknowledgement:
      control_.acknowledge(event.client, event.payload, now);
      return;
    case WebServer::Event::Kind::kLeft:
      for (WebHand& hand : hands_) hand.client_left(event.client, now);
      return;
    case WebServer::Event::Kind::kFailed:
      context_.log.error("event=web_failed error=\"{}\"", event.payload);
      return;
  }
}

}  // namespace palpate::viewer
