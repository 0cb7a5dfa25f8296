// SPDX-License-Identifier: Apache-2.0
// pushes.h — small pushes of a device that nobody holds, for the checks of a driver.
#pragma once

#include <algorithm>
#include <chrono>
#include <optional>
#include <vector>

#include "device_node/conformance/device_checks.h"

namespace palpate::device {

inline constexpr const char* kNoReading = "read() gave nothing";
inline constexpr const char* kNoApply = "apply() failed";
inline constexpr const char* kNoExchange = "read(), apply() or release() failed";
inline constexpr const char* kNoMotion = "it does not move: does somebody hold it?";

/// Of the encoder.
inline double step_m(DeviceBench& bench) {
  return std::max(bench.device().specification().position_resolution_m,
                  bench.profile().position_resolution_m);
}
/// Less motion may be noise.
inline double least_seen_m(DeviceBench& bench) { return 0.2e-3 + 4.0 * step_m(bench); }

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
inline std::optional<Vector3> come_to_rest(DeviceBench& bench) {
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
    if ((now.hand_position_m - before.hand_position_m).norm() <= step_m(bench)) break;
  }
  return Vector3((now.hand_position_m - before.hand_position_m) / to_seconds(kCoast));
}

struct Moved {
  Duration after{};                   ///< the switch
  Vector3 moved_m = Vector3::Zero();  ///< beyond its drift
  Duration skew{};
};

/// Pushes a device at rest until it has gone that far, 60 ms at most, and releases it.
/// @return its readings; none: a call failed
inline std::vector<Moved> push_away(DeviceBench& bench, const Vector3& force_newton, double far_m) {
  using namespace std::chrono_literals;
  constexpr Duration kLongestPush = 60ms;
  const std::optional<Vector3> drift_m_per_s = come_to_rest(bench);
  DeviceSample from;
  DeviceSample at_switch;
  if (!drift_m_per_s || !bench.device().read(from)) return {};
  if (!bench.device().apply(force_newton, 3ms, at_switch)) return {};
  const TimePoint begin = at_switch.sampled_at;
  std::vector<Moved> moved;
  for (Duration t{}; t < kLongestPush; t += 1ms) {
    bench.pass(1ms);
    DeviceSample now;
    if (!bench.device().read(now)) return {};
    const double elapsed_s = to_seconds(now.sampled_at - from.sampled_at);
    moved.push_back(
        {.after = now.sampled_at - begin,
         .moved_m = now.hand_position_m - from.hand_position_m - elapsed_s * *drift_m_per_s,
         .skew = now.skew});
    if (moved.back().moved_m.norm() >= far_m) break;
    if (!bench.device().apply(force_newton, 3ms, at_switch)) return {};
  }
  return bench.device().release() ? moved : std::vector<Moved>{};
}

}  // namespace palpate::device
