// SPDX-License-Identifier: Apache-2.0
#include "device_node/conformance/device_checks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "device_node/conformance/check_outcome.h"
#include "device_node/conformance/force_end_check.h"
#include "device_node/conformance/lag_check.h"
#include "device_node/conformance/motors_check.h"
#include "device_node/conformance/pushes.h"
#include "device_node/conformance/reopen_check.h"
#include "device_node/conformance/watched_bench.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr const char* kRefused =
    "apply() refused a force of at most a third of continuous_force_newton";
constexpr const char* kNoForceSeen = "the driver does not tell the force of its motors";

constexpr double kForceTolerance = 0.02;   // of the force …
constexpr double kForceFloorNewton = 0.1;  // … and of this
constexpr int kExchanges = 200;            // whose median is the pace
constexpr double kPush_m = 1e-3;           // a push along one axis ends here
constexpr double kLeastAlong = 0.5;        // cosine of motion and force
constexpr Duration kMostSkew = 1s;         // of a reading and its switch

bool apply(DeviceBench& bench, const Vector3& force_newton, Duration lease) {
  DeviceSample at_switch;
  return bench.device().apply(force_newton, lease, at_switch);
}

/// Not observable without their force. @param requested_newton  the motors give what their axes can
CheckOutcome expect_motors(DeviceBench& bench, const Vector3& requested_newton, const char* when) {
  const Vector3 wanted_newton = bench.device().specification().force_axes * requested_newton;
  const std::optional<Vector3> force = bench.motor_force_newton();
  if (!force) return not_observable(kNoForceSeen);
  const double tolerance = kForceTolerance * (wanted_newton.norm() + kForceFloorNewton);
  if ((*force - wanted_newton).norm() < tolerance) {
    return good(text_of(*force, 1.0, "N ") + when);
  }
  return failed(text_of(*force, 1.0, "N ") + when + ", not " + text_of(wanted_newton, 1.0, "N"));
}

// --- without a force

CheckOutcome check_start(DeviceBench& bench) {
  return expect_motors(bench, Vector3::Zero(), "before the first force");
}

CheckOutcome check_specification(DeviceBench& bench) {
  const DeviceSpecification& s = bench.device().specification();
  if (s.model_name.empty()) return failed("model_name is empty");
  if (!(s.workspace_half_extent_m.minCoeff() > 0.0) || !s.workspace_half_extent_m.allFinite()) {
    return failed("workspace_half_extent_m = " + text_of(s.workspace_half_extent_m, 1.0, "m"));
  }
  if (!(s.continuous_force_newton > 0.0)) {
    return failed(fmt::format("continuous_force_newton = {:g}", s.continuous_force_newton));
  }
  if (!(s.peak_force_newton >= s.continuous_force_newton) || !std::isfinite(s.peak_force_newton)) {
    return failed(fmt::format("peak_force_newton = {:g}, below continuous_force_newton = {:g}",
                              s.peak_force_newton, s.continuous_force_newton));
  }
  if (!(s.position_resolution_m >= 0.0) || !(s.position_resolution_m < 1e-2)) {
    return failed(fmt::format("position_resolution_m = {:g}", s.position_resolution_m));
  }
  if (!(s.held_force_ratio >= 1.0)) {
    return failed(fmt::format("held_force_ratio = {:g}", s.held_force_ratio));
  }
  if (s.button_count > 32) return failed(fmt::format("button_count = {}", s.button_count));
  return good(s.model_name + fmt::format(": {:.3g} N, {:.3g} N at peak, encoder steps of {:.3g} µm",
                                         s.continuous_force_newton, s.peak_force_newton,
                                         1e6 * s.position_resolution_m));
}

