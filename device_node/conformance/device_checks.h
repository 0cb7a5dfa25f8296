// SPDX-License-Identifier: Apache-2.0
// device_checks.h — what every driver must do, as checks that a test and `palpate conform device`
// run. The device pushes with up to DeviceBench::limit_newton(); nobody needs to hold it.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>

#include "common/core/clock.h"
#include "common/session/device_profile.h"
#include "device_node/device.h"

namespace palpate::device {

/// A device under test, its clock, and what can be seen of it from outside.
class DeviceBench {
 public:
  virtual ~DeviceBench() = default;
  /// Opened, limp, held by nobody or by a still hand.
  [[nodiscard]] virtual HapticDevice& device() = 0;
  /// The one that the device stamps with.
  [[nodiscard]] virtual const Clock& clock() const = 0;
  /// Returns after that time on clock().
  virtual void pass(Duration time) = 0;
  /// The time of a transfer; zero on a clock that stands.
  [[nodiscard]] virtual Duration stamp_tolerance() const = 0;
  /// Of the tick that the device is for.
  [[nodiscard]] virtual Duration period() const = 0;
  /// What the motors do now [N], D; none: not observable.
  [[nodiscard]] virtual std::optional<Vector3> motor_force_newton() = 0;
  /// Friction and resolution that the session claims; the default claims none.
  [[nodiscard]] virtual DeviceProfile profile() const {
    return {.viscous_newton_s_per_m = 0.0, .coulomb_newton = 0.0, .position_resolution_m = 0.0};
  }
  /// Of positions and forces together, beyond the skew, that the session claims.
  [[nodiscard]] virtual Duration latency() const { return {}; }
  /// No check asks for more force. Below the peak force of the device its limit is not checked.
  [[nodiscard]] virtual double limit_newton() const {
    return std::numeric_limits<double>::infinity();
  }
  /// Allocations of this thread so far; none: not counted.
  [[nodiscard]] virtual std::optional<std::uint64_t> allocations() const { return std::nullopt; }
};

/// A device on the clock that it was opened with. Both must outlive it.
class OpenedDevice : public DeviceBench {
 public:
  OpenedDevice(HapticDevice& device, Clock& clock, Duration period, Duration stamp_tolerance,
               const std::optional<DeviceProfile>& profile = {})
      : device_(device),
        clock_(clock),
        period_(period),
        stamp_tolerance_(stamp_tolerance),
        profile_(profile.value_or(DeviceBench::profile())) {}

  [[nodiscard]] HapticDevice& device() override { return device_; }
  [[nodiscard]] const Clock& clock() const override { return clock_; }
  void pass(Duration time) override { clock_.sleep_until(clock_.now() + time); }
  [[nodiscard]] Duration stamp_tolerance() const override { return stamp_tolerance_; }
  [[nodiscard]] Duration period() const override { return period_; }
  [[nodiscard]] DeviceProfile profile() const override { return profile_; }
  [[nodiscard]] std::optional<Vector3> motor_force_newton() override {
    const auto* motors = dynamic_cast<const MotorForceSource*>(&device_);
    DeviceSample sample;
    if (motors == nullptr || !device_.read(sample)) return std::nullopt;
    return motors->motor_force_on_hand_newton();
  }

 private:
  HapticDevice& device_;
  Clock& clock_;
  Duration period_;
  Duration stamp_tolerance_;
  DeviceProfile profile_;
};

enum class CheckVerdict : std::uint8_t { kGood, kNotObservable, kFailed };

struct CheckOutcome {
  CheckVerdict verdict = CheckVerdict::kGood;
  std::string text = {};    ///< what was found
  std::string remedy = {};  ///< empty: that of the check
};

struct DeviceCheck {
  const char* name;    ///< "lease"
  const char* remedy;  ///< where it fails
  CheckOutcome (*run)(DeviceBench& bench);
  /// The first that pushes, a little: on hardware none of those after it may, unless it is good.
  bool is_first_push = false;
};

/// In the order in which one device can go through all of them; the first needs one that was just
/// opened. Each leaves the motors limp.
[[nodiscard]] std::span<const DeviceCheck> device_checks();

}  // namespace palpate::device
