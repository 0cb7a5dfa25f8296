// memory_link.h — a link within one thread, for lockstep runs and unit tests.
#pragma once

#include <functional>
#include <vector>

#include "common/core/clock.h"
#include "common/core/ports.h"

namespace palpate {

/// A ring buffer of messages; a message sent to a full ring is dropped, as on a socket. Both ends
/// are used by one thread. A scheduler may set the hooks: `on_send` runs after each message sent,
/// `on_wait` replaces blocking.
template <class T>
class MemoryLink final : public Sender<T>, public Source<T> {
 public:
  explicit MemoryLink(const Clock& clock, std::size_t capacity = 256)
      : clock_(clock), ring_(capacity) {}

  std::function<void()> on_send;
  std::function<void(TimePoint deadline)> on_wait;

  SendResult send(const T& message) noexcept override {
    if (count_ == ring_.size()) return SendResult::kDropped;
    ring_[(first_ + count_++) % ring_.size()] = {message, clock_.now()};
    if (on_send) on_send();
    return SendResult::kSent;
  }

  bool receive(T& message, TimePoint& received_at) noexcept override {
    if (count_ == 0) return false;
    message = ring_[first_].message;
    received_at = ring_[first_].arrived_at;
    first_ = (first_ + 1) % ring_.size();
    --count_;
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
  const Clock& clock_;
  std::vector<Slot> ring_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
};

}  // namespace palpate
