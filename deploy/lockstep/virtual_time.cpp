#include "deploy/lockstep/virtual_time.h"

#include <algorithm>
#include <utility>

namespace palpate {

bool VirtualTime::Later::operator()(const Event& a, const Event& b) const {
  if (a.when != b.when) return a.when > b.when;
  if (a.rank != b.rank) return a.rank > b.rank;
  return a.order > b.order;
}

void VirtualTime::schedule(TimePoint when, int rank, Action action) {
  events_.push_back({std::max(when, now_), rank, order_++, std::move(action)});
  std::push_heap(events_.begin(), events_.end(), Later{});
}

bool VirtualTime::run_next(TimePoint deadline) {
  if (events_.empty() || events_.front().when > deadline) return false;
  std::pop_heap(events_.begin(), events_.end(), Later{});
  Event event = std::move(events_.back());
  events_.pop_back();

  // a nested wait may have advanced the time beyond this event
  now_ = std::max(now_, event.when);
  event.action();
  return true;
}

void VirtualTime::sleep_until(TimePoint deadline) {
  while (run_next(deadline)) {
  }
  now_ = std::max(now_, deadline);
}

void VirtualTime::run_one_until(TimePoint deadline) {
  if (!run_next(deadline)) now_ = std::max(now_, deadline);
}

}  // namespace palpate
