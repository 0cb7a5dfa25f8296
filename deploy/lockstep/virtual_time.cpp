// SPDX-License-Identifier: Apache-2.0
#include "deploy/lockstep/virtual_time.h"

#include <algorithm>
#include <utility>

namespace palpate {

void VirtualTime::schedule(TimePoint when, int rank, Action action) {
  if (free_actions_.empty()) {
    free_actions_.push_back(actions_.size());
    actions_.emplace_back();
  }
  Event event{std::max(when, now_), rank, free_actions_.back()};
  free_actions_.pop_back();
  actions_[event.action] = std::move(action);

  // before the events that come sooner, after those of the same time and rank
  std::size_t place = events_.size();
  events_.push_back(event);
  for (; place > 0; --place) {
    const Event& sooner = events_[place - 1];
    if (event.when < sooner.when || (event.when == sooner.when && event.rank < sooner.rank)) break;
    events_[place] = sooner;
  }
  events_[place] = event;
}

bool VirtualTime::run_next(TimePoint deadline) {
  if (events_.empty() || events_.back().when > deadline) return false;
  const Event event = events_.back();
  events_.pop_back();
  const Action action = std::move(actions_[event.action]);
  free_actions_.push_back(event.action);

  // a nested wait may have advanced the time beyond this event
  now_ = std::max(now_, event.when);
  action();
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
