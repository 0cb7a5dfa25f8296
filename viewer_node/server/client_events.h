// client_events.h — what web clients did, handed from the server's thread to the viewer's.
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

namespace palpate::viewer {

struct ClientEvent {
  enum class Kind : std::uint8_t { kSubscribed, kHandTarget, kRunRequest, kTissueChange, kLeft };
  Kind kind = Kind::kLeft;
  std::uint64_t client = 0;
  std::size_t channel = 0;  ///< kSubscribed
  std::string payload{};    ///< kHandTarget, kRunRequest, kTissueChange: a protobuf message
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
  std::mutex mutex_;
  std::vector<ClientEvent> waiting_;
};

}  // namespace palpate::viewer
