// SPDX-License-Identifier: Apache-2.0
// handover.h — hands the newest of large objects from one thread to another, without locks.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

namespace palpate {

/// Three objects: the writer fills one, the reader uses one, the third is the newest that the
/// reader has not taken, or spare. Neither ever waits; nothing is copied.
template <class T>
class Handover {
 public:
  Handover() = default;
  /// Only while neither thread uses the two.
  Handover(const Handover& other) { *this = other; }
  Handover& operator=(const Handover& other) {
    if (this == &other) return *this;
    objects_ = other.objects_;
    middle_.store(other.middle_.load(std::memory_order_relaxed), std::memory_order_relaxed);
    draft_ = other.draft_;
    taken_ = other.taken_;
    has_taken_ = other.has_taken_;
    return *this;
  }
  ~Handover() = default;
  /// The object here where `object` is in the other one; null: null.
  [[nodiscard]] const T* place_of(const Handover& other, const T* object) const noexcept {
    return object == nullptr ? nullptr : objects_.data() + (object - other.objects_.data());
  }

  /// The object that neither uses; nullptr: there is news. Only while neither thread uses the
  /// hand-over.
  [[nodiscard]] T* spare() noexcept {
    const std::uint8_t middle = middle_.load(std::memory_order_relaxed);
    return (middle & kFresh) != 0 ? nullptr : &objects_[middle & kIndex];
  }

  /// The writer's object; what it was when it was last written, two or three hand-overs ago.
  [[nodiscard]] T& draft() noexcept { return objects_[draft_]; }
  /// The draft becomes the newest.
  void publish() noexcept {
    draft_ = kIndex & middle_.exchange(static_cast<std::uint8_t>(draft_ | kFresh),
                                       std::memory_order_acq_rel);
  }
  /// The newest published object, for the reader until its next call; nullptr: none yet.
  [[nodiscard]] T* newest() noexcept {
    if ((middle_.load(std::memory_order_acquire) & kFresh) != 0) {
      taken_ = kIndex & middle_.exchange(taken_, std::memory_order_acq_rel);
      has_taken_ = true;
    }
    return has_taken_ ? &objects_[taken_] : nullptr;
  }

 private:
  static constexpr std::uint8_t kFresh = 4;
  static constexpr std::uint8_t kIndex = 3;
  std::array<T, 3> objects_{};
  std::atomic<std::uint8_t> middle_{1};
  std::uint8_t draft_ = 0;  // the writer's
  std::uint8_t taken_ = 2;  // the reader's
  bool has_taken_ = false;  // the reader's
};

}  // namespace palpate