/// What is wrong with a reading of between `before` and now; empty if nothing.
std::string wrong_reading(DeviceBench& bench, const DeviceSample& sample, TimePoint before) {
  const Vector3& p = sample.hand_position_m;
  if (!p.allFinite()) return "a position that is not finite";
  // mm taken for m: no device reaches ten times as far as it says
  const Vector3& reach = bench.device().specification().workspace_half_extent_m;
  if ((p.cwiseAbs().array() > 10.0 * reach.array()).any()) {
    return "a position of " + text_of(p, 1e3, "mm") + " in a workspace of ±" +
           text_of(reach, 1e3, "mm");
  }
  if (!(std::abs(sample.orientation.norm() - 1.0) <= 1e-6)) {
    return fmt::format("an orientation of norm {:.6g}", sample.orientation.norm());
  }
  if (sample.skew < Duration::zero() || sample.skew > kMostSkew) {
    return fmt::format("a skew of {:g} s", to_seconds(sample.skew));
  }
  const TimePoint now = bench.clock().now();
  if (sample.sampled_at < before - bench.stamp_tolerance() || sample.sampled_at > now) {
    return fmt::format("a stamp {:.3f} ms before the call and {:.3f} ms before its return",
                       1e3 * to_seconds(before - sample.sampled_at),
                       1e3 * to_seconds(now - sample.sampled_at));
  }
  return {};
}

CheckOutcome check_reading(DeviceBench& bench) {
  const TimePoint before = bench.clock().now();
  DeviceSample sample;
  if (!bench.device().read(sample)) return failed_exchange(kNoReading);
  const std::string wrong = wrong_reading(bench, sample, before);
  if (!wrong.empty()) return failed(wrong);
  return good(text_of(sample.hand_position_m, 1e3, "mm") + ", stamped when it was taken");
}

CheckOutcome check_buttons(DeviceBench& bench) {
  DeviceSample sample;
  if (!bench.device().read(sample)) return failed_exchange(kNoReading);
  const std::uint32_t count = bench.device().specification().button_count;
  if (count < 32 && sample.buttons >> count != 0) {
    return failed(fmt::format("buttons 0x{:x} of a device with {}", sample.buttons, count));
  }
  return good(fmt::format("{}", count));
}

CheckOutcome check_stamps(DeviceBench& bench) {
  TimePoint previous = bench.clock().now() - bench.stamp_tolerance();
  std::optional<TimePoint> first;
  for (int i = 0; i < 20; ++i) {
    DeviceSample reading;
    DeviceSample at_switch;
    if (!bench.device().read(reading)) return failed_exchange(kNoReading);
    if (!bench.device().apply(Vector3::Zero(), 1ms, at_switch)) return failed_exchange(kNoApply);
    if (reading.sampled_at < previous || at_switch.sampled_at < reading.sampled_at) {
      return failed("a stamp is older than the one before it");
    }
    previous = at_switch.sampled_at;
    if (!first) first = previous;
    bench.pass(100us);
  }
  if (previous == *first) return failed("20 readings and switches have the same stamp");
  return good("in order over 20 readings and switches");
}

// --- forces

CheckOutcome check_switch(DeviceBench& bench) {
  const Limp at_the_end(bench.device());
  const TimePoint before = bench.clock().now();
  DeviceSample at_switch;
  if (!bench.device().apply(gentle_force_newton(bench), 1ms, at_switch)) return failed(kRefused);
  const std::string wrong = wrong_reading(bench, at_switch, before);
  return wrong.empty() ? good("apply() returns the reading at which the force changed")
                       : failed(wrong);
}

bool may_reach_peak(DeviceBench& bench) {
  return bench.limit_newton() >= bench.device().specification().peak_force_newton;
}

