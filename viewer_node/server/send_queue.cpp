#include "viewer_node/server/send_queue.h"

#include <algorithm>
#include <utility>

namespace palpate::viewer {

SendQueue::Pushed SendQueue::push(OutgoingMessage message) {
  Pushed pushed;
  if (message.subject) {
    const auto older = std::find_if(waiting_.begin(), waiting_.end(), [&](const auto& waiting) {
      return waiting.subject == message.subject;
    });
    if (older != waiting_.end()) {
      bytes_ -= older->bytes();
      waiting_.erase(older);
      pushed.replaced = 1;
    }
  }
  bytes_ += message.bytes();
  waiting_.push_back(std::move(message));
  if (bytes_ > kMaxWaitingBytes) pushed.dropped = drop_until(kMaxWaitingBytes / 2);
  return pushed;
}

bool SendQueue::has(std::size_t subject) const {
  return (in_flight_ && in_flight_->subject == subject) ||
         std::any_of(waiting_.begin(), waiting_.end(),
                     [&](const auto& waiting) { return waiting.subject == subject; });
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
  bytes_ -= in_flight_->bytes();
  in_flight_.reset();
}

std::uint64_t SendQueue::drop_until(std::size_t bytes) {
  const auto rest = std::remove_if(waiting_.begin(), waiting_.end(), [&](const auto& message) {
    if (!message.may_drop || bytes_ <= bytes) return false;
    bytes_ -= message.bytes();
    return true;
  });
  const auto count = static_cast<std::uint64_t>(std::distance(rest, waiting_.end()));
  waiting_.erase(rest, waiting_.end());
  return count;
}

}  // namespace palpate::viewer
