// pressing_session.h — a session under `palpate launch` whose hand touches tissue again and again,
// watched by a viewer: what the fault matrix does its faults to.
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

#include "common/core/clock.h"
#include "common/core/session.h"
#include "common/runtime/process_links.h"
#include "tests/support/pressing_hand.h"
#include "tests/support/program.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"

namespace palpate::test {

/// The hand of pressing_hand.h under mode guard.
class PressingSession {
 public:
  /// @param arguments  more of them for `palpate launch`
  explicit PressingSession(const std::string& name,
                           const std::vector<std::string>& arguments = {"--no-viewer"});

  /// Looks on until the hand presses, with 0.5 s of it left; whether it came to that.
  bool until_pressing();
  /// The process of a node that launch started, the `count`-th time.
  pid_t node(const std::string& name, int count = 1);
  /// What launch counted when it ended in order: restarts as "device 1, physics 0, …".
  [[nodiscard]] std::string stop_and_count_restarts();

  [[nodiscard]] const std::vector<viewer::TickRow>& rows() const { return watcher_->rows(); }
  [[nodiscard]] const Session& session() const { return session_; }
  [[nodiscard]] const std::string& file() const { return file_; }
  [[nodiscard]] Watcher& watcher() { return *watcher_; }
  [[nodiscard]] Program& launch() { return *launch_; }
  [[nodiscard]] TimePoint now() const { return clock_.now(); }

 private:
  TempFolder files_;
  std::string file_;
  Session session_;
  SteadyClock clock_;  // one host: the same as the nodes'
  ProcessLinks links_{{.priority = 0, .cpu = -1}};
  std::optional<Watcher> watcher_;
  std::optional<Program> launch_;
};

}  // namespace palpate::test
