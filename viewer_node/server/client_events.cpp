// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/server/client_events.h"

#include <utility>

namespace palpate::viewer {

void ClientEvents::add(ClientEvent event) {
  using Kind = ClientEvent::Kind;
  const std::lock_guard lock(mutex_);
  if (event.kind == Kind::kRunRequest || event.kind == Kind::kTissueChange ||
      event.kind == Kind::kAcknowledgement) {
    int& waiting = requests_[{event.kind, event.client, 0}];
    if (waiting >= kMostRequests) return;
    ++waiting;
  } else if (event.kind != Kind::kLeft) {
    const auto [place, is_new] =
        places_.try_emplace({event.kind, event.client, event.channel}, waiting_.size());
    if (!is_new) {
      waiting_[place->second].payload = std::move(event.payload);
      return;
    }
  }
  waiting_.push_back(std::move(event));
}

std::vector<ClientEvent> ClientEvents::take() {
  const std::lock_guard lock(mutex_);
  places_.clear();
  requests_.clear();
  return std::exchange(waiting_, {});
}

}  // namespace palpate::viewer
