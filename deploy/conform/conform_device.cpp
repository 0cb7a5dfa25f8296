// SPDX-License-Identifier: Apache-2.0
#include "deploy/conform/conform_device.h"

#include <spdlog/fmt/fmt.h>

#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <thread>

#include "common/core/check.h"
#include "device_node/conformance/device_checks.h"
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

}  // namespace

std::vector<ConformFinding> conform_device(const Session& session,
                                           const ConformDeviceOptions& options) {
  const DriverRegistry drivers = all_drivers(
      {.simulated = {.device = session.side().simulated, .hand = nobody(), .seed = session.seed},
       .driver = session.side().driver});
  SteadyClock steady(session.side().realtime.wait);
  ConformDeviceOptions with_profile = options;
  with_profile.profile = session.side().device.profile;
  return conform_device(drivers.at(driver_name(session.side().driver)),
                        from_seconds(1.0 / session.side().device.rate_hz), steady, with_profile);
}

std::vector<ConformFinding> conform_device(const Driver& driver, Duration period, Clock& steady,
                                           const ConformDeviceOptions& options) {
  ManualClock virtual_time;
  Clock& clock = driver.is_simulated ? virtual_time : steady;
  const auto device = driver.open(clock, options.start_up);
  const DeviceSpecification& specification = device->specification();
  if (!specification.is_simulated && !options.may_move_hardware) {
    throw SetupError("device \"" + specification.model_name +
                     "\" is real and would move by itself, with up to a third of its continuous "
                     "force; clear its workspace, take the hand off and give "
                     "--i-understand-this-moves-the-device");
  }

  if (!specification.is_simulated) {
    await_calibration(*device, options.start_up);
    await_acknowledgement(options.start_up,
                          "Take the hand off the device and clear its way; then press Enter, or "
                          "send SIGUSR2: it moves by itself.");
  }

  OpenedDevice bench(*device, clock, period, driver.is_simulated ? Duration{} : period,
                     options.profile);
  std::vector<ConformFinding> findings;
  HangWatch watch(options);
  for (const DeviceCheck& check : device_checks()) {
    watch.begin(check);
    const CheckOutcome outcome = check.run(bench);
    const bool is_good = outcome.verdict == CheckVerdict::kGood;
    const bool is_checked = outcome.verdict != CheckVerdict::kNotObservable;
    findings.push_back({.check = check.name,
                        .is_good = is_good,
                        .text = outcome.text,
                        .remedy = is_good || !is_checked ? "" : check.remedy,
                        .is_checked = is_checked});
    if (options.on_finding) options.on_finding(findings.back());
  }
  return findings;
}

}  // namespace palpate
