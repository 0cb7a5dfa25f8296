// SPDX-License-Identifier: Apache-2.0
// zap_handler.h — access control of one ZeroMQ context: answers libzmq's requests whether a peer's
// key may use a socket (ZAP, RFC 27), and counts the peers that it refuses.
#pragma once

#include <optional>
#include <string>
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

/// Used by one thread, which calls answer() when requests() is readable.
class ZapHandler {
 public:
  /// Must be created, and its thread must run, before the first socket with keys.
  ZapHandler(zmq::context_t& context, const AllowedKeys& allowed, RefusedPeers& refused);

  [[nodiscard]] zmq::socket_t& requests() { return requests_; }
  void answer();

 private:
  const AllowedKeys& allowed_;
  RefusedPeers& refused_;
  zmq::socket_t requests_;
};

/// Reads all parts of the next message; false if there is none.
[[nodiscard]] bool receive_parts(zmq::socket_t& socket, std::vector<std::string>& parts);

}  // namespace palpate