/// The energy is counted with the force that apply() names.
CheckOutcome check_applied(DeviceBench& bench) {
  const Limp at_the_end(bench.device());
  const DeviceSpecification& s = bench.device().specification();
  DeviceSample at_switch;
  const Vector3 strongest_newton =
      Vector3(0.6, 0, -0.8) * std::min(bench.limit_newton(), s.peak_force_newton);
  constexpr int kMostReads = 5;
  for (const Vector3& requested_newton : {gentle_force_newton(bench), strongest_newton}) {
    if (!bench.device().apply(requested_newton, 20ms, at_switch)) return failed(kRefused);
    const double tolerance = kForceTolerance * (requested_newton.norm() + kForceFloorNewton);
    const Vector3 wanted_newton = s.force_axes * requested_newton;
    if (!((at_switch.applied_force_newton - wanted_newton).norm() < tolerance)) {
      return failed("apply() names " + text_of(at_switch.applied_force_newton, 1.0, "N") +
                    " as the force that acts, of " + text_of(wanted_newton, 1.0, "N"));
    }
    // what is measured may come some messages later; as device_node judges it
    DeviceSample later;
    bool is_measured = false;
    for (int read = 0; read < kMostReads && !is_measured; ++read) {
      bench.pass(bench.period());
      // applied anew, as in every tick: some motors hold a force for no longer
      if (!bench.device().apply(requested_newton, 20ms, later)) return failed(kRefused);
      if (!bench.device().read(later)) return failed("read() gives no reading");
      if (!later.measured_newton) break;
      const double off_newton = (*later.measured_newton - at_switch.applied_force_newton).norm();
      is_measured = off_newton <= 0.25 * wanted_newton.norm() + kForceFloorNewton;
    }
    if (later.measured_newton && !is_measured) {
      return failed("measured_newton is " + text_of(*later.measured_newton, 1.0, "N") + " while " +
                    text_of(at_switch.applied_force_newton, 1.0, "N") + " acts");
    }
  }
  const double most_newton =
      s.peak_force_newton + kForceTolerance * (s.peak_force_newton + kForceFloorNewton);
  if (may_reach_peak(bench) && bench.device().apply(5.0 * strongest_newton, 20ms, at_switch) &&
      at_switch.applied_force_newton.norm() > most_newton) {
    return failed("apply() names " + text_of(at_switch.applied_force_newton, 1.0, "N") +
                  ", more than its peak force");
  }
  if (!bench.device().apply(strongest_newton, Duration(-1), at_switch)) return failed(kRefused);
  if (!at_switch.applied_force_newton.isZero(0.0)) {
    return failed("apply() names a force where a lease below zero means none");
  }
  return good("apply() names the force that acts");
}

CheckOutcome check_force(DeviceBench& bench) {
  const Limp at_the_end(bench.device());
  if (!apply(bench, gentle_force_newton(bench), 20ms)) return failed(kRefused);
  bench.pass(5ms);
  return expect_motors(bench, gentle_force_newton(bench), "while the lease runs");
}

/// By the motion of a device that nobody holds, and by the force of the motors.
CheckOutcome check_lease(DeviceBench& bench) {
  if (!bench.device().specification().has_motor_watchdog) {
    return not_observable("no motor-side watchdog: the guarantee is not available");
  }
  const Limp at_the_end(bench.device());
  CheckOutcome ended = check_ends_by_motion(bench, {PushEnd::kLease, PushEnd::kLeaseAlone});
  if (ended.verdict == CheckVerdict::kFailed || !bench.motor_force_newton()) return ended;
  if (!apply(bench, gentle_force_newton(bench), 5ms)) return failed(kRefused);
  bench.pass(6ms);
  return expect_motors(bench, Vector3::Zero(), "1 ms after the lease");
}

/// Without a watchdog the reading says what acts: the force within its lease, none after it.
CheckOutcome check_reported_force(DeviceBench& bench) {
  if (bench.device().specification().has_motor_watchdog) return good("not needed: a watchdog");
  const Limp at_the_end(bench.device());
  HapticDevice& device = bench.device();
  DeviceSample at_switch;
  constexpr Duration kLease = 20ms;  // of a quarter: it is not to coast far
  if (!device.apply(gentle_force_newton(bench) / 4.0, kLease, at_switch)) return failed(kRefused);
  DeviceSample within;
  if (!device.read(within)) return failed_exchange(kNoReading);
  const double made_newton = at_switch.applied_force_newton.norm();
  if (within.sampled_at < at_switch.sampled_at + kLease / 2 &&
      within.applied_force_newton.norm() < 0.5 * made_newton) {
    return failed("a reading within the lease says that no force acts");
  }
  bench.pass(kLease + bench.stamp_tolerance() + 1ms);
  DeviceSample after;
  if (!device.read(after)) return failed_exchange(kNoReading);
  if (!after.applied_force_newton.isZero(0.0)) {
    return failed("a reading after the lease says that a force goes on: end it there");
  }
  // what it says is one thing, what its motors do another
  CheckOutcome ended =
      bench.motor_force_newton()
          ? expect_motors(bench, Vector3::Zero(), "after the first reading behind the lease")
          : check_ends_by_motion(bench, {PushEnd::kLease});
  if (ended.verdict != CheckVerdict::kGood) return ended;
  return good("the force within the lease, none after it: " + ended.text);
}

