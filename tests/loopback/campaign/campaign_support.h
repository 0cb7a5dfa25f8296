// SPDX-License-Identifier: Apache-2.0
// campaign_support.h — a small campaign of hostile runs in a folder of its own, and the processes
// of a sweep.
#pragma once

#include <gtest/gtest.h>
#include <sys/types.h>

#include <algorithm>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/machine/places.h"
#include "tests/support/program.h"
#include "tests/support/temp_folder.h"

namespace palpate::test {

/// Two cells of 80 hostile runs of 1 s: a second or two of computing.
inline const std::string kSmallCampaign = R"(
name: "small"
session: ")" + test::source_dir() + R"(/deploy/sessions/hostile.txtpb"
seconds: 1
hostile {}
runs: 80
vary {
  name: "mode"
  options {
    option { name: "guard" }
    option { name: "none" set: "mofc.controller=none" set: "device.monitor=off" }
  }
}
vary { field: "hand.hostile.v_max_m_per_s" uniform { low: 0.05 high: 0.3 } }
report: "min_true_energy_j"
report: "max_force_n"
limit {
  quantity: "min_true_energy_j"
  at_least: -1
  where { quantity: "speed_ratio" at_most: 1 }
}
)";
inline constexpr int kSmallRuns = 160;

/// Children of a process that runs.
inline std::vector<pid_t> children_of(pid_t parent) {
  std::ifstream in("/proc/" + std::to_string(parent) + "/task/" + std::to_string(parent) +
                   "/children");
  std::vector<pid_t> children;
  for (pid_t child = 0; in >> child;) children.push_back(child);
  return children;
}

/// Lines of all logs of a folder: one for each run that was computed to its end.
inline int logged_lines(const std::filesystem::path& folder) {
  int lines = 0;
  if (!std::filesystem::exists(folder)) return 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".log") continue;
    const std::string text = text_of(entry.path());
    lines += static_cast<int>(std::count(text.begin(), text.end(), '\n'));
  }
  return lines;
}

class CampaignFolder : public testing::Test {
 protected:
  [[nodiscard]] std::string path(const std::string& name) const {
    return (files_.path() / name).string();
  }
  /// Arguments of a sweep into `folder`, with its table beside it.
  [[nodiscard]] std::vector<std::string> arguments_of(
      const std::string& folder, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments{"sweep",      campaign_, "--folder",
                                       path(folder), "--csv",   path(folder + ".csv")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  /// The table of a sweep that nothing disturbs.
  [[nodiscard]] std::string undisturbed() const {
    const Outcome outcome = run_program("palpate", arguments_of("undisturbed", {"--workers", "1"}));
    EXPECT_EQ(outcome.status, 0) << outcome.out << outcome.err;
    return text_of(path("undisturbed.csv"));
  }

  TempFolder files_;
  std::string campaign_ = files_.write("small.txtpb", kSmallCampaign);
};

}  // namespace palpate::test
