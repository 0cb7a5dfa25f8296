// launch_command.h — `palpate launch`: the nodes as processes, and the figures of the run.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "viewer_node/recording.h"

namespace palpate {

struct LaunchCommand {
  std::string session_file;
  std::vector<std::string> overrides;
  std::optional<double> seconds;
  std::string csv_file;   ///< empty: none
  std::string json_file;  ///< empty: none; "-": standard output, which the viewer then leaves alone
  viewer::RecordOptions record{};
  bool is_realtime = true;
  bool has_viewer = true;
  bool is_together = false;

  /// Runs until the time is up or a signal comes. Throws SetupError.
  /// @return exit status
  [[nodiscard]] int run() const;
};

}  // namespace palpate
