// pressing_session.h — a session under `palpate launch` whose hand, or hands, touch tissue again
// and again, watched by a viewer: what the fault matrix does its faults to.
#pragma once

#include <sys/types.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/core/clock.h"
#include "common/session/session.h"
#include "common/process/process_links.h"
#include "tests/support/pressing_hand.h"
#include "tests/support/program.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"

namespace palpate::test {

/// The hand of pressing_hand.h under mode guard.
class PressingSession {
 public:
  /// @param arguments  more of them for `palpate launch`
  /// @param sides      one hand each, which all do the same; none: one hand
  explicit PressingSession(const std::string& name,
                           const std::vector<std::string>& arguments = {"--no-viewer"},
                           const std::vector<std::string>& sides = {});

  /// Looks on until the hand presses, with 0.5 s of it left; whether it came to that.
  /// @param side  place in `sides`
  bool until_pressing(std::size_t side = 0);
  /// The same of all hands at once: as long as their devices were started together.
  bool until_all_pressing();
  /// The process of a node that launch started, the `count`-th time.
  pid_t node(const std::string& name, int count = 1);
  /// What launch counted when it ended in order: restarts by node.
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
  SteadyClock clock_;  // one host: the same as the nodes'
  ProcessLinks links_{{.priority = 0, .cpu = -1}};
  std::optional<Watcher> watcher_;
  std::optional<Program> launch_;
};

}  // namespace palpate::test
