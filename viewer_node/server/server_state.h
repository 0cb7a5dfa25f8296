// server_state.h — what the connections and clients of one web server share. On the server's
// thread, except for the atomics and `events`.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "viewer_node/server/client_events.h"
#include "viewer_node/server/foxglove_client.h"
#include "viewer_node/server/web_rules.h"

namespace palpate::viewer {

class SocketClient;

struct ServerState {
  ServerState(WebRules allowed, ServerDescription described)
      : rules(std::move(allowed)),
        description(std::move(described)),
        subscribers(description.channels.size()) {}

  const WebRules rules;
  const ServerDescription description;

  std::size_t connections = 0;  ///< HTTP and WebSocket
  std::map<std::uint64_t, std::shared_ptr<SocketClient>> clients{};
  std::uint64_t next_client = 1;
  std::string metrics{};  ///< the body of /metrics

  std::vector<std::atomic<std::uint32_t>> subscribers;  ///< by channel
  std::atomic<std::uint32_t> client_count{0};
  std::atomic<std::uint64_t> dropped{0};  ///< messages
  std::atomic<std::uint64_t> refused{0};  ///< requests and connections
  ClientEvents events{};
};

}  // namespace palpate::viewer
