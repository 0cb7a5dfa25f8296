// SPDX-License-Identifier: Apache-2.0
#include "device_node/conformance/motors_check.h"

#include <algorithm>
#include <chrono>

#include "device_node/conformance/check_outcome.h"
#include "device_node/conformance/pushes.h"
#include "device_node/motor_check.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr Duration kLongestPeriod = 5ms;  // of the push, which lasts 62
constexpr Duration kStill = 50ms;         // within half a millimetre: at rest
constexpr Duration kLongestDrift = 3s;

}  // namespace

CheckOutcome check_motors(DeviceBench& bench) {
  const Limp at_the_end(bench.device());
  const DeviceSpecification& specification = bench.device().specification();
  const Duration period = std::min(bench.period(), kLongestPeriod);
  DeviceProfile profile = bench.profile();
  profile.position_resolution_m =
      std::max(profile.position_resolution_m, specification.position_resolution_m);
  MotorCheck check({.rate_hz = 1.0 / to_seconds(period),
                    .profile = profile,
                    .force_axes = specification.force_axes,
                    .limit_newton = gentle_newton(bench),
                    .latency = bench.latency()});
  TimePoint next_at = bench.clock().now();
  DeviceSample reading;
  DeviceSample at_switch;
  // a tick of device_node: the force follows from the reading
  const auto tick = [&](const auto& force_newton) {
    if (!bench.device().read(reading)) return false;
    if (!bench.device().apply(force_newton(), 3 * period, at_switch)) return false;
    next_at += period;
    if (next_at > bench.clock().now()) bench.pass(next_at - bench.clock().now());
    return true;
  };
  // other checks left it moving: a handle that goes further than a push could looks like one pushed
  const TimePoint rest_by = next_at + kLongestDrift;
  TimePoint still_since = next_at;
  Vector3 still_m = Vector3::Zero();
  while (next_at < rest_by && next_at - still_since < kStill) {
    if (!tick([] { return Vector3(Vector3::Zero()); })) return failed_exchange(kNoExchange);
    if ((reading.hand_position_m - still_m).cwiseAbs().maxCoeff() > 0.1 * MotorCheck::kFarthest_m) {
      still_m = reading.hand_position_m;
      still_since = next_at;
    }
  }
  while (check.verdict() == MotorVerdict::kChecking) {
    if (!tick([&] { return check.next(reading.sampled_at, reading.hand_position_m); })) {
      return failed_exchange(kNoExchange);
    }
    check.applied(at_switch.applied_force_newton);
  }
  const std::string axis = text_of(check.axis(), 1.0, "");
  switch (check.verdict()) {
    case MotorVerdict::kWrongWay:
      return failed("a push along " + axis + "moves the device another way");
    case MotorVerdict::kTooStrong:
      if (check.gain_at_least() < 1.0) {
        return failed("a push along " + axis +
                      "moved the handle by more than 5 mm: the motors are too strong, or somebody "
                      "moved it");
      }
      return failed(fmt::format(
          "the motors push at least {:.1f} times as hard as they are told, or there is less "
          "friction than device.profile says",
          check.gain_at_least()));
    case MotorVerdict::kFrozen:
      return failed("the positions stand still under a push along " + axis +
                    "of 0.3 N beyond friction: device_node would refuse to enable it");
    case MotorVerdict::kNotSeen:
      return failed("the positions do not follow a push along " + axis +
                    ": device_node would refuse to enable it");
    case MotorVerdict::kInterrupted:
      return {CheckVerdict::kFailed, "readings are missing for more than 5 ms again and again",
              "stop other programs; if `pace` names long calls, the driver blocks"};
    case MotorVerdict::kChecking:
    case MotorVerdict::kGood:
      break;
  }
  if (check.gain_at_least() == 0.0) return good("each axis gives way to a small push");
  return good(fmt::format(
      "each axis gives way to a small push; by the friction of the profile the motors push at "
      "least {:.2f} times as hard as they are told",
      check.gain_at_least()));
}

}  // namespace palpate::device
