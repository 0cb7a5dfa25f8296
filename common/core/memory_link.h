// SPDX-License-Identifier: Apache-2.0
// memory_link.h — a link within one thread, for lockstep runs and unit tests.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <utility>
#include <vector>

#include "common/core/clock.h"
#include "common/core/messages.h"
#include "common/core/ports.h"

namespace palpate {

/// A ring buffer of messages; a message sent to a full ring is dropped, as on a socket. It grows up
/// to its capacity: no allocation while at most kReady messages wait. Both ends are used by one
/// thread. A scheduler may set the hooks: `on_send` runs after each message sent,
/// `on_wait` replaces blocking.
template <class T>
class MemoryLink final : public Sender<T>, public Source<T> {
 public:
  static constexpr std::size_t kReady = 8;

  explicit MemoryLink(const Clock& clock, std::size_t capacity = 256)
      : clock_(clock), capacity_(capacity), ring_(std::min(capacity, kReady)) {}

  std::function<void()> on_send;
  std::function<void(TimePoint deadline)> on_wait;

  SendResult send(const T& message) noexcept override {
    if (count_ == capacity_) return SendResult::kDropped;
    if (count_ == ring_.size()) grow();
    Slot& slot = ring_[(first_ + count_++) % ring_.size()];
    copy_message(message, slot.message);
    slot.arrived_at = clock_.now();
    if (on_send) on_send();
    return SendResult::kSent;
  }

  bool receive(T& message, TimePoint& received_at) noexcept override {
    if (count_ == 0) return false;
    copy_message(ring_[first_].message, message);
    received_at = ring_[first_].arrived_at;
    --count_;
    first_ = count_ == 0 ? 0 : (first_ + 1) % ring_.size();  // the same few slots stay in the cache
    return true;
  }

  void wait_until(TimePoint deadline) noexcept override {
    if (count_ == 0 && on_wait) on_wait(deadline);
  }

 private:
  struct Slot {
    T message;
    TimePoint arrived_at;
  };

  void grow() {
    std::vector<Slot> larger(std::min(capacity_, 2 * ring_.size()));
    for (std::size_t i = 0; i < count_; ++i) larger[i] = ring_[(first_ + i) % ring_.size()];
    ring_ = std::move(larger);
    first_ = 0;
  }

  const Clock& clock_;
  std::size_t capacity_;
  std::vector<Slot> ring_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
};

}  // namespace palpate
