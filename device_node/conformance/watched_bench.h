// SPDX-License-Identifier: Apache-2.0
// watched_bench.h — a device under test, every reading of which is looked at, whatever a check
// makes of it.
#pragma once

#include "device_node/conformance/device_checks.h"

namespace palpate::device {

/// Both live as long as one check.
class WatchedBench final : public DeviceBench, private HapticDevice {
 public:
  explicit WatchedBench(DeviceBench& bench) : bench_(bench) {}

  /// A reading, a switch or a latched end had a number that is not finite.
  [[nodiscard]] bool was_not_finite() const noexcept { return was_not_finite_; }

  [[nodiscard]] HapticDevice& device() override { return *this; }
  [[nodiscard]] const Clock& clock() const override { return bench_.clock(); }
  void pass(Duration time) override { bench_.pass(time); }
  [[nodiscard]] Duration stamp_tolerance() const override { return bench_.stamp_tolerance(); }
  [[nodiscard]] Duration period() const override { return bench_.period(); }
  [[nodiscard]] std::optional<Vector3> motor_force_newton() override {
    return bench_.motor_force_newton();
  }
  [[nodiscard]] DeviceProfile profile() const override { return bench_.profile(); }
  [[nodiscard]] Duration latency() const override { return bench_.latency(); }
  [[nodiscard]] double limit_newton() const override { return bench_.limit_newton(); }
  [[nodiscard]] std::optional<std::uint64_t> allocations() const override {
    return bench_.allocations();
  }

 private:
  [[nodiscard]] const DeviceSpecification& specification() const noexcept override {
    return bench_.device().specification();
  }
  [[nodiscard]] bool read(DeviceSample& sample) noexcept override {
    return note(bench_.device().read(sample), sample);
  }
  [[nodiscard]] bool apply(const Vector3& force_on_hand_newton, Duration lease,
                           DeviceSample& at_switch) noexcept override {
    return note(bench_.device().apply(force_on_hand_newton, lease, at_switch), at_switch);
  }
  [[nodiscard]] bool take_latched(DeviceSample& at_end) noexcept override {
    return note(bench_.device().take_latched(at_end), at_end);
  }
  [[nodiscard]] bool release() noexcept override { return bench_.device().release(); }
  [[nodiscard]] DevicePhase phase() const noexcept override { return bench_.device().phase(); }
  [[nodiscard]] bool reopen(Duration within) noexcept override {
    return bench_.device().reopen(within);
  }

  bool note(bool is_there, const DeviceSample& sample) noexcept {
    const bool is_finite = sample.hand_position_m.allFinite() &&
                           sample.orientation.coeffs().allFinite() &&
                           sample.applied_force_newton.allFinite();
    was_not_finite_ = was_not_finite_ || (is_there && !is_finite);
    return is_there;
  }

  DeviceBench& bench_;
  bool was_not_finite_ = false;
};

}  // namespace palpate::device
