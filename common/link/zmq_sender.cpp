#include "common/link/zmq_sender.h"

#include "common/link/frame_io.h"

namespace palpate {

template <class T>
ZmqSender<T>::ZmqSender(ZmqContext& context, const Attachment& attachment)
    : socket_(context, kIsTelemetry<T> ? kTelemetrySender : kOneWaySender, {attachment}) {}

template <class T>
bool ZmqSender<T>::has_subscriber() noexcept {
  subscriptions_.take(socket_);
  return subscriptions_.has(kKindOf<T>);
}

template <class T>
SendResult ZmqSender<T>::send(const T& message) noexcept {
  if (!has_subscriber()) return SendResult::kNoPeer;
  const SendResult result = send_frame(socket_, codec_, message);
  if (result == SendResult::kSent && on_send) on_send();
  return result;
}

template <class T>
bool ZmqSender<T>::wait_for_peer(Duration timeout) noexcept {
  const SteadyClock clock;
  const TimePoint deadline = clock.now() + timeout;
  while (!has_subscriber()) {
    if (clock.now() >= deadline) return false;
    socket_.wait_until(ZMQ_POLLIN, clock, deadline);
  }
  return true;
}

template class ZmqSender<ToolMotion>;
template class ZmqSender<Interaction>;
template class ZmqSender<DeviceBatch>;
template class ZmqSender<MofcBatch>;
template class ZmqSender<PhysicsBatch>;
template class ZmqSender<HandTarget>;

}  // namespace palpate
