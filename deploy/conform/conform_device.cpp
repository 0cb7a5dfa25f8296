// SPDX-License-Identifier: Apache-2.0
#include "deploy/conform/conform_device.h"

#include "common/core/check.h"
#include "device_node/conformance/device_checks.h"
#include "device_node/simulation/hand.h"

namespace palpate {

using namespace palpate::device;

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
  for (const DeviceCheck& check : device_checks()) {
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
