// SPDX-License-Identifier: Apache-2.0
// process.h — viewer_node connected to the world: telemetry in, text and files out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/link/telemetry_subscriber.h"
#include "common/process/process_links.h"
#include "common/process/run_node.h"
#include "viewer_node/feed/side_index.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/live/feed.h"
#include "viewer_node/recording/recording.h"

namespace palpate::viewer {

struct ViewerOptions {
  std::string csv_file;       ///< empty: none; one file per side, see csv_file_of()
  RecordOptions record{};     ///< its may_overwrite is the table's, too
  std::string plotjuggler{};  ///< endpoint; empty: none. Shows the first side only
  std::optional<std::uint16_t> openigtlink{};  ///< port of this machine; none: no server
  bool is_quiet = false;                       ///< no status line
  WebOptions web{};
  std::string follow{};   ///< endpoint of a relay; empty: the nodes themselves
  std::string publish{};  ///< endpoint at which this viewer is a relay; empty: it is none
};

/// Subscribes to the nodes of the session, of all its sides, or to a relay.
class TelemetryFeed {
 public:
  /// @param relay  its endpoint; empty: none
  TelemetryFeed(const Session& session, const Clock& clock, ProcessLinks& links,
                const std::string& relay = {});
  /// Called for every message, with its protobuf bytes as received; optional.
  std::function<void(const TelemetryMessage&, std::span<const std::byte> payload)> on_message;

  /// Takes the messages that have arrived; waits for the first until `deadline`.
  /// @param mirrors  of each of session.sides
  void pump(std::span<TelemetryMirror> mirrors, TimePoint deadline);
  /// For SceneState and MeshFrame, which need a subscription.
  [[nodiscard]] TelemetrySubscriber& subscriber() { return subscriber_; }
  [[nodiscard]] std::uint64_t rejected() const { return subscriber_.rejected(); }

 private:
  SideIndex sides_;
  TelemetrySubscriber subscriber_;
  TelemetryMessage message_;
};

/// Serves the page too, unless the session or the options disable it. Runs until context.stop. Any
/// number of viewers may attach and detach at any time. The status line is rewritten in place on a
/// terminal and printed line by line elsewhere. Throws SetupError.
void run_process(NodeContext& context, ProcessLinks& links, const ViewerOptions& options);

}  // namespace palpate::viewer
