// SPDX-License-Identifier: Apache-2.0
// recording.h — records hop 5 in an MCAP file: every batch as received, the scene, the session,
// the versions of the nodes.
//
//   in   hop 5  telemetry of all nodes, SceneState, MeshFrame     out  file
//
// Threads: take() on the caller's; the file on its own, with a queue between them.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/core/clock.h"
#include "common/link/telemetry_subscriber.h"
#include "common/session/session.h"
#include "viewer_node/recording/mcap_writer.h"

namespace palpate::viewer {

/// As given on the command line.
struct RecordOptions {
  std::string file{};  ///< empty: none
  bool may_overwrite = false;
};

/// /device, /mofc, /physics, /scene_state, /mesh: protobuf messages of hop 5 without the kind byte;
/// in the order of TelemetryMessage's alternatives. A batch names its side. /markers instead of
/// RunState.
[[nodiscard]] std::vector<mcap::Channel> recorded_channels();
/// /ideal: the ideal force and the true contact, which only lockstep runs know.
[[nodiscard]] mcap::Channel ideal_channel();

/// Metadata of this name: session (text with its overrides), session_name, session_file,
/// controller, seed, sides (comma-separated names; "" for one device), recorded_by, version (of the
/// recording program), protocol_major.
inline constexpr const char* kRunMetadata = "palpate";
[[nodiscard]] mcap::Strings run_metadata(const Session& session, const std::string& recorded_by);
/// Metadata of this name: NODE and NODE_sessions ("left.device_node"), the version and the process
/// starts of each node so far.
inline constexpr const char* kNodesMetadata = "palpate_nodes";
/// Metadata of this name: messages_dropped, by the recorder's queue.
inline constexpr const char* kLossMetadata = "palpate_loss";

/// Versions and process starts of the nodes, from their batches.
class NodeVersions {
 public:
  /// True if the batch starts a new session of its node.
  bool note(const TelemetryMessage& message);
  [[nodiscard]] mcap::Strings metadata() const;

 private:
  struct Node {
    std::string version;
    std::uint64_t session_id = 0;
    std::uint64_t sessions = 0;
  };
  std::map<std::string, Node> nodes_;
};

/// Records a run in real time: every batch, every scene once, and its motion. On a slow disk
/// messages are dropped and counted; a full disk ends the recording and nothing else.
class Recording {
 public:
  /// Subscribes to SceneState and MeshFrame until close(). Throws SetupError if the file cannot be
  /// created.
  /// @param subscriber  must outlive it
  Recording(const RecordOptions& options, const Session& session, const std::string& recorded_by,
            TelemetrySubscriber& subscriber);
  /// Closes.
  ~Recording();
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  /// @param payload  the message as received
  void take(const TelemetryMessage& message, std::span<const std::byte> payload);
  /// Writes the queued messages and the summary.
  void close();

  /// The file's error, reported once.
  [[nodiscard]] std::optional<std::string> take_error();

 private:
  struct Item {
    std::size_t channel = 0;
    std::uint64_t log_time_ns = 0;
    std::string payload{};
    mcap::Strings nodes{};  // not empty: metadata instead of a message
  };

  /// The wall clock of the begin of the recording, which went on without a step.
  [[nodiscard]] std::uint64_t log_time_ns() const;
  /// When a marker was set, on that clock.
  [[nodiscard]] std::uint64_t log_time_of(const Marker& marker) const;
  void take_markers(const RunState& run);
  /// False if the queue is full: the item is dropped and counted.
  bool push(Item&& item);
  void write_until(const std::stop_token& stop);
  void write(std::vector<Item>& items);

  SteadyClock clock_;
  TimePoint began_at_ = clock_.now();
  std::uint64_t begin_ns_ = wall_clock_ns();
  McapWriter writer_;
  TelemetrySubscriber& subscriber_;
  NodeVersions versions_;
  std::optional<std::pair<std::uint64_t, std::uint64_t>> scene_;  // newest: session id, revision
  std::uint64_t newest_marker_ns_ = begin_ns_;
  std::optional<std::uint64_t> run_;  // session id of the markers' host

  std::mutex mutex_;
  std::condition_variable_any filled_;
  std::vector<Item> queue_;
  std::size_t queued_bytes_ = 0;
  std::uint64_t dropped_ = 0;
  std::optional<std::string> error_;
  std::jthread thread_;  // last: ends before what it uses
};

}  // namespace palpate::viewer
