// process.h — viewer_node connected to the world: telemetry in, text and CSV out.
#pragma once

#include <string>

#include "common/runtime/process_links.h"
#include "common/runtime/run_node.h"
#include "viewer_node/telemetry_mirror.h"

namespace palpate::viewer {

struct ViewerOptions {
  std::string csv_file;   ///< empty: none
  bool is_quiet = false;  ///< no status line
};

/// Subscribes to the three nodes of the session.
class TelemetryFeed {
 public:
  TelemetryFeed(const LinksConfig& config, const Clock& clock, ProcessLinks& links);
  /// Takes what arrived, waiting for it until `deadline`.
  void pump(TelemetryMirror& mirror, TimePoint deadline);

 private:
  const Clock& clock_;
  TelemetrySubscriber subscriber_;
  TelemetryMessage message_;
};

/// Runs until context.stop; attaches and detaches at any time, any number of them at once. The
/// status line is rewritten in place on a terminal, printed line by line elsewhere. Throws
/// SetupError.
void run_process(NodeContext& context, ProcessLinks& links, const ViewerOptions& options);

}  // namespace palpate::viewer
