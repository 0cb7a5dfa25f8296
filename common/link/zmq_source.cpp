// SPDX-License-Identifier: Apache-2.0
#include "common/link/zmq_source.h"

#include <algorithm>

#include "common/link/frame_io.h"

namespace palpate {

template <class T>
ZmqSource<T>::ZmqSource(ZmqContext& context, const Clock& clock, const Attachment& attachment)
    : clock_(clock),
      socket_(context,
              attachment.role == Attachment::Role::kBind ? kOneWayReceiver : kInteractionReceiver,
              attachment) {
  if (attachment.role == Attachment::Role::kBind) return;
  subscription_.emplace(socket_);
  subscription_->add(kKindOf<T>);
  subscription_->send_if_due();
}

template <class T>
bool ZmqSource<T>::receive(T& message, TimePoint& received_at) noexcept {
  if (subscription_) subscription_->send_if_due();
  for (int i = 0; i < kMaxRejectedPerCall; ++i) {
    if (!receive_frame(socket_, codec_, frame_, rejections_, message)) return false;
    received_at = clock_.now();
    if (writer_ && !writer_->admit(message.header.session_id, received_at)) {
      rejections_.count_second_writer();
      continue;
    }
    return true;
  }
  return false;
}

template <class T>
void ZmqSource<T>::wait_until(TimePoint deadline) noexcept {
  if (subscription_) {
    subscription_->send_if_due();
    if (!on_wait) deadline = std::min(deadline, clock_.now() + Subscription::kInterval);
  }
  socket_.wait_for_message(on_wait, clock_, deadline);
}

template class ZmqSource<ToolMotion>;
template class ZmqSource<Interaction>;
template class ZmqSource<HandTarget>;
template class ZmqSource<RunRequest>;
template class ZmqSource<TissueChange>;
template class ZmqSource<Acknowledgement>;

}  // namespace palpate
