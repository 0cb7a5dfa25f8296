// time.h — points in time and durations. Every node reads one monotonic clock, its own.
#pragma once

#include <chrono>
#include <cstdint>

namespace palpate {

using Duration = std::chrono::nanoseconds;

/// Tag of "some monotonic clock": the owner's CLOCK_MONOTONIC, or a virtual clock in lockstep.
/// Stamps of two owners must not be subtracted; a stamp that went round the loop may be.
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
