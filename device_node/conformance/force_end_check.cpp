// SPDX-License-Identifier: Apache-2.0
#include "device_node/conformance/force_end_check.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <string>

#include "device_node/conformance/check_outcome.h"
#include "device_node/conformance/pushes.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr Duration kLasts = 10ms;    // of each push, and the lease of each renewal
constexpr Duration kLonger = 20ms;   // a push to compare with
constexpr Duration kWatched = 80ms;  // from the begin of each push
constexpr Duration kAlone = 40ms;    // from the begin of a push that nothing looks at
constexpr Duration kTurn = 1ms;
constexpr Duration kMostLate = 5ms;      // friction is not the same twice
constexpr double kLongerGoes = 1.2;      // times as far at least; twice, for a free mass
constexpr double kDrift_m_per_s = 0.01;  // of a device that does not come to rest
constexpr double kWellSeen_m = 2e-3;     // mean way within kWatched
constexpr std::size_t kRounds = 3;

const char* name_of(PushEnd end) {
  switch (end) {
    case PushEnd::kZeroForce:
      return "a force of zero";
    case PushEnd::kLease:
      return "the end of its lease";
    case PushEnd::kLeaseAlone:
      return "the end of a lease in which nothing was called";
    case PushEnd::kRelease:
      return "release()";
    case PushEnd::kZeroLease:
      return "a lease of zero";
    case PushEnd::kNegativeLease:
      return "a lease below zero";
  }
  return "";
}

struct Push {
  Vector3 shift_m = Vector3::Zero();  // mean over kWatched, of what it goes beyond its drift
  Vector3 later_m = Vector3::Zero();  // likewise, from kAlone on
  Vector3 drift_m_per_s = Vector3::Zero();
  Duration lasted = kLasts;
};

bool end_push(HapticDevice& device, const Vector3& force_newton, PushEnd end,
              DeviceSample& at_switch) {
  switch (end) {
    case PushEnd::kZeroForce:
      return device.apply(Vector3::Zero(), kLasts, at_switch);
    case PushEnd::kLease:
    case PushEnd::kLeaseAlone:
      return true;
    case PushEnd::kRelease:
      return device.release();
    case PushEnd::kZeroLease:
      return device.apply(force_newton, Duration::zero(), at_switch);
    case PushEnd::kNegativeLease:
      return device.apply(force_newton, Duration(-1), at_switch);
  }
  return false;
}

/// @param after  from its begin to its end
std::optional<Push> push(DeviceBench& bench, const Vector3& force_newton, PushEnd end,
                         Duration after) {
  HapticDevice& device = bench.device();
  const auto drift = come_to_rest(bench);
  if (!drift) return std::nullopt;
  Push push{.drift_m_per_s = *drift};
  // a push that its end fails to end goes on, beyond kMostLate and the latency of any device
  const bool is_alone = end == PushEnd::kLeaseAlone;
  const bool is_short = end == PushEnd::kZeroForce || end == PushEnd::kLease || is_alone;
  const Duration lease = is_short ? kLasts : kLonger;
  DeviceSample first;
  if (!device.apply(force_newton, lease, first)) return std::nullopt;
  bool is_over = end == PushEnd::kLease || is_alone;
  Vector3 before_m = Vector3::Zero();
  Duration seen{};
  while (seen < kWatched) {
    const bool is_unseen = is_alone && seen == Duration::zero();
    bench.pass(is_unseen ? kAlone : kTurn);
    DeviceSample now;
    if (!device.read(now)) return std::nullopt;
    const Duration at = std::min(kWatched, now.sampled_at - first.sampled_at);
    const Vector3 moved_m = now.hand_position_m - first.hand_position_m -
                            to_seconds(now.sampled_at - first.sampled_at) * *drift;
    if (is_unseen) before_m = moved_m;
    const Vector3 mean_m = 0.5 * (moved_m + before_m);
    const Duration late = std::max(Duration::zero(), at - std::max(seen, kAlone));
    push.shift_m += to_seconds(at - seen) / to_seconds(kWatched) * mean_m;
    push.later_m += to_seconds(late) / to_seconds(kWatched - kAlone) * mean_m;
    before_m = moved_m;
    if (at <= seen) return std::nullopt;  // its clock stands
    seen = at;
    if (is_over) continue;
    is_over = at >= after;
    DeviceSample at_switch = now;
    if (is_over ? !end_push(device, force_newton, end, at_switch)
                : !device.apply(force_newton, lease, at_switch)) {
      return std::nullopt;
    }
    if (is_over) push.lasted = at_switch.sampled_at - first.sampled_at;
  }
  static_cast<void>(device.release());
  return push;
}

