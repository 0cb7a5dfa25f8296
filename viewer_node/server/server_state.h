// SPDX-License-Identifier: Apache-2.0
// server_state.h — what the connections and clients of one web server share. On the server's
// thread, except for the atomics and `events`.
#pragma once

#include <atomic>
#include <boost/asio/ip/address.hpp>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "viewer_node/server/client_events.h"
#include "viewer_node/server/foxglove_client.h"
#include "viewer_node/server/recording_shelf.h"
#include "viewer_node/server/send_queue.h"
#include "viewer_node/server/web_limits.h"
#include "viewer_node/server/web_rules.h"

namespace palpate::viewer {

class HttpConnection;
class SocketClient;

struct ServerState {
  ServerState(WebRules allowed, ServerDescription described, std::size_t audience,
              std::chrono::milliseconds patience, RecordingShelf recordings)
      : rules(std::move(allowed)),
        description(std::move(described)),
        advertised(make_payload(advertisement(description))),
        most_clients(audience > 0 ? audience : kMaxClients),
        is_audience(audience > 0),
        answer_timeout(patience),
        shelf(std::move(recordings)),
        clients_of(description.channels.size()),
        subscribers(description.channels.size()) {}

  const WebRules rules;
  const ServerDescription description;
  const Payload advertised;        ///< the same for every client
  const std::size_t most_clients;  ///< WebSockets
  const bool is_audience;          ///< each client gets the newest, as fast as it reads
  const std::chrono::milliseconds answer_timeout;

  RecordingShelf shelf;

  std::size_t connections = 0;                                       ///< HTTP and WebSocket
  std::map<boost::asio::ip::address, std::size_t> connections_of{};  ///< by the peer's address
  std::list<HttpConnection*> waiting{};  ///< for a request; the longest first
  std::size_t sockets = 0;               ///< WebSockets, also those that shake hands
  std::map<std::uint64_t, std::shared_ptr<SocketClient>> clients{};
  /// Of these, the subscribers by channel.
  std::vector<std::map<std::uint64_t, SocketClient*>> clients_of;
  std::uint64_t next_client = 1;
  std::string metrics{};  ///< the body of /metrics
  std::string verdict{};  ///< the body of /verdict
  std::string task{};     ///< the body of /task

  std::vector<std::atomic<std::uint32_t>> subscribers;  ///< their number, by channel
  std::atomic<std::uint32_t> client_count{0};
  std::size_t unread_bytes = 0;           ///< that wait for all clients
  std::atomic<std::uint64_t> dropped{0};  ///< messages
  std::atomic<std::uint64_t> thinned{0};  ///< messages replaced by newer ones
  std::atomic<std::uint64_t> refused{0};  ///< requests and connections
  ClientEvents events{};
};

/// Counts one connection, as long as it lives.
class CountedConnection {
 public:
  /// `server` must outlive it.
  CountedConnection(ServerState& server, const boost::asio::ip::address& peer)
      : server_(&server), peer_(peer) {
    ++server.connections;
    ++server.connections_of[peer];
  }
  ~CountedConnection() {
    if (server_ == nullptr) return;
    --server_->connections;
    const auto of_peer = server_->connections_of.find(peer_);
    if (--of_peer->second == 0) server_->connections_of.erase(of_peer);
  }
  CountedConnection(CountedConnection&& other) noexcept
      : server_(std::exchange(other.server_, nullptr)), peer_(std::move(other.peer_)) {}
  CountedConnection(const CountedConnection&) = delete;
  CountedConnection& operator=(const CountedConnection&) = delete;
  CountedConnection& operator=(CountedConnection&&) = delete;

 private:
  ServerState* server_;
  boost::asio::ip::address peer_;
};

}  // namespace palpate::viewer
