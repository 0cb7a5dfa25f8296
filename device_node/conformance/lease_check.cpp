// SPDX-License-Identifier: Apache-2.0
#include "device_node/conformance/lease_check.h"

#include <algorithm>
#include <array>
#include <chrono>

#include "device_node/conformance/check_outcome.h"
#include "device_node/conformance/pushes.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr Duration kLease = 10ms;
constexpr Duration kLonger = 20ms;   // a push to compare with
constexpr Duration kWatched = 80ms;  // from the begin of each push
constexpr Duration kTurn = 1ms;
constexpr Duration kMostLate = 5ms;      // friction is not the same twice
constexpr double kLongerGoes = 1.2;      // times as far at least; twice, for a free mass
constexpr double kDrift_m_per_s = 0.01;  // of a device that does not come to rest
constexpr std::size_t kRounds = 3;

struct Push {
  Vector3 shift_m = Vector3::Zero();  // mean over kWatched, of what it goes beyond its drift
  Vector3 drift_m_per_s = Vector3::Zero();
  Duration lasted = kLease;
};

/// @param ended_after  by a force of zero; 0: by its lease
std::optional<Push> push(DeviceBench& bench, const Vector3& force_newton, Duration ended_after) {
  HapticDevice& device = bench.device();
  const auto drift = come_to_rest(bench, device.specification().position_resolution_m);
  if (!drift) return std::nullopt;
  Push push{.drift_m_per_s = *drift};
  DeviceSample first;
  if (!device.apply(force_newton, kLease, first)) return std::nullopt;
  bool is_over = ended_after <= Duration::zero();
  Vector3 before_m = Vector3::Zero();
  Duration seen{};
  while (seen < kWatched) {
    bench.pass(kTurn);
    DeviceSample now;
    if (!device.read(now)) return std::nullopt;
    const Duration at = std::min(kWatched, now.sampled_at - first.sampled_at);
    const Vector3 moved_m = now.hand_position_m - first.hand_position_m -
                            to_seconds(now.sampled_at - first.sampled_at) * *drift;
    push.shift_m += to_seconds(at - seen) / to_seconds(kWatched) * 0.5 * (moved_m + before_m);
    before_m = moved_m;
    if (at <= seen) return std::nullopt;  // its clock stands
    seen = at;
    if (is_over) continue;
    is_over = at >= ended_after;
    DeviceSample at_switch;
    if (!device.apply(is_over ? Vector3(Vector3::Zero()) : force_newton, kLease, at_switch)) {
      return std::nullopt;
    }
    if (is_over) push.lasted = at_switch.sampled_at - first.sampled_at;
  }
  static_cast<void>(device.release());
  return push;
}

}  // namespace

CheckOutcome check_lease_by_motion(DeviceBench& bench) {
  const Limp at_the_end(bench.device());
  const double seen_m = kSeenToMove_m + 4.0 * bench.device().specification().position_resolution_m;
  std::array<double, kRounds> late_s{};
  for (std::size_t i = 0; i < kRounds; ++i) {
    const Vector3 force_newton = (i % 2 == 0 ? 1.0 : -1.0) * gentle_force_newton(bench);
    const auto told = push(bench, force_newton, kLease);
    const auto leased = push(bench, force_newton, Duration::zero());
    const auto longer = push(bench, force_newton, kLonger);
    if (!told || !leased || !longer) return failed("read() or apply() failed");
    if (longer->shift_m.norm() < seen_m) {
      const double drift_m_per_s = longer->drift_m_per_s.norm();
      if (drift_m_per_s > kDrift_m_per_s) {
        return failed(fmt::format("released, the device goes on at {:.0f} mm/s, whatever the force",
                                  1e3 * drift_m_per_s));
      }
      return not_observable("a push of 20 ms does not move the device: does somebody hold it?");
    }
    const Vector3 along = longer->shift_m.normalized();
    const double told_m = told->shift_m.dot(along);
    const double longer_m = longer->shift_m.dot(along);
    if (longer_m < kLongerGoes * told_m) {
      return failed(
          "the device goes as far after a push of 10 ms as after one of 20 ms: no force "
          "of zero ends it");
    }
    const double share = (leased->shift_m.dot(along) - told_m) / (longer_m - told_m);
    late_s[i] =
        to_seconds(told->lasted - kLease) + share * to_seconds(longer->lasted - told->lasted);
  }
  std::sort(late_s.begin(), late_s.end());
  const double late = late_s[kRounds / 2];
  if (late > to_seconds(kMostLate + bench.stamp_tolerance())) {
    return failed(fmt::format(
        "the force of a lease of 10 ms ends about {:.0f} ms after it, by the motion", 1e3 * late));
  }
  return good(fmt::format(
      "by the motion, the force of a lease of 10 ms ends {:.1f} ms after it, of at most {:.0f}",
      std::max(0.0, 1e3 * late), 1e3 * to_seconds(kMostLate)));
}

}  // namespace palpate::device
