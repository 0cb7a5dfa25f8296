#include "common/link/zmq_source.h"

#include "common/link/frame_io.h"

namespace palpate {

template <class T>
ZmqSource<T>::ZmqSource(ZmqContext& context, const Clock& clock, const Attachment& attachment,
                        Delivery delivery)
    : context_(context),
      clock_(clock),
      socket_(context, one_way_receiver(delivery), {attachment}) {}

template <class T>
bool ZmqSource<T>::receive(T& message, TimePoint& received_at) noexcept {
  if (watch_) watch_->update();
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
  socket_.wait_for_message(on_wait, clock_, deadline);
}

template class ZmqSource<ToolMotion>;
template class ZmqSource<Interaction>;
template class ZmqSource<HandTarget>;

}  // namespace palpate
