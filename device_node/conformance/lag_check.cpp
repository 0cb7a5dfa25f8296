// SPDX-License-Identifier: Apache-2.0
#include "device_node/conformance/lag_check.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "device_node/conformance/check_outcome.h"
#include "device_node/conformance/pushes.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr int kPushes = 6;
constexpr double kFar_m = 2e-3;
constexpr Duration kOfMotors = 1ms;  // until their force acts

/// d of the header, of all t; `step_m` is in favour of the device.
double lag_s(const std::vector<Moved>& push, double step_m) {
  const Vector3 along = push.back().moved_m.normalized();
  const double end_s = to_seconds(push.back().after);
  const double end_m = push.back().moved_m.norm() - step_m;
  double most_s = 0.0;
  for (const Moved& one : push) {
    const double s = std::sqrt(std::max(0.0, one.moved_m.dot(along) + step_m) / end_m);
    if (s < 1.0) most_s = std::max(most_s, (to_seconds(one.after) - s * end_s) / (1.0 - s));
  }
  return most_s;
}

}  // namespace

CheckOutcome check_lag(DeviceBench& bench) {
  const Limp at_the_end(bench.device());
  std::optional<double> least_s;
  Duration skew{};
  for (int i = 0; i < kPushes; ++i) {
    const Vector3 force_newton = (i % 2 == 0 ? 1.0 : -1.0) * gentle_force_newton(bench);
    const std::vector<Moved> push = push_away(bench, force_newton, kFar_m);
    if (push.empty()) return failed_exchange(kNoExchange);
    for (const Moved& one : push) skew = std::max(skew, one.skew);
    if (push.back().moved_m.norm() < least_seen_m(bench)) continue;
    const double lag = lag_s(push, step_m(bench));
    least_s = std::min(lag, least_s.value_or(lag));
  }
  if (!least_s) return not_observable(kNoMotion);
  const std::string found = fmt::format(
      "the positions follow a push with a lag of at least {:.1f} ms; skew and device.latency_us "
      "declare {:.1f} ms",
      1e3 * *least_s, 1e3 * to_seconds(skew + bench.latency()));
  const Duration most = skew + bench.latency() + bench.stamp_tolerance() + kOfMotors;
  return *least_s <= to_seconds(most) ? good(found) : failed(found);
}

}  // namespace palpate::device
