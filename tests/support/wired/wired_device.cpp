// SPDX-License-Identifier: Apache-2.0
#include "tests/support/wired/wired_device.h"

#include <chrono>
#include <numbers>
#include <thread>
#include <utility>

#include "common/core/check.h"
#include "common/core/user/temp_folder.h"
#include "device_node/drivers/falcon/falcon_driver.h"
#include "device_node/drivers/hapi/hapi_driver.h"
#include "device_node/drivers/haply/haply_driver.h"
#include "device_node/drivers/wooden/wooden_driver.h"
#include "device_node/emulators/falcon_emulator.h"
#include "device_node/emulators/hapi_emulator.h"
#include "device_node/emulators/haply_emulator.h"
#include "device_node/emulators/wooden_emulator.h"
#include "device_node/simulation/true_state.h"
#include "tests/support/wired/shared_clock.h"

namespace palpate::test {
namespace {

using device::DeviceSample;

/// What does not depend on the driver.
template <class Config>
Config of_side(Config config, const Side& side) {
  const double peak = side.simulated.peak_force_newton;
  config.limits = {.peak_force_newton = peak, .continuous_force_newton = peak};
  config.position_resolution_m = side.device.profile.position_resolution_m;
  return config;
}

HaplyConfig haply_config(const Side& side) {
  HaplyConfig config;
  config.workspace_half_extent_m = Vector3(0.08, 0.06, 0.035);
  return of_side(config, side);
}

/// Upright: x to the right, z up.
HapiConfig hapi_config(const Side& side) {
  HapiConfig config;
  config.torque_gain = 0.5;
  config.origin_m = Vector3(0.01, 0.07, 0.0);
  config.rotation = Quaternion(Eigen::AngleAxisd(std::numbers::pi / 2, Vector3::UnitX()));
  config.workspace_half_extent_m = Vector3(0.03, 1e-3, 0.02);
  return of_side(config, side);
}

/// Its x is to the right, y up and z towards the person.
FalconConfig falcon_config(const Side& side) {
  FalconConfig config;
  config.torque_gain = -10000.0;
  config.origin_m = Vector3(0.0, 0.0, 0.12);
  config.rotation = Quaternion(Eigen::AngleAxisd(std::numbers::pi / 2, Vector3::UnitX()));
  config.workspace_half_extent_m = Vector3(0.03, 0.03, 0.03);
  return of_side(config, side);
}

/// The published design. Its x is towards the person, z up.
WoodenConfig wooden_config(const Side& side) {
  WoodenConfig config;
  config.torque_constants_newton_m_per_a = {0.321, 0.0603, 0.0603};
  config.calibration_counts = {0, 0, 6000};
  config.largest_current_a = 3.0;
  config.origin_m = Vector3(0.22, 0.0, 0.08);
  config.rotation = Quaternion(Eigen::AngleAxisd(-std::numbers::pi / 2, Vector3::UnitZ()));
  config.workspace_half_extent_m = Vector3(0.06, 0.05, 0.05);
  return of_side(config, side);
}

std::unique_ptr<device::HaplyEmulator> connect(device::EmulatedDevice& device, HaplyConfig& config,
                                               const TempFolder& /*folder*/) {
  auto emulator = std::make_unique<device::HaplyEmulator>(device, 0);
  config.port = emulator->port();
  return emulator;
}

std::unique_ptr<device::HapiEmulator> connect(device::EmulatedDevice& device, HapiConfig& config,
                                              const TempFolder& /*folder*/) {
  auto emulator = std::make_unique<device::HapiEmulator>(device, config);
  config.port = emulator->port();
  return emulator;
}

std::unique_ptr<device::FalconEmulator> connect(device::EmulatedDevice& device,
                                                FalconConfig& config, const TempFolder& folder) {
  config.port = (folder.path() / "falcon").string();
  return std::make_unique<device::FalconEmulator>(device, config, device::FalconEmulatorState{});
}

std::unique_ptr<device::WoodenEmulator> connect(device::EmulatedDevice& device,
                                                WoodenConfig& config, const TempFolder& folder) {
  config.port = (folder.path() / "wooden").string();
  return std::make_unique<device::WoodenEmulator>(device, config);
}

/// Emulator and thread outlive the driver.
template <class Config>
class WiredDevice final : public device::HapticDevice,
                          public device::TrueStateSource,
                          public WiredHardware {
 public:
  using Open = std::unique_ptr<device::HapticDevice>(const Config&, const Clock&,
                                                     const device::StartUp&);
  WiredDevice(const Side& side, const Clock& clock, std::uint64_t seed, Duration watchdog,
              const std::vector<device::PlannedFault>& faults, Config config, Open& open)
      : wakeful_(clock),
        emulated_(side.simulated, side.hand, wakeful_, seed, watchdog, faults),
        emulator_(connect(emulated_, config, folder_)),
        server_([this](const std::stop_token& stop) { emulator_->run(stop); }),
        driver_(open(config, clock, device::StartUp{})) {
    PALPATE_REQUIRE(driver_->calibrate());  // the emulated hand is where the device asks for
  }

  [[nodiscard]] const device::DeviceSpecification& specification() const noexcept override {
    return driver_->specification();
  }
  [[nodiscard]] bool read(DeviceSample& sample) noexcept override { return driver_->read(sample); }
  [[nodiscard]] bool apply(const Vector3& force_on_hand_newton, Duration lease,
                           DeviceSample& at_switch) noexcept override {
    return driver_->apply(force_on_hand_newton, lease, at_switch);
  }
  [[nodiscard]] bool release() noexcept override { return driver_->release(); }
  [[nodiscard]] DevicePhase phase() const noexcept override { return driver_->phase(); }
  [[nodiscard]] bool calibrate() noexcept override { return driver_->calibrate(); }
  [[nodiscard]] device::DeviceError last_error() const noexcept override {
    return driver_->last_error();
  }
  void tap(device::WireTap* tap) noexcept override { driver_->tap(tap); }
  [[nodiscard]] bool reopen(Duration within) noexcept override { return driver_->reopen(within); }
  [[nodiscard]] device::TrueState true_state() const noexcept override {
    return emulated_.true_state();
  }
  [[nodiscard]] std::vector<device::FaultOutcome> outcomes() override {
    return emulated_.outcomes();
  }
  void sleep(Duration duration) override { wakeful_.slept(duration); }

 private:
  TempFolder folder_;
  WakefulClock wakeful_;
  device::EmulatedDevice emulated_;
  decltype(connect(std::declval<device::EmulatedDevice&>(), std::declval<Config&>(),
                   std::declval<const TempFolder&>())) emulator_;
  std::jthread server_;
  std::unique_ptr<device::HapticDevice> driver_;
};

}  // namespace

std::unique_ptr<device::HapticDevice> open_wired(WiredDriver driver, const Side& side,
                                                 const Clock& clock, std::uint64_t seed,
                                                 Duration watchdog,
                                                 const std::vector<device::PlannedFault>& faults,
                                                 Duration limit) {
  const auto wire = [&]<class Config>(Config config, typename WiredDevice<Config>::Open& open) {
    config.transfer_limit = limit;
    return std::make_unique<WiredDevice<Config>>(side, clock, seed, watchdog, faults, config, open);
  };
  switch (driver) {
    case WiredDriver::kHaply:
      return wire(haply_config(side), device::open_haply);
    case WiredDriver::kHapi:
      return wire(hapi_config(side), device::open_hapi);
    case WiredDriver::kFalcon:
      return wire(falcon_config(side), device::open_falcon);
    case WiredDriver::kWooden:
      return wire(wooden_config(side), device::open_wooden);
  }
  return nullptr;
}

}  // namespace palpate::test
