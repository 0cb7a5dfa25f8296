// SPDX-License-Identifier: Apache-2.0
#include "deploy/conform/conform_device.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <stop_token>
#include <thread>

#include "common/core/check.h"
#include "common/process/realtime.h"
#include "device_node/conformance/device_checks.h"
#include "device_node/release.h"
#include "device_node/simulation/hand.h"

namespace palpate {

using namespace palpate::device;

namespace {

/// Notices a check that does not end.
class HangWatch {
 public:
  /// `options` must outlive it.
  explicit HangWatch(const ConformDeviceOptions& options)
      : options_(options), thread_([this](const std::stop_token& stop) { watch(stop); }) {}

  void begin(const DeviceCheck& check) {
    const std::lock_guard lock(mutex_);
    check_ = &check;
    changed_.notify_one();
  }

 private:
  void watch(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
      const DeviceCheck* const check = check_;
      const bool has_ended =
          changed_.wait_for(lock, stop, options_.hang_after, [&] { return check_ != check; });
      if (has_ended || stop.stop_requested() || check == nullptr) continue;
      if (options_.on_hang) {
        options_.on_hang({.check = check->name,
                          .is_good = false,
                          .text = fmt::format("a call of the driver has not returned for {:.3g} s",
                                              to_seconds(options_.hang_after)),
                          .remedy = "return from read(), apply(), take_latched() and release() "
                                    "after one transfer, with an error if there is no answer"});
      }
      return;
    }
  }

  const ConformDeviceOptions& options_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  const DeviceCheck* check_ = nullptr;  // that runs; null: none has begun
  std::jthread thread_;                 // last: ends before what it uses
};

/// Without a watchdog, and nothing in the session that accepts it: as identify.
constexpr double kMostUnguardedNewton = 1.0;

/// Of an arm from where the checks began. A push ends after 1 mm; what goes so far coasts, or runs.
constexpr double kMostTravel_m = 0.05;

/// Thrown between two calls of the driver.
struct ChecksStopped {
  std::string why{};  ///< behind "the checks were stopped"
};

/// Sees how far the arm is from where the checks began.
class TravelWatch final : public HapticDevice {
 public:
  /// `device` must outlive it.
  explicit TravelWatch(HapticDevice& device) : device_(device) {}

  [[nodiscard]] double travel_m() const { return travel_m_; }

  [[nodiscard]] const DeviceSpecification& specification() const noexcept override {
    return device_.specification();
  }
  [[nodiscard]] bool read(DeviceSample& sample) noexcept override {
    if (!device_.read(sample)) return false;
    if (sample.hand_position_m.allFinite()) {
      if (!start_m_) start_m_ = sample.hand_position_m;
      travel_m_ = (sample.hand_position_m - *start_m_).norm();
    }
    return true;
  }
  [[nodiscard]] bool apply(const Vector3& force_on_hand_newton, Duration lease,
                           DeviceSample& at_switch) noexcept override {
    return device_.apply(force_on_hand_newton, lease, at_switch);
  }
  [[nodiscard]] bool take_latched(DeviceSample& at_end) noexcept override {
    return device_.take_latched(at_end);
  }
  [[nodiscard]] bool release() noexcept override { return device_.release(); }
  [[nodiscard]] DevicePhase phase() const noexcept override { return device_.phase(); }
  [[nodiscard]] bool calibrate() noexcept override { return device_.calibrate(); }
  [[nodiscard]] DeviceError last_error() const noexcept override { return device_.last_error(); }
  void tap(WireTap* tap) noexcept override { device_.tap(tap); }
  [[nodiscard]] bool reopen(Duration within) noexcept override { return device_.reopen(within); }

 private:
  HapticDevice& device_;
  std::optional<Vector3> start_m_;
  double travel_m_ = 0.0;
};

class StoppableBench final : public OpenedDevice {
 public:
  StoppableBench(HapticDevice& device, Clock& clock, Duration period, Duration stamp_tolerance,
                 const ConformDeviceOptions& options, double limit_newton,
                 const TravelWatch* travel)
      : OpenedDevice(device, clock, period, stamp_tolerance, options.profile),
        stop_(options.start_up.stop),
        latency_(options.latency),
        limit_newton_(limit_newton),
        travel_(travel) {}

  void pass(Duration time) override {
    if (stop_.stop_requested()) throw ChecksStopped();
    if (travel_ != nullptr && travel_->travel_m() > kMostTravel_m) {
      throw ChecksStopped{fmt::format(
          ": the arm is {:.0f} mm from where they began, pushed or moved by hand (a push ends "
          "after 1 mm, and an arm with little friction coasts on; motors that push one way "
          "whatever the sign carry it off): give a smaller device.peak_force_newton than the "
          "{:.2g} "
          "N of these pushes, or pad its end stops",
          1e3 * travel_->travel_m(), limit_newton_)};
    }
    OpenedDevice::pass(time);
  }
  [[nodiscard]] Duration latency() const override { return latency_; }
  [[nodiscard]] double limit_newton() const override { return limit_newton_; }