/// A push, and one of the same length the other way: an arm with little friction coasts on after
/// each, and a row of them would carry it out of its workspace.
std::optional<Push> there_and_back(DeviceBench& bench, const Vector3& force_newton, PushEnd end,
                                   Duration after) {
  std::optional<Push> there = push(bench, force_newton, end, after);
  if (!there || !push(bench, -force_newton, PushEnd::kZeroForce, after)) return std::nullopt;
  return there;
}

/// Of the gentle force: the least that moves the device well. An arm with little friction goes
/// farther after a push of 20 ms than its workspace allows.
/// @return  none: a call failed
std::optional<double> well_seen_share(DeviceBench& bench) {
  static_cast<void>(bench.device().release());  // of what a check before may have left
  double share = 1.0 / 16.0;
  while (share < 1.0) {
    const auto probe =
        there_and_back(bench, share * gentle_force_newton(bench), PushEnd::kZeroForce, kLonger);
    if (!probe) return std::nullopt;
    if (probe->shift_m.norm() >= std::max(kWellSeen_m, 2.0 * least_seen_m(bench))) break;
    share *= 2.0;
  }
  return share;
}

}  // namespace

CheckOutcome check_ends_by_motion(DeviceBench& bench, std::initializer_list<PushEnd> ends) {
  const Limp at_the_end(bench.device());
  const double seen_m = least_seen_m(bench);
  const std::optional<double> share_of_force = well_seen_share(bench);
  if (!share_of_force) return failed_exchange(kNoExchange);
  std::map<PushEnd, std::array<double, kRounds>> late_s_of;
  for (std::size_t i = 0; i < kRounds; ++i) {
    const Vector3 force_newton =
        (i % 2 == 0 ? 1.0 : -1.0) * *share_of_force * gentle_force_newton(bench);
    const auto ended = there_and_back(bench, force_newton, PushEnd::kZeroForce, kLasts);
    const auto longer = there_and_back(bench, force_newton, PushEnd::kZeroForce, kLonger);
    if (!ended || !longer) return failed_exchange(kNoExchange);
    if (longer->shift_m.norm() < seen_m) {
      const double drift_m_per_s = longer->drift_m_per_s.norm();
      if (drift_m_per_s > kDrift_m_per_s) {
        return failed(fmt::format("released, the device goes on at {:.0f} mm/s, whatever the force",
                                  1e3 * drift_m_per_s));
      }
      return not_observable("a push of 20 ms does not move the device: does somebody hold it?");
    }
    const Vector3 along = longer->shift_m.normalized();
    const double ended_m = ended->shift_m.dot(along);
    const double longer_m = longer->shift_m.dot(along);
    if (longer_m < kLongerGoes * ended_m) {
      return failed(
          "the device goes as far after a push of 10 ms as after one of 20 ms: no force of zero "
          "ends it, or no apply() renews its lease");
    }
    for (const PushEnd end : ends) {
      const auto tried = there_and_back(bench, force_newton, end, kLasts);
      if (!tried) return failed_exchange(kNoExchange);
      const auto way_m = [&](const Push& push) {
        return (end == PushEnd::kLeaseAlone ? push.later_m : push.shift_m).dot(along);
      };
      const double share = (way_m(*tried) - way_m(*ended)) / (way_m(*longer) - way_m(*ended));
      late_s_of[end][i] = to_seconds(ended->lasted - tried->lasted) +
                          share * to_seconds(longer->lasted - ended->lasted);
    }
  }
  std::string found;
  for (auto& [end, late_s] : late_s_of) {
    std::sort(late_s.begin(), late_s.end());
    const double late = late_s[kRounds / 2];
    if (std::abs(late) > to_seconds(kMostLate + bench.stamp_tolerance())) {
      return failed(fmt::format("by the motion, the force ends about {:.0f} ms {} {}{}",
                                1e3 * std::abs(late), late > 0.0 ? "after" : "before", name_of(end),
                                late > 0.0 ? "" : ", or so much after a force of zero"));
    }
    found += fmt::format("{} {:.1f} ms after {}", found.empty() ? "" : " and",
                         std::max(0.0, 1e3 * late), name_of(end));
  }
  return good(fmt::format("by the motion, the force ends{}, of at most {:.0f} ms", found,
                          1e3 * to_seconds(kMostLate)));
}

}  // namespace palpate::device
