// SPDX-License-Identifier: Apache-2.0
// http_connection.h — one TCP connection of the web server: HTTP requests, until it ends or becomes
// a WebSocket client. On the server's thread.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <cstdint>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "viewer_node/server/recording_shelf.h"
#include "viewer_node/server/server_state.h"
#include "viewer_node/server/web_rules.h"

namespace palpate::viewer {

class HttpConnection : public std::enable_shared_from_this<HttpConnection> {
 public:
  /// `server` must outlive it.
  HttpConnection(ServerState& server, CountedConnection counted,
                 boost::asio::ip::tcp::socket&& socket);
  ~HttpConnection();
  HttpConnection(const HttpConnection&) = delete;
  HttpConnection& operator=(const HttpConnection&) = delete;

  /// Reads and answers requests until the connection ends or becomes a WebSocket.
  void read();
  /// Ends a connection that waits for a request.
  void give_way();

 private:
  void on_header(const boost::system::error_code& error);
  [[nodiscard]] WebRequest request() const;
  [[nodiscard]] WebDecision too_long() const;
  void become_client(std::string_view subprotocol);
  void answer(const WebDecision& decision, bool is_malformed);
  void write_part();
  /// Of the file that is downloaded, the next bytes into response_.
  void fill();
  /// Ends the answer if the client takes none of it in time.
  void await_progress();
  /// Bytes of answers that the client's kernel has acknowledged.
  [[nodiscard]] std::uint64_t taken_bytes();
  void on_written(const boost::system::error_code& error);
  void end();
  void stop_waiting();

  static constexpr std::size_t kMaxHeaderBytes = 8 << 10;
  static constexpr std::size_t kPartBytes = 256 << 10;

  ServerState& server_;
  CountedConnection counted_;
  std::optional<std::list<HttpConnection*>::iterator> waiting_;  // its place among them
  boost::beast::tcp_stream stream_;
  boost::beast::flat_buffer buffer_{2 * kMaxHeaderBytes};
  std::optional<boost::beast::http::request_parser<boost::beast::http::empty_body>> parser_;
  boost::beast::http::response<boost::beast::http::buffer_body> response_;
  std::string metrics_;  // the body of response_, if it is /metrics, /verdict, /task or /recordings
  std::optional<OpenFile> file_;  // that is downloaded
  std::string part_;              // of it, the body of response_ now
  std::optional<boost::beast::http::response_serializer<boost::beast::http::buffer_body>>
      serializer_;
  boost::asio::steady_timer progress_;  // while an answer is written
  bool is_answering_ = false;
  std::uint64_t sent_bytes_ = 0;  // to the kernel
};

}  // namespace palpate::viewer
