// SPDX-License-Identifier: Apache-2.0
// spsc_ring.h — a wait-free bounded queue from the periodic thread to a slower one.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

namespace palpate {

struct CopyByAssignment {
  template <class T>
  void operator()(const T& from, T& to) const noexcept {
    to = from;
  }
};

/// One producer thread, one consumer thread. push() never blocks or allocates; an element pushed to
/// a full ring is lost and counted.
template <class T, class Copy = CopyByAssignment>
class SpscRing {
 public:
  /// `capacity` ≥ 1 elements.
  explicit SpscRing(std::size_t capacity) : slots_(capacity + 1) {}

  bool push(const T& value) noexcept {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    const std::size_t after = next(tail);
    if (after == head_.load(std::memory_order_acquire)) {
      lost_.fetch_add(1, std::memory_order_relaxed);
      return false;
    }
    Copy{}(value, slots_[tail]);
    tail_.store(after, std::memory_order_release);
    return true;
  }

  bool pop(T& value) noexcept {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head == tail_.load(std::memory_order_acquire)) return false;
    Copy{}(slots_[head], value);
    head_.store(next(head), std::memory_order_release);
    return true;
  }

  /// Of the consumer.
  [[nodiscard]] bool is_empty() const noexcept {
    return head_.load(std::memory_order_relaxed) == tail_.load(std::memory_order_acquire);
  }

  [[nodiscard]] std::uint64_t lost() const noexcept {
    return lost_.load(std::memory_order_relaxed);
  }

 private:
  [[nodiscard]] std::size_t next(std::size_t i) const { return i + 1 == slots_.size() ? 0 : i + 1; }

  std::vector<T> slots_;
  alignas(64) std::atomic<std::size_t> head_{0};
  alignas(64) std::atomic<std::size_t> tail_{0};
  std::atomic<std::uint64_t> lost_{0};
};

}  // namespace palpate
