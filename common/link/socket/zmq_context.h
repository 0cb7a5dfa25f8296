// SPDX-License-Identifier: Apache-2.0
// zmq_context.h — libzmq's I/O thread and the rules for links over tcp.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <utility>
#include <zmq.hpp>

#include "common/core/clock.h"
#include "common/link/security/keys.h"
#include "common/link/security/refused_peers.h"
#include "common/link/security/zap_handler.h"
#include "common/link/socket/connection_monitor.h"
#include "common/session/link_config.h"

namespace palpate {

/// Security of links over tcp. With keys, links are encrypted (CURVE), each end authenticates the
/// other, and only the role for which a link is meant may connect. Without keys only loopback is
/// permitted.
struct TcpRules {
  std::shared_ptr<const LinkKeys> keys{};  ///< nullptr: no keys
  bool may_be_plain = false;               ///< permits unencrypted links beyond loopback
  /// Counts the refused peers of all contexts with these rules.
  std::shared_ptr<RefusedPeers> refused = std::make_shared<RefusedPeers>();
};

/// libzmq's I/O thread, shared by the sockets created from it, which it must outlive.
///
/// Use one context for the exchange (hops 1 and 4) and another one for everything else, so that
/// viewers cannot delay the loop.
class ZmqContext {
 public:
  /// Ordinary scheduling.
  ZmqContext() : ZmqContext(TcpRules{}) {}
  explicit ZmqContext(TcpRules tcp)
      : ZmqContext(RealtimeConfig{.priority = 0, .cpu = -1, .wait = WaitStrategy::kBlock},
                   std::move(tcp)) {}
  /// The I/O thread runs at SCHED_FIFO and on the given processor, each only if the process has the
  /// permission; libzmq aborts the process otherwise.
  explicit ZmqContext(const RealtimeConfig& realtime, TcpRules tcp = {});

  [[nodiscard]] bool is_realtime() const { return is_realtime_; }
  [[nodiscard]] bool is_pinned() const { return is_pinned_; }
  /// How sockets of this context wait for messages; kHybrid sleeps.
  [[nodiscard]] WaitStrategy wait() const { return wait_; }
  [[nodiscard]] zmq::context_t& get() { return context_; }
  [[nodiscard]] const TcpRules& tcp() const { return tcp_; }
  /// Starts its thread on the first call: sockets over inproc need none. Any thread.
  [[nodiscard]] ConnectionMonitor& monitor();
  [[nodiscard]] const RefusedPeers& refused() const { return *tcp_.refused; }

 private:
  zmq::context_t context_;
  TcpRules tcp_;
  std::optional<ZapHandler> zap_;  // with keys
  std::once_flag monitor_started_;
  std::optional<ConnectionMonitor> monitor_;
  WaitStrategy wait_;
  bool is_realtime_ = false;
  bool is_pinned_ = false;
};

}  // namespace palpate
