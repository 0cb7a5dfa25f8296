// recording.h — hop 5 into an MCAP file: every batch as it came, the scene, the session, who ran.
//
//   in   hop 5  telemetry of all nodes, SceneState, MeshFrame     out  file
//
// Threads: take() belongs to one; the file to one of its own, with a queue between them.
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
#include <vector>

#include "common/session/session.h"
#include "common/link/telemetry_subscriber.h"
#include "viewer_node/recording/mcap_writer.h"

namespace palpate::viewer {

/// As given on the command line.
struct RecordOptions {
  std::string file{};  ///< empty: none
  bool may_overwrite = false;
};

/// /device, /mofc, /physics, /scene_state, /mesh: protobuf messages of hop 5 without the kind byte;
/// in the order of TelemetryMessage's alternatives. A batch says of which side it is.
[[nodiscard]] std::vector<mcap::Channel> recorded_channels();

/// Metadata of this name: session (text as it counts), session_name, session_file, controller,
/// seed, sides (their names with commas between; "" of one device), recorded_by, version (of the
/// recording program), protocol_major.
inline constexpr const char* kRunMetadata = "palpate";
[[nodiscard]] mcap::Strings run_metadata(const Session& session, const std::string& recorded_by);
/// Metadata of this name: NODE and NODE_sessions ("left.device_node"), the version and the process
/// starts of each node heard so far.
inline constexpr const char* kNodesMetadata = "palpate_nodes";
/// Metadata of this name: messages_dropped, by the recorder's queue.
inline constexpr const char* kLossMetadata = "palpate_loss";

/// Versions and process starts, from the batches.
class NodeVersions {
 public:
  /// True if this told something new.
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

/// A run in real time. Asks for every batch, the scene and what moves of it. A slow disk costs
/// messages, which are counted; a full one ends the recording, nothing else.
class Recording {
 public:
  /// Throws SetupError if the file cannot be made.
  Recording(const RecordOptions& options, const Session& session, const std::string& recorded_by,
            TelemetrySubscriber& subscriber);
  /// Closes.
  ~Recording();
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;

  /// @param payload  the message as it came
  void take(const TelemetryMessage& message, std::span<const std::byte> payload);
  /// Writes what is queued, and the summary.
  void close();

  /// What went wrong with the file, once.
  [[nodiscard]] std::optional<std::string> take_error();

 private:
  struct Item {
    std::size_t channel = 0;
    std::uint64_t log_time_ns = 0;
    std::string payload{};
    mcap::Strings nodes{};  // not empty: metadata instead of a message
  };

  void push(Item&& item);
  void write_until(const std::stop_token& stop);
  void write(std::vector<Item>& items);

  McapWriter writer_;
  NodeVersions versions_;

  std::mutex mutex_;
  std::condition_variable_any filled_;
  std::vector<Item> queue_;
  std::size_t queued_bytes_ = 0;
  std::uint64_t dropped_ = 0;
  std::optional<std::string> error_;
  std::jthread thread_;  // last: ends before what it uses
};

}  // namespace palpate::viewer
