// virtual_time.h — lockstep: one thread, events in order of virtual time. A node that waits hands
// the thread to whatever is due next, so a wait inside a tick works as it does in real time.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "common/core/clock.h"

namespace palpate {

class VirtualTime final : public Clock {
 public:
  using Action = std::function<void()>;

  [[nodiscard]] TimePoint now() const noexcept override { return now_; }

  /// Runs `action` at `when` (at once in order if that has passed). Events of one instant run in
  /// order of `rank` (small first), then in order of scheduling.
  void schedule(TimePoint when, int rank, Action action);

  /// Runs every event due by `deadline`, then stands at `deadline`.
  void sleep_until(TimePoint deadline) override;

  /// Runs the next event if it is due by `deadline`; else stands at `deadline`. For waits: the
  /// caller looks again after each event.
  void run_one_until(TimePoint deadline);

 private:
  struct Event {
    TimePoint when;
    int rank;
    std::uint64_t order;
    Action action;
  };
  struct Later {
    bool operator()(const Event& a, const Event& b) const;
  };
  bool run_next(TimePoint deadline);

  TimePoint now_{};
  std::uint64_t order_ = 0;
  std::vector<Event> events_;  // heap, earliest first
};

}  // namespace palpate
