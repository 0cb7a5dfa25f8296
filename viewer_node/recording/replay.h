// replay.h — `palpate replay`: a recording as if it happened now, for any number of viewers.
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
  bool is_insecure = false;  ///< tcp beyond loopback without keys too
  bool loops = false;
};

/// Publishes hop 5 at the nodes' own endpoints, from the first viewer on, until the recording or
/// SIGINT, SIGTERM or SIGHUP ends it. Each pass has new session ids, as if the nodes had been
/// started again. Throws SetupError, for example while nodes of that session run.
void run_replay(const ReplayOptions& options);

}  // namespace palpate
