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

/// Calls `release` every millisecond until the device confirms it, for `limit` of `clock`'s time at
/// most. Not for the tick: it waits.
/// @return false: the device did not confirm it
template <class Release>
[[nodiscard]] bool released_within(Duration limit, Clock& clock, const Release& release) {
  const TimePoint until = clock.now() + limit;
  while (!release()) {
    if (clock.now() >= until) return false;
    clock.sleep_until(clock.now() + std::chrono::milliseconds(1));
  }
  return true;
}

/// released_within() kReleaseLimit, of a device that no DeviceNode drives.
[[nodiscard]] inline bool release_for_certain(HapticDevice& device, Clock& clock) {
  return released_within(kReleaseLimit, clock, [&] { return device.release(); });
}

}  // namespace palpate::device
