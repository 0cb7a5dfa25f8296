// SPDX-License-Identifier: Apache-2.0
// pushes.h — small pushes of a device that nobody holds, for the checks of a driver.
#pragma once

#include <algorithm>
#include <chrono>
#include <optional>

#include "device_node/conformance/device_checks.h"

namespace palpate::device {

inline constexpr const char* kNoReading = "read() gave nothing";
inline constexpr double kSeenToMove_m = 0.2e-3;  // and four steps of the encoder

/// At most a third of the continuous force: no driver has a reason to limit it.
inline double gentle_newton(DeviceBench& bench) {
  return std::min(bench.limit_newton(),
                  bench.device().specification().continuous_force_newton / 3.0);
}
inline Vector3 gentle_force_newton(DeviceBench& bench) {
  return Vector3(2, -1, 2) / 3.0 * gentle_newton(bench);
}

/// Waits until friction has stopped the device, a second at most.
/// @return the velocity it still has [m/s]; none: it cannot be read
inline std::optional<Vector3> come_to_rest(DeviceBench& bench, double still_m) {
  using namespace std::chrono_literals;
  constexpr Duration kCoast = 20ms;  // between two looks at a device that coasts
  constexpr Duration kLongestCoast = 1s;
  DeviceSample before;
  DeviceSample now;
  if (!bench.device().read(now)) return std::nullopt;
  for (Duration t{}; t < kLongestCoast; t += kCoast) {
    before = now;
    bench.pass(kCoast);
    if (!bench.device().read(now)) return std::nullopt;
    if ((now.hand_position_m - before.hand_position_m).norm() <= still_m) break;
  }
  return Vector3((now.hand_position_m - before.hand_position_m) / to_seconds(kCoast));
}

}  // namespace palpate::device
