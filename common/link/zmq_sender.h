// SPDX-License-Identifier: Apache-2.0
// zmq_sender.h — outgoing end of a one-way link: hops 2, 3, 5 and 6.
#pragma once

#include <optional>
#include <string>

#include "common/core/ports.h"
#include "common/link/codec/codec.h"
#include "common/link/socket/link_socket.h"
#include "common/link/subscribers.h"

namespace palpate {

/// Sends to the receiver to which it is connected or, if it binds, to every receiver that
/// subscribes to T.
template <class T>
class ZmqSender final : public Sender<T> {
 public:
  ZmqSender(ZmqContext& context, const Attachment& attachment);

  SendHook on_send;

  /// kNoPeer: there is no receiver; the message was not encoded. kDropped: the frame is longer than
  /// kMaxFrameBytes, or the queue to the only receiver is full. Of several receivers, one whose
  /// queue is full misses the message without notice.
  SendResult send(const T& message) noexcept override;

  [[nodiscard]] bool has_subscriber() noexcept;
  /// Waits in real time for a receiver; false after `timeout`.
  [[nodiscard]] bool wait_for_peer(Duration timeout) noexcept;
  [[nodiscard]] const std::string& endpoint() const { return socket_.endpoint(); }

 private:
  LinkSocket socket_;
  Codec<T> codec_;
  std::optional<Subscribers> subscribers_;  // if it binds
};

}  // namespace palpate
