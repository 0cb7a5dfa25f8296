// subscriptions.h — the subscribers of one publisher.
#pragma once

#include <array>
#include <cstdint>
#include <zmq.hpp>

#include "common/link/codec/codec.h"
#include "common/link/socket/link_socket.h"

namespace palpate {

/// The topics to which peers of one publisher subscribe. A topic is a kind byte; the empty topic
/// means all kinds.
class Subscriptions {
 public:
  /// Reads the notifications that libzmq queued in the publisher's socket.
  void take(LinkSocket& socket) noexcept;
  [[nodiscard]] bool has(MessageKind kind) const noexcept;
  /// Subscriptions to it so far; see LinkSettings::reports_every_subscription.
  [[nodiscard]] std::uint64_t count(MessageKind kind) const noexcept;

 private:
  struct Topic {
    bool is_wanted = false;
    std::uint64_t count = 0;
  };
  zmq::message_t notice_;
  Topic all_;
  std::array<Topic, kMessageKinds> of_kind_{};
};

}  // namespace palpate
