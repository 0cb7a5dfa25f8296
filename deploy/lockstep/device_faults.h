// SPDX-License-Identifier: Apache-2.0
// device_faults.h — the process of a device that the operating system does not run in time: ticks
// begin late, and switches come after the check of their deadline.
#pragma once

#include <algorithm>
#include <cstdint>

#include "common/core/random.h"
#include "common/session/link_config.h"
#include "deploy/lockstep/virtual_time.h"
#include "device_node/device.h"

namespace palpate {

/// A device whose process is preempted, as `faults` say. Other nodes run on meanwhile.
class PreemptedDevice final : public device::HapticDevice {
 public:
  PreemptedDevice(device::HapticDevice& device, const DeviceFaults& faults, VirtualTime& time,
                  std::uint64_t seed)
      : device_(device), faults_(faults), time_(time), start_(time.now()), random_(seed) {}

  /// How late the tick of this appointment begins.
  [[nodiscard]] Duration lateness(TimePoint scheduled_at, Duration period) {
    Duration late{};
    for (const FaultWindow& skip : faults_.skips) {
      if (const auto left = skip.left(scheduled_at - start_)) late = std::max(late, *left);
    }
    if (faults_.late_ratio > 0.0 && random_.chance(faults_.late_ratio)) {
      late = std::max(
          late, from_seconds(to_seconds(period) * random_.uniform(1.0, faults_.late_periods)));
    }
    return late;
  }

  [[nodiscard]] const device::DeviceSpecification& specification() const noexcept override {
    return device_.specification();
  }
  [[nodiscard]] bool read(device::DeviceSample& sample) noexcept override {
    return device_.read(sample);
  }
  [[nodiscard]] bool apply(const Vector3& force_on_hand_newton, Duration lease,
                           device::DeviceSample& at_switch) noexcept override {
    if (faults_.late_switch_ratio > 0.0 && random_.chance(faults_.late_switch_ratio)) {
      time_.sleep_until(time_.now() +
                        from_seconds(random_.uniform() * to_seconds(faults_.late_switch)));
    }
    return device_.apply(force_on_hand_newton, lease, at_switch);
  }
  void set_wrist_torque(const Vector3& torque_on_hand_newton_m) noexcept override {
    device_.set_wrist_torque(torque_on_hand_newton_m);
  }
  [[nodiscard]] bool take_latched(device::DeviceSample& at_end) noexcept override {
    return device_.take_latched(at_end);
  }
  [[nodiscard]] bool release() noexcept override { return device_.release(); }
  [[nodiscard]] DevicePhase phase() const noexcept override { return device_.phase(); }
  [[nodiscard]] bool calibrate() noexcept override { return device_.calibrate(); }
  [[nodiscard]] device::DeviceError last_error() const noexcept override {
    return device_.last_error();
  }
  void tap(device::WireTap* tap) noexcept override { device_.tap(tap); }
  [[nodiscard]] bool reopen(Duration within) noexcept override { return device_.reopen(within); }

 private:
  device::HapticDevice& device_;
  DeviceFaults faults_;
  VirtualTime& time_;
  TimePoint start_;
  Random random_;
};

}  // namespace palpate
