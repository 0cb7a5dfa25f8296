// SPDX-License-Identifier: Apache-2.0
// subscription.h — the receiver's part of hops 3 and 5, where the sender binds: tells the sender
// which kinds of message it wants.
#pragma once

#include <chrono>
#include <cstdint>

#include "common/core/time.h"
#include "common/link/codec/codec.h"
#include "common/link/socket/link_socket.h"

namespace palpate {

/// Sends the subscription at once when it changes or the connection is new, then repeatedly: a
/// sender forgets a receiver that is silent for Subscribers::kSilence. A socket whose queues
/// outlast a connection sends it ahead of the next one. The frame consists of the byte
/// MessageKind::kSubscription and one byte for each kind. Over inproc it is sent only when it
/// changes, so that lockstep does not depend on real time. A SUB socket, of a relay's follower, has
/// the kind bytes as topics instead.
class Subscription {
 public:
  static constexpr Duration kInterval = std::chrono::milliseconds(100);

  /// @param socket  a DEALER or SUB that connects; outlives this
  explicit Subscription(LinkSocket& socket) : socket_(socket) {}

  void add(MessageKind kind) noexcept { change(kinds_ | bit(kind)); }
  void remove(MessageKind kind) noexcept { change(kinds_ & ~bit(kind)); }

  /// Neither blocks nor allocates. Call it at least every kInterval.
  void send_if_due() noexcept;

 private:
  static constexpr std::uint32_t bit(MessageKind kind) {
    return std::uint32_t{1} << static_cast<unsigned>(kind);
  }
  void change(std::uint32_t kinds) noexcept {
    is_changed_ |= kinds != kinds_;
    kinds_ = kinds;
  }

  void set_topics() noexcept;

  LinkSocket& socket_;
  std::uint32_t kinds_ = 0;   // one bit each
  std::uint32_t topics_ = 0;  // of a SUB, as libzmq has them
  bool is_changed_ = true;
  bool is_waiting_ = false;        // one waits for the next connection
  std::uint32_t established_ = 0;  // connections of the socket when it was sent last
  TimePoint next_at_{};            // of the steady clock
};

}  // namespace palpate
