// zap_handler.h — the doorkeeper of one ZeroMQ context: answers libzmq's question whether a peer's
// key may use a socket (ZAP, RFC 27), and counts who was turned away, there or in the handshake
// before. On a thread of its own, of ordinary priority.
#pragma once

#include <atomic>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>
#include <zmq.hpp>

#include "common/link/keys.h"

namespace palpate {

enum class Refusal : std::uint8_t {
  kUnknownKey,      ///< not in allowed.keys
  kWrongRole,       ///< listed, but not for this link
  kNoKey,           ///< speaks ZeroMQ in plain text
  kNoZmtp,          ///< speaks something else, or an old ZeroMQ
  kLeft,            ///< went away in the handshake, as plain text does when it is quick
  kBadHandshake,    ///< expects another server key, or breaks the protocol
  kRefusedByOther,  ///< this program's own key, by the binding end
  kOtherUnknown,    ///< the binding end does not have the key expected of it
};
/// In words a user can act on.
[[nodiscard]] const char* explain(Refusal refusal);

/// Who was turned away, since the start. Any thread.
class RefusedPeers {
 public:
  struct Count {
    std::uint64_t count = 0;
    std::string address{};  ///< of the latest; "" if not known
  };
  using Counts = std::map<std::pair<std::string_view, Refusal>, Count>;  ///< by link and reason

  void count(std::string_view link, Refusal refusal, const std::string& address);
  [[nodiscard]] Counts counts() const;
  [[nodiscard]] std::uint64_t total() const { return total_.load(std::memory_order_relaxed); }

 private:
  mutable std::mutex mutex_;
  Counts counts_;
  std::atomic<std::uint64_t> total_{0};
};

/// The answer to one request: what the handler sends, and whom it turned away.
struct ZapVerdict {
  std::string status;  ///< "200", "400": no, "500": not a request
  std::string text;
  const LinkRoles* link = nullptr;  ///< nullptr where the request names none
  std::optional<Refusal> refusal{};
};
/// @param frames  of a request: version, request id, domain (the link's session field), address,
///                identity, mechanism, credentials (the public key, 32 bytes)
[[nodiscard]] ZapVerdict judge(const std::vector<std::string>& frames, const AllowedKeys& allowed);

class ZapHandler {
 public:
  /// Answers from now on: make it before the first socket that asks.
  ZapHandler(zmq::context_t& context, const AllowedKeys& allowed, RefusedPeers& refused);
  ~ZapHandler();
  ZapHandler(const ZapHandler&) = delete;
  ZapHandler& operator=(const ZapHandler&) = delete;

  /// Ends the watching of a socket; before it is closed.
  struct StopWatching {
    void operator()(void* socket) const noexcept;
  };
  using Watched = std::unique_ptr<void, StopWatching>;
  /// Counts the handshakes of this socket that fail. Before it is attached.
  [[nodiscard]] Watched watch(zmq::socket_t& socket, std::string_view link, bool is_server);

 private:
  struct Monitor;

  void run();
  void answer();
  void take_events(Monitor& monitor);

  zmq::context_t& context_;
  const AllowedKeys& allowed_;
  RefusedPeers& refused_;
  zmq::socket_t requests_;
  std::mutex mutex_;  // of the next four
  zmq::socket_t wake_;
  std::list<Monitor> new_monitors_;
  bool is_stopping_ = false;
  int monitors_made_ = 0;
  zmq::socket_t woken_;
  std::thread thread_;
};

}  // namespace palpate
