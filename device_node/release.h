// SPDX-License-Identifier: Apache-2.0
// release.h — the last word to motors: limp, and confirmed.
#pragma once

#include <chrono>

#include "common/core/clock.h"
#include "device_node/device.h"

namespace palpate::device {

inline constexpr Duration kReleaseLimit = std::chrono::seconds(1);
inline constexpr const char* kNotReleased =
    "its motors did not confirm their release within 1 s and may still push: cut their supply";

/// Releases the motors until the device confirms it, for kReleaseLimit of `clock`'s time at most.
/// Not for the tick: it waits.
/// @return false: the device did not confirm it
[[nodiscard]] inline bool release_for_certain(HapticDevice& device, Clock& clock) {
  const TimePoint until = clock.now() + kReleaseLimit;
  while (!device.release()) {
    if (clock.now() >= until) return false;
    clock.sleep_until(clock.now() + std::chrono::milliseconds(1));
  }
  return true;
}

}  // namespace palpate::device
