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
#include <utility>

#include "viewer_node/server/send_queue.h"
#include "viewer_node/server/server_state.h"

namespace palpate::viewer {

/// A connection after its upgrade. What was received behind the request is read first.
class UpgradedStream : public boost::beast::buffered_read_stream<boost::beast::tcp_stream,
                                                                 boost::beast::flat_buffer> {
 public:
  using buffered_read_stream::buffered_read_stream;
};

// The WebSocket closes its connection with these, found by the type of the stream.
inline void teardown(boost::beast::role_type role, UpgradedStream& stream,
                     boost::system::error_code& error) {
  using boost::beast::websocket::teardown;
  teardown(role, stream.next_layer(), error);
}
template <class Handler>
void async_teardown(boost::beast::role_type role, UpgradedStream& stream, Handler&& handler) {
  using boost::beast::websocket::async_teardown;
  async_teardown(role, stream.next_layer(), std::forward<Handler>(handler));
}

class SocketClient : public std::enable_shared_from_this<SocketClient> {
 public:
  using Request = boost::beast::http::request<boost::beast::http::empty_body>;

  /// `server` must outlive it. @param received  behind the request
  SocketClient(ServerState& server, CountedConnection counted, boost::beast::tcp_stream&& stream,
               const boost::beast::flat_buffer& received)
      : server_(server), counted_(std::move(counted)), socket_(std::move(stream)) {
    ++server_.sockets;
    boost::beast::flat_buffer& buffer = socket_.next_layer().buffer();
    buffer.commit(boost::asio::buffer_copy(buffer.prepare(received.size()), received.data()));
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
  void unsubscribe(std::size_t channel);
  void queue(OutgoingMessage message);
  void write();
  void disconnect();
  void bound_unread_of_all();
  void count_unread();
  [[nodiscard]] std::uint64_t id() const { return protocol_->id(); }

  ServerState& server_;
  CountedConnection counted_;
  boost::beast::websocket::stream<UpgradedStream> socket_;
  boost::beast::flat_buffer buffer_;
  std::optional<FoxgloveClient> protocol_;  // from begin() on
  SendQueue queue_;
  std::size_t counted_bytes_ = 0;  // of the queue, in server_.unread_bytes
  std::size_t detail_ = 0;         // 0: the finest
  unsigned in_time_ = 0;  // messages with details that the client has read in time, in a row
  std::chrono::steady_clock::time_point next_notice_{};
};

}  // namespace palpate::viewer
