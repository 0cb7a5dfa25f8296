// SPDX-License-Identifier: Apache-2.0
// trial_launch.h — one trial in real time: `palpate launch` until its task ends.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace palpate {

struct TrialLaunch {
  std::string session_file;
  std::vector<std::string> overrides{};
  std::optional<double> seconds{};
  std::string recording;
  /// File of what the processes say: warnings would tell the condition.
  std::string messages;
  bool is_quiet = false;
};

/// Runs it as a process of its own, with this terminal but for its messages, and waits for its end.
/// False: it failed or was stopped by a signal to this process or by Ctrl-C. Throws
/// std::runtime_error if it cannot be started or its messages cannot be written.
[[nodiscard]] bool launch_trial(const TrialLaunch& trial);

/// Why a trial may have failed, in words that tell nothing of its condition: the folder cannot be
/// written, an address is in use, a device is missing. @param messages  its file
[[nodiscard]] std::vector<std::string> harmless_causes(const std::filesystem::path& folder,
                                                       const std::filesystem::path& messages);

}  // namespace palpate
