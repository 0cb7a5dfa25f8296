// SPDX-License-Identifier: Apache-2.0
// process_links.h — the ZeroMQ contexts of one process.
#pragma once

#include <span>

#include "common/link/security/keys.h"
#include "common/link/socket/zmq_context.h"
#include "common/session/session.h"

namespace palpate {

/// The session's rules for tcp, with the keys of `roles`, and of `optional` those that this host
/// has. Throws SetupError if a key of `roles` is missing.
[[nodiscard]] inline TcpRules tcp_rules(const SecurityConfig& security,
                                        std::initializer_list<KeyRole> roles,
                                        std::initializer_list<KeyRole> optional = {}) {
  TcpRules rules{.may_be_plain = security.may_be_plain};
  if (!security.key_folder.empty()) {
    rules.keys = std::make_shared<const LinkKeys>(
        load_link_keys(security.key_folder, std::span(roles.begin(), roles.size()),
                       std::span(optional.begin(), optional.size())));
  }
  return rules;
}

/// Hops 1 and 4 have an I/O thread of their own, with real-time priority if permitted. All other
/// links share a thread of ordinary priority, so that viewers and a remote physics_node cannot
/// delay the tick. Nodes that run in one process over inproc:// share one ProcessLinks.
struct ProcessLinks {
  explicit ProcessLinks(const RealtimeConfig& realtime, const TcpRules& tcp = {})
      : exchange(realtime, tcp), side(tcp) {}
  ZmqContext exchange;
  ZmqContext side;
};

}  // namespace palpate
