// process.h — viewer_node connected to the world: telemetry in, text and files out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "common/link/telemetry_subscriber.h"
#include "common/process/process_links.h"
#include "common/process/run_node.h"
#include "viewer_node/recording/recording.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/web_process.h"

namespace palpate::viewer {

struct ViewerOptions {
  std::string csv_file;  ///< empty: none; each side has its own, see csv_file_of()
  RecordOptions record{};
  std::string plotjuggler{};  ///< endpoint; empty: none. Shows the first side only
  bool is_quiet = false;      ///< no status line
  WebOptions web{};
};

/// Subscribes to the nodes of the session, of all its sides.
class TelemetryFeed {
 public:
  TelemetryFeed(const Session& session, const Clock& clock, ProcessLinks& links);
  /// Called for every message taken, with the protobuf bytes as they came; optional.
  std::function<void(const TelemetryMessage&, std::span<const std::byte> payload)> on_message;

  /// Takes what arrived, waiting for it until `deadline`.
  /// @param mirrors  of each of session.sides
  void pump(std::span<TelemetryMirror> mirrors, TimePoint deadline);
  /// SceneState and MeshFrame come on request only.
  [[nodiscard]] TelemetrySubscriber& subscriber() { return subscriber_; }
  [[nodiscard]] std::uint64_t rejected() const { return subscriber_.rejected(); }

 private:
  std::vector<std::string> sides_;
  TelemetrySubscriber subscriber_;
  TelemetryMessage message_;
};

/// Serves the page too, unless the session or the options say otherwise.
/// Runs until context.stop; attaches and detaches at any time, any number of them at once. The
/// status line is rewritten in place on a terminal, printed line by line elsewhere. Throws
/// SetupError.
void run_process(NodeContext& context, ProcessLinks& links, const ViewerOptions& options);

}  // namespace palpate::viewer
