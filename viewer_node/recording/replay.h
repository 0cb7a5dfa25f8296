// SPDX-License-Identifier: Apache-2.0
// replay.h — `palpate replay`: publishes a recording as a live session, for any number of viewers.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "common/session/session.h"
#include "viewer_node/recording/recording_file.h"

namespace palpate {

struct ReplayOptions {
  std::string session_file;  ///< whose links are used; empty: those of the recorded session
  std::vector<std::string> overrides;
  double speed_ratio = 1.0;        ///< > 0
  double start_s = 0.0;            ///< ≥ 0
  std::optional<double> wait_s{};  ///< for a viewer, then starts without; empty: until there is one
  bool is_insecure = false;        ///< allows tcp beyond loopback without keys
  bool loops = false;
  bool is_quiet = false;  ///< prints only that it waits
  /// Called once, when all is published; starts a viewer whose page shows this replay, and returns
  /// whether it did. Signals to stop are blocked. The session lives until it is called no more.
  std::function<bool(const Session&)> start_page = {};
};

/// Publishes hop 5 at the nodes' endpoints, and the state of the replay; viewers may pause it, move
/// it and change its speed (hop 7). Starts with the first viewer, or when its own page is opened.
/// Ends on SIGINT, SIGTERM or SIGHUP, and with the recording, unless its page is open or a viewer
/// has controlled it: then it pauses at the end.
/// Each pass, also after a move, uses new session ids, like restarted nodes. Throws SetupError, for
/// example while nodes of that session run.
void run_replay(const ReplayOptions& options, RecordingFile& recording);

}  // namespace palpate
