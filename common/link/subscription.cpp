// SPDX-License-Identifier: Apache-2.0
#include "common/link/subscription.h"

#include <array>

#include "common/core/clock.h"

namespace palpate {

void Subscription::set_topics() noexcept {
  for (std::size_t kind = 0; kind < kMessageKinds; ++kind) {
    const std::uint32_t changed = (kinds_ ^ topics_) & bit(static_cast<MessageKind>(kind));
    if (changed != 0) socket_.set_topic(static_cast<char>(kind), (kinds_ & changed) != 0);
  }
  topics_ = kinds_;
}

void Subscription::send_if_due() noexcept {
  if (socket_.has_topics()) {
    set_topics();
    return;
  }
  const std::uint32_t established = socket_.established();
  const bool is_connected = socket_.is_connected();
  bool is_due = is_changed_ || established != established_;
  if (socket_.is_inproc() && !is_due) return;
  if (!is_connected) {
    if (!socket_.keeps_queues() || (is_waiting_ && !is_due)) return;
    is_due = true;
  }
  const TimePoint now = SteadyClock().now();
  if (!is_due && now < next_at_) return;

  std::array<char, kMessageKinds> bytes{static_cast<char>(MessageKind::kSubscription)};
  std::size_t size = 1;
  for (std::size_t kind = 0; kind < kMessageKinds; ++kind) {
    if ((kinds_ & bit(static_cast<MessageKind>(kind))) != 0)
      bytes[size++] = static_cast<char>(kind);
  }
  zmq::message_t frame(bytes.data(), size);  // short enough for libzmq not to allocate
  if (socket_.send(frame, 0) != SendResult::kSent) return;
  is_changed_ = false;
  is_waiting_ = !is_connected;
  established_ = established;
  next_at_ = now + kInterval;
}

}  // namespace palpate
