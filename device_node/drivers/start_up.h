// SPDX-License-Identifier: Apache-2.0
// start_up.h — what a driver may ask of the person at the device while it opens it.
#pragma once

#include <chrono>
#include <functional>
#include <stop_token>
#include <string>
#include <thread>

#include "common/core/check.h"
#include "common/core/time.h"
#include "device_node/device.h"

namespace palpate::device {

struct StartUp {
  /// Tells the person what to do, or what the driver found: one line.
  std::function<void(const std::string& text)> prompt = [](const std::string&) {};
  /// Longest time until the device is ready.
  Duration limit = std::chrono::seconds(20);
  /// Ends the wait.
  std::stop_token stop = {};
  /// Whether the person has acknowledged since the last call; empty: nobody can.
  std::function<bool()> is_acknowledged = {};
};

/// Prompts, and waits for the person. Time alone never ends it.
/// @throws SetupError  nobody can acknowledge, or the stop was requested
inline void await_acknowledgement(const StartUp& start_up, const std::string& prompt) {
  if (!start_up.is_acknowledged) throw SetupError("nobody can acknowledge: " + prompt);
  static_cast<void>(start_up.is_acknowledged());  // what came before the prompt does not count
  start_up.prompt(prompt);
  while (!start_up.is_acknowledged()) {
    if (start_up.stop.stop_requested()) throw SetupError("stopped before anybody acknowledged");
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

/// Until the device is calibrated: a person does what it asks for, and acknowledges.
/// @throws SetupError  as await_acknowledgement(), or the device has no connection
inline void await_calibration(HapticDevice& device, const StartUp& start_up) {
  while (device.phase() != DevicePhase::kCalibrated) {
    if (device.phase() == DevicePhase::kClosed) {
      throw SetupError("device \"" + device.specification().model_name +
                       "\" lost its connection; connect it and start again");
    }
    await_acknowledgement(start_up, device.specification().calibration + "; then acknowledge");
    static_cast<void>(device.calibrate());
  }
}

}  // namespace palpate::device
