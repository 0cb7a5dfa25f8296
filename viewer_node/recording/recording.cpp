// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/recording.h"

#include <chrono>
#include <utility>

#include "common/core/clock.h"
#include "common/core/version.h"
#include "common/link/codec/viewer_codec.h"

namespace palpate::viewer {
namespace {

// Data that may wait for the disk: about 100 s of a run at 1 kHz.
constexpr std::size_t kMaxQueuedBytes = std::size_t{64} << 20;
// Maximum time that a message waits for its chunk: with the batch on its way, a killed recorder
// loses less than half a second.
constexpr auto kFlushInterval = std::chrono::milliseconds(250);

const char* node_of(const DeviceBatch&) { return "device_node"; }
const char* node_of(const MofcBatch&) { return "mofc_node"; }
const char* node_of(const PhysicsBatch&) { return "physics_node"; }

}  // namespace

std::vector<mcap::Channel> recorded_channels() {
  std::vector<mcap::Channel> channels;
  for (const auto& [topic, schema] :
       {std::pair("/device", "palpate.v1.DeviceTelemetry"),
        std::pair("/mofc", "palpate.v1.MofcTelemetry"),
        std::pair("/physics", "palpate.v1.PhysicsTelemetry"),
        std::pair("/scene_state", "palpate.v1.SceneState"),
        std::pair("/mesh", "palpate.v1.MeshFrame"), std::pair("/markers", "palpate.v1.Marker")}) {
    channels.push_back({topic, schema, schema_of(schema)});
  }
  return channels;
}

mcap::Channel ideal_channel() {
  constexpr const char* kSchema = "palpate.v1.IdealForces";
  return {"/ideal", kSchema, schema_of(kSchema)};
}

mcap::Strings run_metadata(const Session& session, const std::string& recorded_by) {
  std::string sides;
  std::string controllers;
  for (const Side& side : session.sides) {
    sides += (sides.empty() ? "" : ",") + side.name;
    controllers += (controllers.empty() ? "" : ", ") + (side.name.empty() ? "" : side.name + ": ") +
                   controller_text(side.mofc);
  }
  return {{"session", session.text},
          {"session_name", session.name},
          {"session_file", session.file},
          {"controller", controllers},
          {"seed", std::to_string(session.seed)},
          {"sides", sides},
          {"recorded_by", recorded_by},
          {"version", version()},
          {"protocol_major", std::to_string(kProtocolMajor)}};
}

bool NodeVersions::note(const TelemetryMessage& message) {
  return std::visit(
      [&](const auto& batch) {
        if constexpr (requires { node_of(batch); }) {
          Node& node = nodes_[with_side(batch.side, node_of(batch))];
          if (node.session_id == batch.header.session_id) return false;
          node.session_id = batch.header.session_id;
          node.version = batch.node_version;
          ++node.sessions;
          return true;
        } else {
          return false;
        }
      },
      message);
}

mcap::Strings NodeVersions::metadata() const {
  mcap::Strings strings;
  for (const auto& [name, node] : nodes_) {
    strings[name] = node.version;
    strings[name + "_sessions"] = std::to_string(node.sessions);
  }
  return strings;
}

Recording::Recording(const RecordOptions& options, const Session& session,
                     const std::string& recorded_by, TelemetrySubscriber& subscriber)
    : writer_(options.file, options.may_overwrite, recorded_channels()), subscriber_(subscriber) {
  writer_.add_metadata(kRunMetadata, run_metadata(session, recorded_by));
  subscriber.subscribe<SceneState>();
  subscriber.subscribe<MeshFrame>();
  thread_ = std::jthread([this](const std::stop_token& stop) { write_until(stop); });
}

Recording::~Recording() { close(); }

void Recording::take(const TelemetryMessage& message, std::span<const std::byte> payload) {
  if (const auto* run = std::get_if<RunState>(&message)) return take_markers(*run);
  // physics_node sends its scene again whenever another viewer subscribes to it
  const auto* scene = std::get_if<SceneState>(&message);
  std::optional<std::pair<std::uint64_t, std::uint64_t>> key;
  if (scene != nullptr) key.emplace(scene->header.session_id, scene->revision);
  if (key && scene_ == key) return;
  const bool is_queued =
      push({.channel = message.index(),
            .log_time_ns = log_time_ns(),
            .payload = {reinterpret_cast<const char*>(payload.data()), payload.size()}});
  if (key && is_queued) scene_ = key;
  if (versions_.note(message)) push({.nodes = versions_.metadata()});
}

std::uint64_t Recording::log_time_ns() const {
  return begin_ns_ + static_cast<std::uint64_t>((clock_.now() - began_at_).count());
}

std::uint64_t Recording::log_time_of(const Marker& marker) const {
  const std::uint64_t now_ns = log_time_ns();
  const std::uint64_t wall_ns = wall_clock_ns();
  // older than the recording, or of the future: the wall clock was set since
  const bool is_plausible = marker.at_ns <= wall_ns && wall_ns - marker.at_ns <= now_ns - begin_ns_;
  return is_plausible ? now_ns - (wall_ns - marker.at_ns) : now_ns;
}

/// Those that are new since the recording began; the markers of a replay belong to its recording.
/// The time decides only for the first state that is taken: later the wall clock may have been set
/// back, but the markers of a run are in order.
void Recording::take_markers(const RunState& run) {
  if (run.replay) return;
  const bool is_first = !run_;
  if (run_ && *run_ != run.header.session_id) newest_marker_ns_ = 0;
  run_ = run.header.session_id;
  for (const Marker& marker : run.markers) {
    if (marker.at_ns <= newest_marker_ns_) continue;
    newest_marker_ns_ = marker.at_ns;
    Marker recorded = marker;
    recorded.at_ns = log_time_of(marker);
    push({.channel = TelemetryMessage(std::in_place_type<RunState>).index(),
          .log_time_ns = recorded.at_ns,
          .payload = encode_marker(recorded)});
  }
  if (is_first) newest_marker_ns_ = run.markers.empty() ? 0 : run.markers.back().at_ns;
}

bool Recording::push(Item&& item) {
  const std::scoped_lock lock(mutex_);
  if (queued_bytes_ + item.payload.size() > kMaxQueuedBytes) {
    ++dropped_;
    return false;
  }
  queued_bytes_ += item.payload.size();
  queue_.push_back(std::move(item));
  return true;
}

void Recording::write_until(const std::stop_token& stop) {
  std::vector<Item> items;
  while (!stop.stop_requested()) {
    {
      std::unique_lock lock(mutex_);
      filled_.wait_for(lock, stop, kFlushInterval, [] { return false; });
      items.swap(queue_);
      queued_bytes_ = 0;
    }
    write(items);
    writer_.flush();
    if (auto error = writer_.take_error()) {
      const std::scoped_lock lock(mutex_);
      error_ = std::move(error);
    }
  }
}

void Recording::write(std::vector<Item>& items) {
  for (const Item& item : items) {
    if (item.nodes.empty()) {
      writer_.write(item.channel, item.log_time_ns, item.payload);
    } else {
      writer_.add_metadata(kNodesMetadata, item.nodes);
    }
  }
  items.clear();
}

void Recording::close() {
  if (!thread_.joinable()) return;
  thread_.request_stop();
  thread_.join();
  subscriber_.unsubscribe<SceneState>();
  subscriber_.unsubscribe<MeshFrame>();
  write(queue_);
  writer_.add_metadata(kLossMetadata, {{"messages_dropped", std::to_string(dropped_)}});
  writer_.close();
  if (auto error = writer_.take_error()) error_ = std::move(error);
}

std::optional<std::string> Recording::take_error() {
  const std::scoped_lock lock(mutex_);
  return std::exchange(error_, std::nullopt);
}

}  // namespace palpate::viewer
