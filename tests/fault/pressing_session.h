// pressing_session.h — a session under `palpate launch` whose hand, or hands, touch tissue again
// and again, watched by a viewer: what the fault matrix does its faults to.
#pragma once

#include <sys/types.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/core/clock.h"
#include "common/core/session.h"
#include "common/runtime/process_links.h"
#include "tests/support/program.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"

namespace palpate::test {

/// The hand comes from above, presses for 1.2 s and comes again: its spring, 400 N/m, pulls it
/// 7.5 mm into tissue of 200 N/m, so that 5 mm and 1 N are left. It comes again because a machine
/// that is busy may take the force away for a moment: the hand sinks in without giving energy, and
/// the clamp rightly gives no more back.
class PressingSession {
 public:
  static constexpr double kTissueNewtonPerM = 200.0;
  static constexpr double kPressNewton = 1.0;
  static constexpr double kPressedTargetM = -0.0075;

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

  [[nodiscard]] const std::vector<viewer::TickRow>& rows(std::size_t side = 0) const {
    return watcher_->rows(side);
  }
  [[nodiscard]] const Session& session() const { return session_; }
  [[nodiscard]] const std::string& file() const { return file_; }
  [[nodiscard]] Watcher& watcher() { return *watcher_; }
  [[nodiscard]] Program& launch() { return *launch_; }
  [[nodiscard]] TimePoint now() const { return clock_.now(); }

 private:
  [[nodiscard]] bool presses(std::size_t side) const;

  TempFolder files_;
  std::string file_;
  Session session_;
  SteadyClock clock_;  // one host: the same as the nodes'
  ProcessLinks links_{{.priority = 0, .cpu = -1}};
  std::optional<Watcher> watcher_;
  std::optional<Program> launch_;
};

/// |F| on the hand of that row.
[[nodiscard]] inline double newton(const viewer::TickRow& row) {
  return row.device.force_on_hand_newton.norm();
}
/// The device's tick was answered out of a physics that is heard.
[[nodiscard]] bool is_fresh(const viewer::TickRow& row);

}  // namespace palpate::test