 private:
  std::stop_token stop_;
  Duration latency_;
  double limit_newton_;
  const TravelWatch* travel_;  // of a real device
};

/// @throws SetupError  what the user did not agree to
void check_consent(const DeviceSpecification& specification, const ConformDeviceOptions& options,
                   double limit_newton) {
  if (specification.is_simulated) return;
  if (!options.may_move_hardware) {
    throw SetupError(
        fmt::format("device \"{}\" is real and would move by itself, with up to {:.3g} N "
                    "(device.peak_force_newton); clear its workspace, take the hand off and give "
                    "--i-understand-this-moves-the-device",
                    specification.model_name, limit_newton));
  }
  if (!specification.has_motor_watchdog && !options.may_lack_watchdog) {
    throw SetupError(
        fmt::format("device \"{}\" has no motor-side watchdog: it would go on pushing, with up to "
                    "{:.3g} N (device.peak_force_newton), if this program were killed; with a hand "
                    "at its power switch, `palpate conform device --without-watchdog` checks it",
                    specification.model_name, limit_newton));
  }
}

/// No push is stronger.
double limit_of(const DeviceSpecification& specification, const ConformDeviceOptions& options) {
  const double limit_newton = std::min(options.peak_force_newton, specification.peak_force_newton);
  const bool is_guarded = specification.is_simulated || specification.has_motor_watchdog;
  return is_guarded || options.accepts_no_watchdog ? limit_newton
                                                   : std::min(limit_newton, kMostUnguardedNewton);
}

}  // namespace

std::vector<ConformFinding> conform_device(const Session& session,
                                           const ConformDeviceOptions& options) {
  const DriverRegistry drivers = all_drivers(
      {.simulated = {.device = session.side().simulated, .hand = nobody(), .seed = session.seed},
       .driver = session.side().driver});
  SteadyClock steady(session.side().realtime.wait);
  const DeviceConfig& device = session.side().device;
  ConformDeviceOptions of_session = options;
  of_session.profile = device.profile;
  of_session.latency = device.latency;
  of_session.peak_force_newton = device.peak_force_newton;
  of_session.accepts_no_watchdog = device.accepts_no_motor_watchdog;
  of_session.realtime = session.side().realtime;
  return conform_device(drivers.at(driver_name(session.side().driver)),
                        from_seconds(1.0 / device.rate_hz), steady, of_session);
}

std::vector<ConformFinding> conform_device(const Driver& driver, Duration period, Clock& steady,
                                           const ConformDeviceOptions& options) {
  ManualClock virtual_time;
  Clock& clock = driver.is_simulated ? virtual_time : steady;
  const auto device = driver.open(clock, options.start_up);
  const DeviceSpecification& specification = device->specification();
  const double limit_newton = limit_of(specification, options);
  check_consent(specification, options, limit_newton);
  if (!specification.is_simulated) {
    await_calibration(*device, options.start_up);
    await_acknowledgement(options.start_up,
                          "Take the hand off the device and clear its way; then press Enter, or "
                          "send SIGUSR2: it moves by itself.");
  }

  // a simulated one is asked for the force of its motors, too, which stands behind the interface
  TravelWatch travel(*device);
  StoppableBench bench(driver.is_simulated ? *device : travel, clock, period,
                       driver.is_simulated ? Duration{} : period, options, limit_newton,
                       driver.is_simulated ? nullptr : &travel);
  std::vector<ConformFinding> findings;
  HangWatch watch(options);
  if (!driver.is_simulated && options.realtime) {
    options.start_up.prompt("event=realtime " + enter_realtime(*options.realtime).text);
  }
  bool may_push = true;
  for (const DeviceCheck& check : device_checks()) {
    watch.begin(check);
    CheckOutcome outcome{CheckVerdict::kNotObservable,
                         "not tried: a small push along each axis must be seen first (motors)"};
    try {
      if (options.start_up.stop.stop_requested()) throw ChecksStopped();
      if (may_push) outcome = check.run(bench);
    } catch (const ChecksStopped& stopped) {
      const bool is_released = release_for_certain(*device, clock);
      throw std::runtime_error("the checks were stopped" + stopped.why + "; " +
                               (is_released ? "the motors were released" : kNotReleased));
    }
    const bool is_good = outcome.verdict == CheckVerdict::kGood;
    const bool is_checked = outcome.verdict != CheckVerdict::kNotObservable;
    if (check.is_first_push && !specification.is_simulated) may_push = is_good;
    findings.push_back({.check = check.name,
                        .is_good = is_good,
                        .text = outcome.text,
                        .remedy = is_good || !is_checked   ? ""
                                  : outcome.remedy.empty() ? check.remedy
                                                           : outcome.remedy,
                        .is_checked = is_checked});
    if (options.on_finding) options.on_finding(findings.back());
  }
  return findings;
}

}  // namespace palpate
