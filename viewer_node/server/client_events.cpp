#include "viewer_node/server/client_events.h"

#include <algorithm>
#include <utility>

namespace palpate::viewer {

void ClientEvents::add(ClientEvent event) {
  const std::lock_guard lock(mutex_);
  if (event.kind == ClientEvent::Kind::kRunRequest ||
      event.kind == ClientEvent::Kind::kTissueChange) {
    const auto waiting =
        std::count_if(waiting_.begin(), waiting_.end(), [&](const ClientEvent& other) {
          return other.kind == event.kind && other.client == event.client;
        });
    if (waiting >= kMostRequests) return;
  } else if (event.kind != ClientEvent::Kind::kLeft) {
    const auto same = std::find_if(waiting_.begin(), waiting_.end(), [&](const ClientEvent& other) {
      return other.kind == event.kind && other.client == event.client &&
             other.channel == event.channel;
    });
    if (same != waiting_.end()) {
      same->payload = std::move(event.payload);
      return;
    }
  }
  waiting_.push_back(std::move(event));
}

std::vector<ClientEvent> ClientEvents::take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(waiting_, {});
}

}  // namespace palpate::viewer
