// SPDX-License-Identifier: Apache-2.0
// time.h — points in time and durations. Every node reads only its own monotonic clock.
#pragma once

#include <chrono>
#include <cstdint>

namespace palpate {

using Duration = std::chrono::nanoseconds;

/// Clock tag for a monotonic clock: CLOCK_MONOTONIC of one host, or virtual time in lockstep.
/// Time stamps of different nodes must not be subtracted. A node sends its stamp along with a
/// message, gets it back in the answer and subtracts it from its own time.
struct MonotonicTag {
  using rep = std::int64_t;
  using period = std::nano;
  using duration = Duration;
  using time_point = std::chrono::time_point<MonotonicTag>;
  static constexpr bool is_steady = true;
};
using TimePoint = MonotonicTag::time_point;

/// Seconds as a double, for equations and files.
[[nodiscard]] constexpr double to_seconds(Duration d) {
  return std::chrono::duration<double>(d).count();
}

/// Nearest whole nanosecond. `seconds` must be finite and |seconds| < 9e9.
[[nodiscard]] constexpr Duration from_seconds(double seconds) {
  const double ns = seconds * 1e9;
  return Duration(static_cast<std::int64_t>(ns < 0.0 ? ns - 0.5 : ns + 0.5));
}

[[nodiscard]] constexpr double seconds_of(TimePoint t) { return to_seconds(t.time_since_epoch()); }
[[nodiscard]] constexpr TimePoint time_at(double seconds) {
  return TimePoint(from_seconds(seconds));
}

}  // namespace palpate