CheckOutcome check_latch(DeviceBench& bench) {
  const Limp at_the_end(bench.device());
  HapticDevice& device = bench.device();
  DeviceSample earlier;
  static_cast<void>(device.read(earlier));
  static_cast<void>(device.take_latched(earlier));
  DeviceSample at_switch;
  if (!device.apply(gentle_force_newton(bench) / 4.0, 5ms, at_switch)) return failed(kRefused);
  bench.pass(20ms);
  DeviceSample sample;
  if (!device.read(sample)) return failed_exchange(kNoReading);

  DeviceSample latched;
  const bool has_latch = device.specification().has_position_latch;
  if (device.take_latched(latched) != has_latch) {
    return failed(has_latch ? "has_position_latch, but take_latched() gave nothing"
                            : "take_latched() gave a position without has_position_latch");
  }
  DeviceSample again;
  if (device.take_latched(again)) return failed("take_latched() gave the same end twice");
  if (!has_latch) return good("none");
  if (!latched.hand_position_m.allFinite()) return failed("a latched position is not finite");
  const Duration age = latched.sampled_at - at_switch.sampled_at;
  if (age < Duration::zero() || age > 5ms + bench.stamp_tolerance()) {
    return failed(fmt::format("latched {:.1f} ms after the switch, at a lease of 5 ms",
                              1e3 * to_seconds(age)));
  }
  return good("the position at the end of the lease, once");
}

CheckOutcome check_renewal(DeviceBench& bench) {
  if (!bench.motor_force_newton()) return not_observable(kNoForceSeen);
  const Limp at_the_end(bench.device());
  for (int i = 0; i < 2; ++i) {
    if (!apply(bench, gentle_force_newton(bench), 10ms)) return failed(kRefused);
    bench.pass(6ms);
  }
  return expect_motors(bench, gentle_force_newton(bench), "6 ms after a lease was renewed");
}

CheckOutcome check_no_lease(DeviceBench& bench) {
  const Limp at_the_end(bench.device());
  CheckOutcome after;
  for (const Duration none : {Duration(0), Duration(-1)}) {
    if (!apply(bench, gentle_force_newton(bench), 20ms)) return failed(kRefused);
    if (!apply(bench, gentle_force_newton(bench), none)) {
      return failed("apply() refused a lease of zero or less: it means no force");
    }
    after = expect_motors(bench, Vector3::Zero(), "with a lease of zero or less");
    if (after.verdict == CheckVerdict::kFailed) return after;
  }
  if (after.verdict == CheckVerdict::kGood) return after;
  static_cast<void>(bench.device().release());
  return check_ends_by_motion(bench, {PushEnd::kZeroLease, PushEnd::kNegativeLease});
}

CheckOutcome check_peak(DeviceBench& bench) {
  if (!bench.motor_force_newton()) return not_observable(kNoForceSeen);
  if (!may_reach_peak(bench)) {
    return not_observable(fmt::format("not tried: the forces stay at {:.3g} N, below the peak",
                                      bench.limit_newton()));
  }
  const Limp at_the_end(bench.device());
  const double peak_newton = bench.device().specification().peak_force_newton;
  if (!apply(bench, Vector3(3, 0, -4) * peak_newton, 20ms)) {
    return failed("apply() refused five times the peak force: it is to be limited");
  }
  return expect_motors(bench, Vector3(0.6, 0, -0.8) * peak_newton,
                       "of a command of five times the peak");
}

