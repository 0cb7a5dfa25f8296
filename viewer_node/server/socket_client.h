// SPDX-License-Identifier: Apache-2.0
// socket_client.h — one WebSocket client of the web server. On the server's thread.
#pragma once

#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "viewer_node/server/send_queue.h"
#include "viewer_node/server/server_state.h"

namespace palpate::viewer {

class SocketClient : public std::enable_shared_from_this<SocketClient> {
 public:
  using Request = boost::beast::http::request<boost::beast::http::empty_body>;

  /// `server` must outlive it.
  SocketClient(ServerState& server, CountedConnection counted, boost::beast::tcp_stream&& stream)
      : server_(server), counted_(std::move(counted)), socket_(std::move(stream)) {
    ++server_.sockets;
  }
  ~SocketClient() {
    --server_.sockets;
    server_.unread_bytes -= counted_bytes_;
  }
  SocketClient(const SocketClient&) = delete;
  SocketClient& operator=(const SocketClient&) = delete;

  /// Answers the upgrade and serves the client until its connection ends.
  void run(const Request& request, std::string_view subprotocol);

  /// Sends to the client if it subscribes to the channel.
  void publish(std::size_t channel, std::uint64_t log_time_ns, const Payload& payload,
               bool may_drop);
  /// The same of several details, the finest first: sends the one that the client's pace allows.
  void publish(std::size_t channel, std::uint64_t log_time_ns, std::span<const Payload> details);
  /// Sends a text message of the protocol.
  void send_text(std::string text);

 private:
  void begin();
  void end();
  void read();
  void take(FoxgloveClient::Outcome outcome);
  void queue(OutgoingMessage message);
  void write();
  void disconnect();
  void bound_unread_of_all();
  void count_unread();
  [[nodiscard]] std::uint64_t id() const { return protocol_->id(); }

  ServerState& server_;
  CountedConnection counted_;
  boost::beast::websocket::stream<boost::beast::tcp_stream> socket_;
  boost::beast::flat_buffer buffer_;
  std::optional<FoxgloveClient> protocol_;  // from begin() on
  SendQueue queue_;
  std::size_t counted_bytes_ = 0;  // of the queue, in server_.unread_bytes
  std::size_t detail_ = 0;         // 0: the finest
  unsigned in_time_ = 0;  // messages with details that the client has read in time, in a row
  std::chrono::steady_clock::time_point next_notice_{};
};

}  // namespace palpate::viewer
