// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/server/send_queue.h"

#include <iterator>
#include <utility>

namespace palpate::viewer {

SendQueue::Pushed SendQueue::push(OutgoingMessage message) {
  Pushed pushed;
  if (message.subject) {
    const auto older = newest_.find(*message.subject);
    if (older != newest_.end()) {
      bytes_ -= older->second->bytes();
      waiting_.erase(older->second);
      pushed.replaced = 1;
    }
  }
  bytes_ += message.bytes();
  waiting_.push_back(std::move(message));
  if (waiting_.back().subject) newest_[*waiting_.back().subject] = std::prev(waiting_.end());
  if (bytes_ > kMaxWaitingBytes) pushed.dropped = drop_until(kMaxWaitingBytes / 2);
  return pushed;
}

bool SendQueue::has(std::size_t subject) const {
  return (in_flight_ && in_flight_->subject == subject) || newest_.contains(subject);
}

bool SendQueue::is_overfull() const {
  return waiting_.size() + (in_flight_ ? 1 : 0) > kMaxWaitingMessages || bytes_ > kMaxUnreadBytes;
}

const OutgoingMessage* SendQueue::start() {
  if (in_flight_ || waiting_.empty()) return nullptr;
  if (waiting_.front().subject) newest_.erase(*waiting_.front().subject);
  in_flight_ = std::move(waiting_.front());
  waiting_.pop_front();
  return &*in_flight_;
}

void SendQueue::finish() {
  bytes_ -= in_flight_->bytes();
  in_flight_.reset();
}

std::uint64_t SendQueue::drop_until(std::size_t bytes) {
  return std::erase_if(waiting_, [&](const OutgoingMessage& message) {
    if (!message.may_drop || bytes_ <= bytes) return false;
    bytes_ -= message.bytes();
    if (message.subject) newest_.erase(*message.subject);
    return true;
  });
}

}  // namespace palpate::viewer
