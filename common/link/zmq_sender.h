// zmq_sender.h — outgoing end of a one-way link: hops 2, 3, 5 and 6.
#pragma once

#include <string>

#include "common/core/ports.h"
#include "common/link/codec/codec.h"
#include "common/link/socket/link_socket.h"
#include "common/link/socket/subscriptions.h"

namespace palpate {

/// Publishes to every connected subscriber.
template <class T>
class ZmqSender final : public Sender<T> {
 public:
  ZmqSender(ZmqContext& context, const Attachment& attachment);

  SendHook on_send;

  /// kNoPeer: there is no subscriber; the message was not encoded. kDropped: the frame is longer
  /// than kMaxFrameBytes. A subscriber whose queue is full misses the message without notice.
  SendResult send(const T& message) noexcept override;

  [[nodiscard]] bool has_subscriber() noexcept;
  /// Waits in real time for a subscriber; false after `timeout`.
  [[nodiscard]] bool wait_for_peer(Duration timeout) noexcept;
  [[nodiscard]] const std::string& endpoint() const { return socket_.endpoint(); }

 private:
  LinkSocket socket_;
  Codec<T> codec_;
  Subscriptions subscriptions_;
};

}  // namespace palpate
