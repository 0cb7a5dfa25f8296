// web_server.h — the page and the Foxglove WebSocket on one TCP port, for any number of clients.
// Boost.Beast, hidden; a thread of its own, of ordinary priority.
//
// Limits: 16 WebSockets, 64 connections; 8 KiB of request header, 64 KiB of message from a client;
// 10 s for a request, 30 s of silence. No body, no compression of messages, no TLS.
// A client that reads too slowly loses its oldest data, is told so, and is counted; nobody waits.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "viewer_node/server/foxglove_client.h"
#include "viewer_node/server/web_rules.h"

namespace palpate::viewer {

struct WebServerConfig {
  std::string address = "127.0.0.1";  ///< in figures
  std::uint16_t port = 8765;          ///< 0: any free one
  /// If the port is in use: a free one instead. Otherwise that is the user's problem.
  bool may_move = false;
  WebRules rules{};
};

/// One message, shared by all who get it.
using Payload = std::shared_ptr<const std::string>;

class WebServer {
 public:
  /// Listens. Throws SetupError. `description` is that of every client.
  WebServer(const WebServerConfig& config, ServerDescription description);
  ~WebServer();
  WebServer(const WebServer&) = delete;
  WebServer& operator=(const WebServer&) = delete;

  [[nodiscard]] std::uint16_t port() const;
  /// "http://127.0.0.1:8765/"
  [[nodiscard]] std::string url() const;

  // All of these return at once. Call them from one thread.

  /// Whether anybody subscribes to the channel.
  [[nodiscard]] bool is_watched(std::size_t channel) const;
  /// To all who subscribe. @param log_time_ns  since 1970
  void publish(std::size_t channel, std::uint64_t log_time_ns, Payload payload);
  /// To one, if it subscribes; not dropped if it is slow.
  void send_to(std::uint64_t client, std::size_t channel, std::uint64_t log_time_ns,
               Payload payload);
  /// A text of the protocol (status_text) to one client.
  void tell(std::uint64_t client, std::string text);

  /// What /metrics answers from now on.
  void set_metrics(std::string text);

  /// What clients did since the last call, in order.
  struct Event {
    enum class Kind : std::uint8_t { kSubscribed, kHandTarget, kLeft };
    Kind kind = Kind::kLeft;
    std::uint64_t client = 0;
    std::size_t channel = 0;    ///< kSubscribed
    std::string hand_target{};  ///< kHandTarget: its newest, a protobuf message
  };
  [[nodiscard]] std::vector<Event> take_events();

  struct Counters {
    std::uint32_t clients = 0;  ///< WebSockets, now
    std::uint64_t dropped = 0;  ///< messages not sent to clients that were too slow
    std::uint64_t refused = 0;  ///< requests and connections
  };
  [[nodiscard]] Counters counters() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::viewer
