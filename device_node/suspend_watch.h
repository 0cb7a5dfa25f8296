// SPDX-License-Identifier: Apache-2.0
// suspend_watch.h — notices that the machine slept: CLOCK_MONOTONIC, by which everything here is
// timed, stands still meanwhile, and a motor need not.
#pragma once

#include <time.h>

#include <algorithm>
#include <chrono>

#include "common/core/time.h"

namespace palpate::device {

/// CLOCK_BOOTTIME − CLOCK_MONOTONIC, between these two.
struct BootOffset {
  Duration at_least{};
  Duration at_most{};
};

[[nodiscard]] inline BootOffset boot_offset() noexcept {
  const auto now = [](clockid_t clock) {
    timespec time{};
    ::clock_gettime(clock, &time);
    return Duration(std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec));
  };
  const Duration before = now(CLOCK_MONOTONIC);
  const Duration boot = now(CLOCK_BOOTTIME);
  const Duration after = now(CLOCK_MONOTONIC);
  return {.at_least = boot - after, .at_most = boot - before};
}

/// No allocation, no throw.
class SuspendWatch {
 public:
  explicit SuspendWatch(const BootOffset& now = boot_offset()) noexcept : known_(now.at_most) {}

  /// For how long the machine slept since the last call, to a millisecond; 0: it did not.
  [[nodiscard]] Duration slept(const BootOffset& now = boot_offset()) noexcept {
    constexpr Duration kNoise = std::chrono::milliseconds(1);
    if (now.at_least <= known_ + kNoise) {
      known_ = std::min(known_, now.at_most);  // the closest that was seen
      return Duration::zero();
    }
    const Duration slept = now.at_most - known_;
    known_ = now.at_most;
    return slept;
  }

 private:
  Duration known_;
};

}  // namespace palpate::device
