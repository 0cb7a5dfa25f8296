// SPDX-License-Identifier: Apache-2.0
// scripted_device.h — a device for tests of the tick: it follows its script and records what its
// motors did.
#pragma once

#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "common/core/clock.h"
#include "device_node/device.h"

namespace palpate::test {

/// The hand moves along x at 1 m/s from 0 at the clock's origin, so each position tells its time.
class ScriptedDevice : public device::HapticDevice {
 public:
  /// A force that began to act; it acts until the next one, its own end, or a release.
  struct Write {
    TimePoint at{};
    Vector3 force_on_hand_newton = Vector3::Zero();
    TimePoint until{};
  };

  explicit ScriptedDevice(const Clock& clock, bool is_simulated = true) : clock_(clock) {
    specification_ = {.model_name = "scripted",
                      .workspace_half_extent_m = Vector3::Ones(),
                      .peak_force_newton = 3.3,
                      .continuous_force_newton = 0.88,
                      .position_resolution_m = 0.0,
                      .button_count = 2,
                      .is_simulated = is_simulated,
                      .has_motor_watchdog = true};
    writes.reserve(20'000);
  }

  std::vector<Write> writes;
  std::optional<Vector3> position_m;  ///< instead of the moving hand
  Quaternion orientation = Quaternion::Identity();
  std::uint32_t buttons = 0;
  std::optional<TimePoint> stamp = {};               ///< of the readings, instead of now
  std::optional<device::DeviceSample> latched = {};  ///< as a force ended by itself
  bool fails_to_read = false;
  device::DeviceError error = device::DeviceError::kFailed;  ///< why it fails
  bool reopens = true;
  bool confirms_release = true;  ///< false: the motors go on as if they had not been told
  DevicePhase phase_now = DevicePhase::kCalibrated;
  int reopenings = 0;
  bool takes_calibration = true;
  int calibrations = 0;
  /// What becomes of a force, limited or quantised.
  std::function<Vector3(const Vector3&)> motors = [](const Vector3& force) { return force; };
  bool fails_to_apply = false;
  std::function<void()> before_switch = {};  ///< called in apply(), before the force changes
  std::function<void()> before_release = {};
  int releases = 0;

  [[nodiscard]] const device::DeviceSpecification& specification() const noexcept override {
    return specification_;
  }
  [[nodiscard]] bool read(device::DeviceSample& sample) noexcept override {
    const TimePoint now = clock_.now();
    sample = {.hand_position_m = position_m.value_or(Vector3(seconds_of(now), 0, 0)),
              .orientation = orientation,
              .buttons = buttons,
              .sampled_at = stamp.value_or(now)};
    if (!specification_.has_motor_watchdog && !writes.empty()) {
      // the driver ends a force with the first message after its lease
      if (now >= writes.back().until) writes.push_back({now, Vector3::Zero(), now});
      sample.applied_force_newton = writes.back().force_on_hand_newton;
    }
    return !fails_to_read;
  }
  [[nodiscard]] bool apply(const Vector3& force_on_hand_newton, Duration lease,
                           device::DeviceSample& at_switch) noexcept override {
    if (before_switch) before_switch();
    if (fails_to_apply || !read(at_switch)) return false;
    at_switch.applied_force_newton = motors(force_on_hand_newton);
    writes.push_back({clock_.now(), at_switch.applied_force_newton, clock_.now() + lease});
    return true;
  }
  [[nodiscard]] bool take_latched(device::DeviceSample& at_end) noexcept override {
    if (!latched) return false;
    at_end = *std::exchange(latched, std::nullopt);
    return true;
  }
  [[nodiscard]] bool release() noexcept override {
    if (before_release) before_release();
    ++releases;
    if (!confirms_release) return false;
    writes.push_back({clock_.now(), Vector3::Zero(), clock_.now()});
    return true;
  }
  [[nodiscard]] DevicePhase phase() const noexcept override { return phase_now; }

  [[nodiscard]] device::DeviceError last_error() const noexcept override { return error; }
  [[nodiscard]] bool reopen(Duration /*within*/) noexcept override {
    ++reopenings;
    return reopens;
  }

  [[nodiscard]] bool calibrate() noexcept override {
    ++calibrations;
    if (takes_calibration) phase_now = DevicePhase::kCalibrated;
    return takes_calibration;
  }

  void answers_uncalibrated(bool does) { specification_.answers_uncalibrated = does; }
  void has_watchdog(bool is_there) { specification_.has_motor_watchdog = is_there; }

  /// What the motors did at `t`, from the writes alone.
  [[nodiscard]] Vector3 motor_force_newton(TimePoint t) const {
    const Write* acting = nullptr;
    for (const Write& write : writes) {
      if (write.at <= t) acting = &write;
    }
    const bool goes_on = !specification_.has_motor_watchdog;
    return acting != nullptr && (goes_on || t < acting->until) ? acting->force_on_hand_newton
                                                               : Vector3(Vector3::Zero());
  }

 private:
  device::DeviceSpecification specification_;
  const Clock& clock_;
};

}  // namespace palpate::test
