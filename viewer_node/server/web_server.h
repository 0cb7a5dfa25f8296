// SPDX-License-Identifier: Apache-2.0
// web_server.h — the page and the Foxglove WebSocket on one TCP port, for any number of clients.
// Boost.Beast behind a private implementation, on a thread of its own, of ordinary priority.
//
// Limits: 16 WebSockets, or those of an audience; 48 connections more, of which a newcomer replaces
// one that waits for a request; 24 from one address; 8 KiB of request header, in 3 s; 64 KiB per
// message from a client; 30 s of silence; 32 MiB unread by one client, 64 MiB by all. No request
// bodies, no message compression, no TLS. A client that reads too slowly loses its oldest data,
// gets a status message and is counted; it delays no other client.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "viewer_node/server/client_events.h"
#include "viewer_node/server/foxglove_client.h"
#include "viewer_node/server/send_queue.h"
#include "viewer_node/server/web_limits.h"
#include "viewer_node/server/web_rules.h"

namespace palpate::viewer {

struct WebServerConfig {
  std::string address = "127.0.0.1";  ///< numeric
  std::uint16_t port = 8765;          ///< 0: any free port
  /// Of an inherited socket that listens on 127.0.0.1, in place of address and port; −1: none.
  int descriptor = -1;
  /// If the port is in use: take a free one instead of failing.
  bool may_move = false;
  /// 0: at most 16 WebSockets. Else an audience of at most so many, each of which gets the newest
  /// message of a channel, as fast as it reads, and is sent no message that a newer one has
  /// replaced.
  std::size_t audience = 0;
  /// Numeric addresses of reverse proxies: no limit on the connections of one of them.
  std::vector<std::string> proxies{};
  /// A client that takes none of its answer for so long is disconnected.
  std::chrono::milliseconds answer_timeout = kAnswerTimeout;
  WebRules rules{};
  /// Where the recordings are that may be downloaded, once set_recordings() allows it; empty: there
  /// are none.
  std::string record_folder{};
};

class WebServer {
 public:
  /// Starts to listen. Throws SetupError. @param description  sent to every client
  WebServer(const WebServerConfig& config, const ServerDescription& description);
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  [[nodiscard]] std::uint16_t port() const;
  /// "http://127.0.0.1:8765/"
  [[nodiscard]] std::string url() const;

  // All of these return at once. Call them from one thread.

  /// Whether any client subscribes to the channel.
  [[nodiscard]] bool has_subscriber(std::size_t channel) const;
  /// Sends to all subscribers. @param log_time_ns  since 1970
  void publish(std::size_t channel, std::uint64_t log_time_ns, Payload payload);
  /// Sends to all subscribers one of several details, the finest first: a client that has not read
  /// the message before gets a coarser one, later a finer one again.
  void publish(std::size_t channel, std::uint64_t log_time_ns, std::vector<Payload> details);
  /// Sends to one client if it subscribes; never dropped, even if the client is slow.
  void send_to(std::uint64_t client, std::size_t channel, std::uint64_t log_time_ns,
               Payload payload);
  /// Sends a text of the protocol (status_text) to one client.
  void send_text_to(std::uint64_t client, std::string text);

  /// Sets the body of /metrics.
  void set_metrics(std::string text);
  /// Sets the body of /verdict: JSON.
  void set_verdict(std::string json);

  /// Sets the body of /task: JSON.
  void set_task(std::string json);
  /// @see RecordingShelf::set()
  void set_recordings(bool may_be_read, std::string written);

  using Event = ClientEvent;
  /// What clients did since the last call, in order.
  [[nodiscard]] std::vector<Event> take_events();

  struct Counters {
    std::uint32_t clients = 0;  ///< WebSockets, now
    std::uint64_t dropped = 0;  ///< messages not sent to clients that were too slow
    std::uint64_t thinned = 0;  ///< messages of an audience replaced by newer ones
    std::uint64_t refused = 0;  ///< requests and connections
  };
  [[nodiscard]] Counters counters() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::viewer
