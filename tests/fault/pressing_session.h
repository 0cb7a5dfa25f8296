// SPDX-License-Identifier: Apache-2.0
// pressing_session.h — a session under `palpate launch` whose hands press into tissue repeatedly,
// with a viewer: the subject of the fault matrix.
#pragma once

#include <sys/types.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/core/clock.h"
#include "common/process/process_links.h"
#include "common/session/session.h"
#include "tests/support/pressing_hand.h"
#include "tests/support/program.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"

namespace palpate::test {

/// The hand of pressing_hand.h in mode guard.
class PressingSession {
 public:
  /// @param arguments  further arguments of `palpate launch`
  /// @param sides      one hand each, all with the same path; none: one hand
  explicit PressingSession(const std::string& name,
                           const std::vector<std::string>& arguments = {"--no-viewer"},
                           const std::vector<std::string>& sides = {});

  /// Waits until the hand presses, with 0.5 s of the press left; false at the deadline.
  /// @param side  index in `sides`
  bool until_pressing(std::size_t side = 0);
  /// Waits until the first hand presses while the others touch; their devices must have started
  /// together. A full press of all at once is rare on a busy machine.
  bool until_pressing_while_others_touch();
  /// The `count`-th process of a node that launch started.
  pid_t node(const std::string& name, int count = 1);
  /// Ends launch in order.
  /// @return restarts by node
  [[nodiscard]] std::map<std::string, int> stop_and_count_restarts();

  [[nodiscard]] const std::vector<TickRow>& rows(std::size_t side = 0) const {
    return watcher_->rows(side);
  }
  [[nodiscard]] const Session& session() const { return session_; }
  [[nodiscard]] const std::string& file() const { return file_; }
  [[nodiscard]] Watcher& watcher() { return *watcher_; }
  [[nodiscard]] Program& launch() { return *launch_; }
  [[nodiscard]] TimePoint now() const { return clock_.now(); }

 private:
  TempFolder files_;
  std::string file_;
  Session session_;
  SteadyClock clock_;  // the clock of the nodes too: one host
  ProcessLinks links_{{.priority = 0, .cpu = -1}};
  std::optional<Watcher> watcher_;
  std::optional<Program> launch_;
};

}  // namespace palpate::test
