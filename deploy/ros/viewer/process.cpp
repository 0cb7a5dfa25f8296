// SPDX-License-Identifier: Apache-2.0
#include "deploy/ros/viewer/process.h"

#include <algorithm>
#include <chrono>
#include <list>
#include <string>
#include <variant>
#include <vector>

#include "common/process/heap_trim.h"
#include "common/process/refused_peers_log.h"
#include "deploy/ros/viewer/scene_topics.h"
#include "viewer_node/feed/side_index.h"
#include "viewer_node/process.h"
#include "viewer_node/task/hidden_lesions.h"

namespace palpate::ros {
namespace {

constexpr Duration kPumpInterval = std::chrono::milliseconds(20);
constexpr Duration kStrangersInterval = std::chrono::milliseconds(200);
constexpr Duration kSilence = std::chrono::seconds(3);

}  // namespace

void run_ros_viewer(NodeContext& context, ProcessLinks& links, const RosViewerOptions& options) {
  const Session& session = context.session;
  Node node(options.network);
  std::list<SideTopics> topics;
  std::vector<SideTopics*> sides;
  for (const Side& side : session.sides) {
    sides.push_back(&topics.emplace_back(node, options.topics, side.name));
  }
  SceneTopics scene(node, options.topics.name_space);
  scene.write_bases(session, sides);
  std::string out;
  for (const SideTopics* side : sides)
    out += (out.empty() ? "" : ",") + side->prefix() + "measured_cp";
  context.log.info("event=ros {} out={}", text_of(options.network), out);

  std::vector<viewer::TelemetryMirror> mirrors(session.sides.size());
  viewer::TelemetryFeed feed(session, context.clock, links);
  const viewer::SideIndex side_of(session);
  viewer::HiddenLesions hidden(session);  // what a person searches for is told to nobody
  bool may_tell_silence = true;           // nothing was heard yet, and nobody was told
  feed.on_message = [&](const TelemetryMessage& message, std::span<const std::byte> payload) {
    may_tell_silence = false;
    if (const auto* device = std::get_if<DeviceBatch>(&message)) {
      if (const auto side = side_of.of(device->side)) sides[*side]->take(*device);
    } else if (const auto* mofc = std::get_if<MofcBatch>(&message)) {
      if (const auto side = side_of.of(mofc->side)) sides[*side]->take(*mofc);
    } else if (std::holds_alternative<SceneState>(message)) {
      if (const auto passed = hidden.pass(message, payload)) {
        if (const auto* shown = std::get_if<SceneState>(passed->message)) scene.take(*shown);
      }
    }
  };
  feed.subscriber().subscribe<SceneState>();
  RefusedPeersLog refused_peers(context.log, links.side.refused());
  HeapTrim heap;
  TimePoint next_strangers{};
  const TimePoint silent_at = context.clock.now() + kSilence;
  while (!context.stop.stop_requested()) {
    feed.pump(mirrors, context.clock.now() + kPumpInterval);
    const TimePoint now = context.clock.now();
    for (std::size_t i = 0; i < sides.size(); ++i) sides[i]->pump(mirrors[i], now);
    scene.pump(sides);
    refused_peers.note(now);
    heap.note(now);
    if (may_tell_silence && now >= silent_at) {
      may_tell_silence = false;
      context.log.warn(
          "event=nothing_heard what=\"no node of this session has sent anything yet: does it run, "
          "from this file?\"");
    }
    if (now < next_strangers) continue;
    next_strangers = now + kStrangersInterval;
    node.note_strangers([&](const char* event, const std::string& line) {
      context.log.warn("event={} what=\"{}\"", event, line);
    });
  }
  for (const SideTopics* side : sides) {
    if (side->left_out() > 0) {
      context.log.warn(
          "event=ros_left_out messages={} what=\"reliable subscribers, or the server, are too "
          "slow\"",
          side->left_out());
    }
  }
}

}  // namespace palpate::ros
