// SPDX-License-Identifier: Apache-2.0
// pointer_hold.h — decides which page leads the simulated hand; one at a time (hop 6).
#pragma once

#include <cstdint>

#include "common/core/scene_messages.h"
#include "common/core/time.h"

namespace palpate::device {

/// The first page that sends a target holds the hand until it releases it or has been silent for
/// the time-out. Targets of other pages are refused, and so are targets that arrive out of order.
/// One thread.
class PointerHold {
 public:
  explicit PointerHold(Duration timeout) : timeout_(timeout) {}

  /// Whether the hand should follow this target.
  [[nodiscard]] bool accept(const HandTarget& target, TimePoint received_at) noexcept {
    const bool is_same = target.header.session_id == viewer_ && target.holder_id == holder_;
    if (is_same && target.header.sequence <= sequence_) return false;
    if (!is_same) {
      const bool is_free = !is_held_ || received_at - heard_at_ >= timeout_;
      if (!is_free || target.is_released) return false;
    }
    viewer_ = target.header.session_id;
    holder_ = target.holder_id;
    sequence_ = target.header.sequence;
    heard_at_ = received_at;
    is_held_ = !target.is_released;
    return true;
  }

  [[nodiscard]] bool is_held(TimePoint now) const noexcept {
    return is_held_ && now - heard_at_ < timeout_;
  }

 private:
  Duration timeout_;
  std::uint64_t viewer_ = 0;
  std::uint64_t holder_ = 0;
  std::uint64_t sequence_ = 0;
  TimePoint heard_at_{};
  bool is_held_ = false;
};

}  // namespace palpate::device
