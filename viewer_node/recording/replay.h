// replay.h — `palpate replay`: publishes a recording as a live session, for any number of viewers.
#pragma once

#include <string>
#include <vector>

namespace palpate {

struct ReplayOptions {
  std::string file;
  std::string session_file;  ///< whose links are used; empty: those of the recorded session
  std::vector<std::string> overrides;
  double speed_ratio = 1.0;  ///< > 0
  double start_s = 0.0;      ///< ≥ 0
  bool is_insecure = false;  ///< allows tcp beyond loopback without keys
  bool loops = false;
};

/// Publishes hop 5 at the nodes' endpoints. Starts with the first viewer; ends with the recording
/// or on SIGINT, SIGTERM or SIGHUP. Each pass uses new session ids, like restarted nodes. Throws
/// SetupError, for example while nodes of that session run.
void run_replay(const ReplayOptions& options);

}  // namespace palpate