CheckOutcome check_release(DeviceBench& bench) {
  const Limp at_the_end(bench.device());
  if (!apply(bench, gentle_force_newton(bench), 20ms)) return failed(kRefused);
  if (!bench.device().release()) return failed("release() says that the motors did not confirm it");
  CheckOutcome after = expect_motors(bench, Vector3::Zero(), "after release()");
  if (after.verdict == CheckVerdict::kFailed) return after;
  if (after.verdict == CheckVerdict::kNotObservable) {
    return check_ends_by_motion(bench, {PushEnd::kRelease});
  }
  if (!apply(bench, gentle_force_newton(bench), 20ms)) {
    return failed("apply() refused a force after release()");
  }
  return expect_motors(bench, gentle_force_newton(bench), "applied after release()");
}

CheckOutcome check_not_finite(DeviceBench& bench) {
  const Limp at_the_end(bench.device());
  CheckOutcome after;
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    if (!apply(bench, gentle_force_newton(bench), 20ms)) return failed(kRefused);
    if (apply(bench, Vector3(0, bad, 0), 20ms)) {
      return failed(fmt::format("apply() accepted a force of {:g} N", bad));
    }
    after = expect_motors(bench, Vector3::Zero(), "after a force that was refused");
    if (after.verdict == CheckVerdict::kFailed) return after;
  }
  return after.verdict == CheckVerdict::kGood ? good("refused, motors limp")
                                              : good("refused");  // the motors cannot be seen
}

CheckOutcome check_direction(DeviceBench& bench) {
  const Limp at_the_end(bench.device());
  const double seen_m = least_seen_m(bench);
  int seen = 0;
  for (int i = 0; i < 6; ++i) {
    const Vector3 along = (i % 2 == 0 ? 1.0 : -1.0) * Vector3::Unit(i / 2);
    const auto moved = push_away(bench, gentle_newton(bench) * along, kPush_m + seen_m);
    if (moved.empty()) return failed_exchange(kNoExchange);
    const Vector3& moved_m = moved.back().moved_m;
    if (moved_m.norm() < seen_m) continue;
    ++seen;
    if (moved_m.dot(along) < kLeastAlong * moved_m.norm()) {
      return failed("a force of " + text_of(gentle_newton(bench) * along, 1.0, "N") +
                    " moves it by " + text_of(moved_m, 1e3, "mm"));
    }
  }
  if (seen == 0) return not_observable(kNoMotion);
  return good(fmt::format("{} of 6 pushes moved it, each along the force", seen));
}

CheckOutcome check_allocation(DeviceBench& bench) {
  if (!bench.allocations()) return not_observable("counted by the test suite of a driver only");
  const Vector3 force_newton = gentle_force_newton(bench);
  const Limp at_the_end(bench.device());
  DeviceSample sample;
  bool is_ok = true;
  const std::uint64_t before = *bench.allocations();
  for (int i = 0; i < 10; ++i) {
    is_ok = bench.device().read(sample) && is_ok;
    is_ok = bench.device().apply(force_newton, 2ms, sample) && is_ok;
    static_cast<void>(bench.device().take_latched(sample));
    bench.pass(1ms);
  }
  is_ok = bench.device().release() && is_ok;
  const std::uint64_t count = *bench.allocations() - before;
  if (!is_ok) return failed_exchange(kNoExchange);
  return count == 0 ? good("none in 10 ticks") : failed(fmt::format("{} in 10 ticks", count));
}

/// Of the steady clock, whatever clock the device is on.
CheckOutcome check_pace(DeviceBench& bench) {
  const Limp at_the_end(bench.device());
  const SteadyClock steady;
  std::vector<double> tick_s;
  tick_s.reserve(kExchanges);
  for (int i = 0; i < kExchanges; ++i) {
    DeviceSample sample;
    const TimePoint begin = steady.now();
    const bool is_ok = bench.device().read(sample) &&
                       bench.device().apply(Vector3::Zero(), bench.period(), sample);
    tick_s.push_back(to_seconds(steady.now() - begin));
    if (!is_ok) return failed_exchange("read() or apply() failed");
  }
  std::nth_element(tick_s.begin(), tick_s.begin() + kExchanges / 2, tick_s.end());
  const double median_s = tick_s[kExchanges / 2];
  const std::string found = fmt::format(
      "{:.0f} µs (median) for read() and apply(), {:.0f} µs the slowest of {}, of a period "
      "of {:.0f} µs",
      1e6 * median_s, 1e6 * *std::max_element(tick_s.begin(), tick_s.end()), kExchanges,
      1e6 * to_seconds(bench.period()));
  return median_s < to_seconds(bench.period()) ? good(found) : failed(found);
}

