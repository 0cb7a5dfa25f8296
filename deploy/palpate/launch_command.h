// launch_command.h — `palpate launch`: the nodes as processes, and the figures of the run.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "viewer_node/recording/recording.h"

namespace palpate {

struct LaunchCommand {
  std::string session_file;
  std::vector<std::string> overrides;
  std::optional<double> seconds;
  std::string csv_file;   ///< empty: none
  std::string json_file;  ///< empty: none; "-": standard output, which the viewer then leaves alone
  viewer::RecordOptions record{};
  bool is_realtime = true;
  bool is_insecure = false;
  std::set<std::string> nodes = {"device", "mofc", "physics", "viewer"};  ///< those that run here
  bool is_together = false;

  /// Runs until the time is up or a signal comes; without figures where the session has keys and
  /// this machine not the viewer's. Throws SetupError.
  /// @return exit status
  [[nodiscard]] int run() const;
};

}  // namespace palpate
