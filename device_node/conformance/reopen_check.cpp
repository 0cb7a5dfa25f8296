// SPDX-License-Identifier: Apache-2.0
#include "device_node/conformance/reopen_check.h"

#include <algorithm>
#include <chrono>

#include "device_node/conformance/check_outcome.h"
#include "device_node/conformance/pushes.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr double kAway_m = 2e-3;
constexpr Duration kWithin = 1s;
constexpr double kOffAtMost = 0.5;  // of the way that the push moved it

}  // namespace

CheckOutcome check_reopen(DeviceBench& bench) {
  HapticDevice& device = bench.device();
  const Limp at_the_end(device);
  const double seen_m = least_seen_m(bench);
  DeviceSample first;
  DeviceSample before;
  if (!device.read(first)) return failed_exchange(kNoReading);
  if (push_away(bench, gentle_force_newton(bench), kAway_m).empty())
    return failed_exchange(kNoExchange);
  const std::optional<Vector3> drift_m_per_s = come_to_rest(bench);
  if (!drift_m_per_s || !device.read(before)) return failed_exchange(kNoReading);

  if (!device.reopen(kWithin)) return failed("reopen() failed, of a device that answered");
  if (device.phase() != DevicePhase::kCalibrated) {
    return good("it says that it needs its calibration again");
  }
  DeviceSample after;
  if (!device.read(after)) return failed_exchange(kNoReading);
  const Vector3 off_m = after.hand_position_m - before.hand_position_m -
                        to_seconds(after.sampled_at - before.sampled_at) * drift_m_per_s.value();
  const double moved_m = (before.hand_position_m - first.hand_position_m).norm();
  if (off_m.norm() > kOffAtMost * std::max(moved_m, seen_m)) {
    return failed("it is " + text_of(off_m, 1e3, "mm") +
                  " from where it was, and says that it is calibrated");
  }
  if (moved_m < seen_m) return not_observable(kNoMotion);
  return good(
      fmt::format("{:.2g} mm from where it was opened, it knows where it is", 1e3 * moved_m));
}

}  // namespace palpate::device
