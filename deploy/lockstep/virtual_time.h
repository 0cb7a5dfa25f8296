// SPDX-License-Identifier: Apache-2.0
// virtual_time.h — the scheduler of lockstep runs: one thread executes events in order of virtual
// time. While a node waits, further events run, so that a wait within a tick behaves as in real
// time.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "common/core/clock.h"

namespace palpate {

class VirtualTime final : public Clock {
 public:
  using Action = std::function<void()>;

  [[nodiscard]] TimePoint now() const noexcept override { return now_; }

  /// Schedules `action` at `when`, or now if `when` has passed. Events of the same time run in
  /// order of `rank` (smallest first), then in order of scheduling.
  void schedule(TimePoint when, int rank, Action action);

  /// Runs every event due by `deadline`, then sets the time to `deadline`.
  void sleep_until(TimePoint deadline) override;

  /// Runs the next event if it is due by `deadline`; otherwise sets the time to `deadline`. Used to
  /// wait for a condition: the caller checks it after each event.
  void run_one_until(TimePoint deadline);

 private:
  struct Event {
    TimePoint when;
    int rank;
    std::size_t action;  // index
  };
  bool run_next(TimePoint deadline);

  TimePoint now_{};
  std::vector<Event> events_;  // the next one last; few, so new ones are sorted in
  std::vector<Action> actions_;
  std::vector<std::size_t> free_actions_;
};

}  // namespace palpate
