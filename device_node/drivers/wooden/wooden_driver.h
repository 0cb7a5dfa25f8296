// SPDX-License-Identifier: Apache-2.0
// wooden_driver.h — WoodenHaptics and Polhem boards, by hidraw. Never run on hardware: tested
// against the emulator of device_node/emulators.
#pragma once

#include <memory>

#include "common/core/clock.h"
#include "common/session/driver_config.h"
#include "device_node/device.h"
#include "device_node/drivers/start_up.h"
#include "device_node/drivers/wooden/wooden_arm.h"

namespace palpate::device {

inline constexpr const char* kWoodenDriver = "wooden";

/// The arm of a session, and what lies between its bodies and their motors.
struct WoodenDrive {
  explicit WoodenDrive(const WoodenConfig& config);

  WoodenArm arm;
  Vector3 rad_per_count;    ///< of each body
  Vector3 ma_per_newton_m;  ///< of its motor, for a torque on the body
  double largest_ma = 0.0;
};

/// Waits for the calibration, unless the session says that it was done.
/// @throws SetupError  no board, or not calibrated within `start_up.limit`
[[nodiscard]] std::unique_ptr<HapticDevice> open_wooden(const WoodenConfig& config,
                                                        const Clock& clock,
                                                        const StartUp& start_up);

}  // namespace palpate::device
