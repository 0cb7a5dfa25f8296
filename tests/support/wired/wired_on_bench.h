// SPDX-License-Identifier: Apache-2.0
// wired_on_bench.h — a device over its wire as DeviceNodeBench makes one.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <vector>

#include "device_node/simulation/true_state.h"
#include "tests/support/machine/machine.h"
#include "tests/support/wired/wired_device.h"

namespace palpate::test {

struct WiredSpec {
  Side side;
  WiredDriver driver;
  std::vector<device::PlannedFault> faults;
  Duration limit = test::patience(std::chrono::seconds(1));  ///< of a transfer, in real time
  std::uint64_t seed = 1;                                    ///< of the hand
};

/// Of the motors' watchdog 20 ms.
class WiredOnBench : public device::HapticDevice, public device::TrueStateSource {
 public:
  WiredOnBench(const Clock& clock, const WiredSpec& spec)
      : device_(open_wired(spec.driver, spec.side, clock, spec.seed, std::chrono::milliseconds(20),
                           spec.faults, spec.limit)) {}

  [[nodiscard]] const device::DeviceSpecification& specification() const noexcept override {
    return device_->specification();
  }
  [[nodiscard]] bool read(device::DeviceSample& sample) noexcept override {
    return device_->read(sample);
  }
  [[nodiscard]] bool apply(const Vector3& force_newton, Duration lease,
                           device::DeviceSample& at_switch) noexcept override {
    return device_->apply(force_newton, lease, at_switch);
  }
  [[nodiscard]] bool release() noexcept override { return device_->release(); }
  [[nodiscard]] DevicePhase phase() const noexcept override { return device_->phase(); }
  [[nodiscard]] bool calibrate() noexcept override { return device_->calibrate(); }
  [[nodiscard]] device::DeviceError last_error() const noexcept override {
    return device_->last_error();
  }
  void tap(device::WireTap* tap) noexcept override { device_->tap(tap); }
  [[nodiscard]] bool reopen(Duration within) noexcept override { return device_->reopen(within); }
  [[nodiscard]] device::TrueState true_state() const noexcept override {
    return dynamic_cast<device::TrueStateSource&>(*device_).true_state();
  }
  [[nodiscard]] std::vector<device::FaultOutcome> outcomes() {
    return dynamic_cast<WiredHardware&>(*device_).outcomes();
  }
  /// The machine sleeps, the hardware does not.
  void sleep(Duration duration) { dynamic_cast<WiredHardware&>(*device_).sleep(duration); }

 private:
  std::unique_ptr<device::HapticDevice> device_;
};

}  // namespace palpate::test
