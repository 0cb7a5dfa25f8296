#include "tests/support/wired/wired_device.h"

#include <chrono>
#include <numbers>
#include <thread>
#include <variant>

#include "device_node/drivers/hapi/hapi_driver.h"
#include "device_node/drivers/haply/haply_driver.h"
#include "device_node/emulators/hapi_emulator.h"
#include "device_node/emulators/haply_emulator.h"
#include "device_node/simulation/true_state.h"

namespace palpate::test {
namespace {

using device::DeviceSample;

constexpr Duration kTransferLimit = std::chrono::seconds(20);  // of real time: the machine is busy

MotorLimits limits_of(const Side& side) {
  const double peak = side.simulated.peak_force_newton;
  return {.peak_force_newton = peak, .continuous_force_newton = peak};
}

HaplyConfig haply_config(const Side& side) {
  HaplyConfig config;
  config.workspace_half_extent_m = Vector3(0.08, 0.06, 0.035);
  config.limits = limits_of(side);
  config.position_resolution_m = side.device.profile.position_resolution_m;
  config.transfer_limit = kTransferLimit;
  return config;
}

/// Upright: x to the right, z up.
HapiConfig hapi_config(const Side& side) {
  HapiConfig config;
  config.torque_gain = 0.1;
  config.origin_m = Vector3(0.01, 0.07, 0.0);
  config.rotation = Quaternion(Eigen::AngleAxisd(std::numbers::pi / 2, Vector3::UnitX()));
  config.workspace_half_extent_m = Vector3(0.03, 1e-3, 0.02);
  config.limits = limits_of(side);
  config.position_resolution_m = side.device.profile.position_resolution_m;
  config.transfer_limit = kTransferLimit;
  return config;
}

/// Emulator and thread outlive the driver.
template <class Emulator, class Config>
class WiredDevice final : public device::HapticDevice, public device::TrueStateSource {
 public:
  template <class Connect, class Open>
  WiredDevice(const Side& side, const Clock& clock, std::uint64_t seed, Duration watchdog,
              Config config, Connect connect, Open open)
      : emulated_(side.simulated, side.hand, clock, seed, watchdog, {}),
        emulator_(connect(emulated_, config)),
        server_([this](const std::stop_token& stop) { emulator_->run(stop); }),
        driver_(open(config, clock, device::StartUp{})) {}

  [[nodiscard]] const device::DeviceSpecification& specification() const noexcept override {
    return driver_->specification();
  }
  [[nodiscard]] bool read(DeviceSample& sample) noexcept override { return driver_->read(sample); }
  [[nodiscard]] bool apply(const Vector3& force_on_hand_newton, Duration lease,
                           DeviceSample& at_switch) noexcept override {
    return driver_->apply(force_on_hand_newton, lease, at_switch);
  }
  void release() noexcept override { driver_->release(); }
  [[nodiscard]] device::DeviceError last_error() const noexcept override {
    return driver_->last_error();
  }
  [[nodiscard]] bool reopen() noexcept override { return driver_->reopen(); }
  [[nodiscard]] device::TrueState true_state() const noexcept override {
    return emulated_.true_state();
  }

 private:
  device::EmulatedDevice emulated_;
  std::unique_ptr<Emulator> emulator_;
  std::jthread server_;
  std::unique_ptr<device::HapticDevice> driver_;
};

}  // namespace

std::unique_ptr<device::HapticDevice> open_wired(WiredDriver driver, const Side& side,
                                                 const Clock& clock, std::uint64_t seed,
                                                 Duration watchdog) {
  using device::EmulatedDevice;
  if (driver == WiredDriver::kHaply) {
    using Emulator = device::HaplyEmulator;
    return std::make_unique<WiredDevice<Emulator, HaplyConfig>>(
        side, clock, seed, watchdog, haply_config(side),
        [](EmulatedDevice& emulated, HaplyConfig& config) {
          auto emulator = std::make_unique<Emulator>(emulated, 0);
          config.port = emulator->port();
          return emulator;
        },
        device::open_haply);
  }
  using Emulator = device::HapiEmulator;
  return std::make_unique<WiredDevice<Emulator, HapiConfig>>(
      side, clock, seed, watchdog, hapi_config(side),
      [](EmulatedDevice& emulated, HapiConfig& config) {
        auto emulator = std::make_unique<Emulator>(emulated, config);
        config.port = emulator->port();
        return emulator;
      },
      device::open_hapi);
}

}  // namespace palpate::test