/// Every reading counts, also where the check does not look at it.
template <CheckOutcome (*check)(DeviceBench&)>
CheckOutcome watched(DeviceBench& bench) {
  WatchedBench seen(bench);
  CheckOutcome outcome = check(seen);
  if (outcome.verdict == CheckVerdict::kFailed || !seen.was_not_finite()) return outcome;
  return failed("a reading has a position, an orientation or a force that is not finite");
}

constexpr std::array kChecks{
    DeviceCheck{"start", "open the device with its motors at zero", watched<check_start>},
    DeviceCheck{"specification", "fill in DeviceSpecification; SI units",
                watched<check_specification>},
    DeviceCheck{"reading",
                "convert to metres, unit quaternions and the given clock; stamp a reading when it "
                "is taken",
                watched<check_reading>},
    DeviceCheck{"buttons", "mask what the device does not have, or raise button_count",
                watched<check_buttons>},
    DeviceCheck{"stamps", "stamp readings with the given clock, which does not go back",
                watched<check_stamps>},
    DeviceCheck{"pace", "shorten the transfers, or lower device.rate_hz", watched<check_pace>},
    DeviceCheck{
        "motors",
        "mind signs, axes and gains of the motors: for more than f_co, device_node enables no real "
        "device whose positions do not follow a small push",
        watched<check_motors>, true},
    DeviceCheck{"switch", "return from apply() the reading of when the force changed",
                watched<check_switch>},
    DeviceCheck{"direction",
                "give positions and forces in one frame, D of common/core/messages.h; mind the "
                "signs and the order of the axes",
                watched<check_direction>},
    DeviceCheck{"lag",
                "pass on the position of this transfer, never an older one; say in skew how much "
                "older than its stamp it may be, and in device.latency_us what filters, buffers "
                "and motors add",
                watched<check_lag>},
    DeviceCheck{"force", "convert to newtons at the tool tip", watched<check_force>},
    DeviceCheck{"applied",
                "give applied_force_newton of a switch, as the motors limit and quantise it",
                watched<check_applied>},
    DeviceCheck{"renewal", "each apply() begins a new lease", watched<check_renewal>},
    DeviceCheck{"lease",
                "hand the lease to the amplifier; without a watchdog there, has_motor_watchdog = "
                "false",
                watched<check_lease>},
    DeviceCheck{"reported",
                "without a watchdog end a force with the first read() after its lease, and say in "
                "applied_force_newton of each reading what acts from it on",
                watched<check_reported_force>},
    DeviceCheck{"latch", "see take_latched() in device_node/device.h", watched<check_latch>},
    DeviceCheck{"no lease", "a lease of 0 or less is no force", watched<check_no_lease>},
    DeviceCheck{"peak", "limit the force to peak_force_newton along its direction",
                watched<check_peak>},
    DeviceCheck{"release",
                "release() is zero force at once, until the next apply(), and true once the device "
                "confirmed "
                "it",
                watched<check_release>},
    DeviceCheck{"not finite", "return false for a force that is not finite, motors limp",
                watched<check_not_finite>},
    DeviceCheck{"allocation", "allocate when the device is opened, not in a tick",
                watched<check_allocation>},
    // the last one: a device that needs a calibration after it is of no use to another check
    DeviceCheck{
        "reopen",
        "reopen() counts on from where the device is, or leaves phase() at kConnected until "
        "a person has calibrated it",
        watched<check_reopen>}};

}  // namespace

std::span<const DeviceCheck> device_checks() { return kChecks; }

}  // namespace palpate::device
