// SPDX-License-Identifier: Apache-2.0
// client_events.h — what web clients did, handed from the server's thread to the viewer's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <tuple>
#include <vector>

namespace palpate::viewer {

struct ClientEvent {
  enum class Kind : std::uint8_t {
    kSubscribed,
    kHandTarget,
    kRunRequest,
    kTissueChange,
    kAcknowledgement,
    kLeft,
    kFailed,  ///< of no client: the server could not do something
  };
  Kind kind = Kind::kLeft;
  std::uint64_t client = 0;
  std::size_t channel = 0;  ///< kSubscribed; of a kHandTarget, the side of the session
  /// kHandTarget, kRunRequest, kTissueChange, kAcknowledgement: a protobuf message; kFailed: why
  std::string payload{};
};

/// Bounded by the number of clients and channels, whatever the clients send. Any thread.
class ClientEvents {
 public:
  /// Requests of one client that wait for take(); further ones are dropped.
  static constexpr int kMostRequests = 16;

  /// Appends; replaces a waiting hand target of the same client, ignores a repeated subscription.
  void add(ClientEvent event);
  /// All events since the last call, in order.
  [[nodiscard]] std::vector<ClientEvent> take();

 private:
  using Key = std::tuple<ClientEvent::Kind, std::uint64_t, std::size_t>;  // client, channel

  std::mutex mutex_;
  std::vector<ClientEvent> waiting_;
  std::map<Key, std::size_t> places_;  // in waiting_, of what is replaced
  std::map<Key, int> requests_;        // that wait; without a channel
};

}  // namespace palpate::viewer
