// zap_handler.h — access control of one ZeroMQ context: answers libzmq's requests whether a peer's
// key may use a socket (ZAP, RFC 27), and counts the peers that were refused there or failed in the
// handshake before. Runs in its own thread of ordinary priority.
#pragma once

#include <atomic>
#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <vector>
#include <zmq.hpp>

#include "common/link/security/keys.h"
#include "common/link/security/refused_peers.h"

namespace palpate {

/// The answer to one request and, if the peer is refused, the reason.
struct ZapVerdict {
  std::string status;  ///< "200": allowed, "400": refused, "500": not a request
  std::string text;
  const LinkRoles* link = nullptr;  ///< nullptr if the request names no link
  std::optional<Refusal> refusal{};
};
/// @param frames  of a request: version, request id, domain (the link's session field), address,
///                identity, mechanism, credentials (the public key, 32 bytes)
[[nodiscard]] ZapVerdict judge(const std::vector<std::string>& frames, const AllowedKeys& allowed);

class ZapHandler {
 public:
  /// Answers requests from now on; must be created before the first socket with keys.
  ZapHandler(zmq::context_t& context, const AllowedKeys& allowed, RefusedPeers& refused);
  ~ZapHandler();
  ZapHandler(const ZapHandler&) = delete;
  ZapHandler& operator=(const ZapHandler&) = delete;

  /// Ends the monitoring of a socket; to be called before the socket is closed.
  struct StopWatching {
    void operator()(void* socket) const noexcept;
  };
  using Watched = std::unique_ptr<void, StopWatching>;
  /// Counts the failed handshakes of this socket. To be called before the socket is attached.
  [[nodiscard]] Watched watch(zmq::socket_t& socket, std::string_view link, bool is_server);
  /// Sockets that are being monitored. A closed socket is removed shortly after. Any thread.
  [[nodiscard]] int monitors() const { return monitors_.load(std::memory_order_relaxed); }

 private:
  struct Monitor;

  void run();
  void answer();
  void take_events(Monitor& monitor);

  zmq::context_t& context_;
  const AllowedKeys& allowed_;
  RefusedPeers& refused_;
  zmq::socket_t requests_;
  std::mutex mutex_;  // protects the next four
  zmq::socket_t wake_;
  std::list<Monitor> new_monitors_;
  bool is_stopping_ = false;
  int monitors_made_ = 0;
  std::atomic<int> monitors_{0};
  zmq::socket_t woken_;
  std::thread thread_;
};

}  // namespace palpate
