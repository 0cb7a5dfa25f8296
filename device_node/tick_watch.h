// SPDX-License-Identifier: Apache-2.0
// tick_watch.h — notices, from another thread, that the tick does not come back from a call of the
// device.
#pragma once

#include <cstdint>

#include "common/core/time.h"

namespace palpate::device {

class TickWatch {
 public:
  static constexpr Duration kLongest = std::chrono::seconds(2);  ///< a device may open anew in one
  static constexpr int kLooks = 20;  ///< at least: a process that was stopped sees the time jump

  /// Call it regularly. @return true once for each time that the ticks stand still
  [[nodiscard]] bool hangs(std::uint64_t ticks, TimePoint now) noexcept {
    if (ticks != ticks_ || looks_ == 0) {
      ticks_ = ticks;
      since_ = now;
      looks_ = 1;
      is_told_ = false;
      return false;
    }
    if (looks_ < kLooks) ++looks_;
    if (is_told_ || looks_ < kLooks || now - since_ < kLongest) return false;
    is_told_ = true;
    return true;
  }

 private:
  std::uint64_t ticks_ = 0;
  TimePoint since_{};
  int looks_ = 0;
  bool is_told_ = false;
};

}  // namespace palpate::device
