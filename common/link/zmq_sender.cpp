// SPDX-License-Identifier: Apache-2.0
#include "common/link/zmq_sender.h"

#include <algorithm>

#include "common/link/frame_io.h"
#include "common/link/subscription.h"

namespace palpate {
namespace {

template <class T>
const LinkSettings& settings_of(const Attachment& attachment) {
  if (attachment.role == Attachment::Role::kConnect) return kOneWaySender;
  return kIsTelemetry<T> ? kTelemetrySender : kInteractionSender;
}

}  // namespace

template <class T>
ZmqSender<T>::ZmqSender(ZmqContext& context, const Attachment& attachment)
    : socket_(context, settings_of<T>(attachment), attachment) {
  if (attachment.role == Attachment::Role::kBind) subscribers_.emplace(socket_);
}

template <class T>
bool ZmqSender<T>::has_subscriber() noexcept {
  if (!subscribers_) return socket_.is_connected() && socket_.is_ready(ZMQ_POLLOUT);
  subscribers_->take();
  return subscribers_->has(kKindOf<T>);
}

template <class T>
SendResult ZmqSender<T>::send(const T& message) noexcept {
  SendResult result = SendResult::kNoPeer;
  if (subscribers_) {
    result = send_frame(*subscribers_, codec_, message);
  } else if (socket_.is_ready(ZMQ_POLLOUT)) {
    result = send_frame(socket_, codec_, message);
  } else if (socket_.is_connected()) {
    result = SendResult::kDropped;
  }
  if (result == SendResult::kSent && on_send) on_send();
  return result;
}

template <class T>
bool ZmqSender<T>::wait_for_peer(Duration timeout) noexcept {
  const SteadyClock clock;
  const TimePoint deadline = clock.now() + timeout;
  while (!has_subscriber()) {
    if (clock.now() >= deadline) return false;
    socket_.wait_until(subscribers_ ? ZMQ_POLLIN : ZMQ_POLLOUT, clock,
                       std::min(deadline, clock.now() + Subscription::kInterval));
  }
  return true;
}

template class ZmqSender<ToolMotion>;
template class ZmqSender<Interaction>;
template class ZmqSender<DeviceBatch>;
template class ZmqSender<MofcBatch>;
template class ZmqSender<PhysicsBatch>;
template class ZmqSender<HandTarget>;
template class ZmqSender<RunState>;
template class ZmqSender<RunRequest>;
template class ZmqSender<TissueChange>;
template class ZmqSender<Acknowledgement>;

}  // namespace palpate
