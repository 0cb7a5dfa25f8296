#include "viewer_node/server/send_queue.h"

#include <algorithm>
#include <utility>

namespace palpate::viewer {

std::uint64_t SendQueue::push(OutgoingMessage message) {
  bytes_ += message.payload->size();
  waiting_.push_back(std::move(message));
  return bytes_ > kMaxWaitingBytes ? drop_until(kMaxWaitingBytes / 2) : 0;
}

bool SendQueue::is_overfull() const {
  return waiting_.size() + (in_flight_ ? 1 : 0) > kMaxWaitingMessages || bytes_ > kMaxUnreadBytes;
}

const OutgoingMessage* SendQueue::start() {
  if (in_flight_ || waiting_.empty()) return nullptr;
  in_flight_ = std::move(waiting_.front());
  waiting_.pop_front();
  return &*in_flight_;
}

void SendQueue::finish() {
  bytes_ -= in_flight_->payload->size();
  in_flight_.reset();
}

std::uint64_t SendQueue::drop_until(std::size_t bytes) {
  const auto rest = std::remove_if(waiting_.begin(), waiting_.end(), [&](const auto& message) {
    if (!message.may_drop || bytes_ <= bytes) return false;
    bytes_ -= message.payload->size();
    return true;
  });
  const auto count = static_cast<std::uint64_t>(std::distance(rest, waiting_.end()));
  waiting_.erase(rest, waiting_.end());
  return count;
}

}  // namespace palpate::viewer
