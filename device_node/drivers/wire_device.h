// wire_device.h — what the drivers share whose device answers each message with one reading: the
// limits of the motors, the lease, release, reopening and the errors.
#pragma once

#include <algorithm>
#include <chrono>
#include <exception>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "device_node/device.h"
#include "device_node/drivers/device_error.h"
#include "device_node/drivers/motor_force.h"
#include "device_node/drivers/start_up.h"

namespace palpate::device {

/// Each reading and each switch is one message and its answer. The devices know no lease: every
/// message repeats the force until its lease ends.
class WireDevice : public HapticDevice {
 public:
  [[nodiscard]] const DeviceSpecification& specification() const noexcept final {
    return specification_;
  }

  [[nodiscard]] bool read(DeviceSample& sample) noexcept final {
    return transfer(motors_.at(clock_.now()), sample);
  }

  [[nodiscard]] bool apply(const Vector3& force_on_hand_newton, Duration lease,
                           DeviceSample& at_switch) noexcept final {
    if (!force_on_hand_newton.allFinite()) {
      release();
      error_ = DeviceError::kFailed;
      return false;
    }
    return transfer(motors_.set(force_on_hand_newton, lease, clock_.now()), at_switch);
  }

  void release() noexcept final {
    motors_.set(Vector3::Zero(), Duration::zero(), clock_.now());
    DeviceSample passed;
    if (is_connected()) static_cast<void>(transfer(Vector3::Zero(), passed));
  }

  [[nodiscard]] DeviceError last_error() const noexcept final { return error_; }

  [[nodiscard]] bool reopen() noexcept final {
    try {
      connect(std::chrono::milliseconds(500));
      DeviceSample passed;
      return transfer(Vector3::Zero(), passed);
    } catch (const std::exception&) {
      disconnect();
      return false;
    }
  }

 protected:
  WireDevice(const MotorLimits& limits, const Clock& clock) : clock_(clock), motors_(limits) {}

  /// Opens the connection if it has to be opened.
  /// @throws std::runtime_error  no device that answers; says why
  virtual void connect(Duration within) = 0;
  [[nodiscard]] virtual bool is_connected() const noexcept = 0;
  virtual void disconnect() noexcept = 0;
  /// One message with a force [N], D, and its answer: position, force applied, buttons. Called
  /// without a connection, too: kClosed.
  [[nodiscard]] virtual Transfer exchange(const Vector3& force_newton,
                                          DeviceSample& sample) noexcept = 0;

  /// Connects while the device or the program that owns it may still be starting.
  /// @param awaited  "the service"
  void connect_within(const StartUp& start_up, const std::string& awaited) {
    using namespace std::chrono_literals;
    const TimePoint until = clock_.now() + start_up.limit;
    for (bool was_prompted = false;; was_prompted = true) {
      try {
        return connect(std::max<Duration>(until - clock_.now(), 1ms));
      } catch (const std::exception& error) {
        disconnect();
        if (clock_.now() + 100ms >= until || start_up.stop.stop_requested()) throw;
        if (!was_prompted) start_up.prompt("waits for " + awaited + ": " + error.what());
        std::this_thread::sleep_for(100ms);
      }
    }
  }

  [[nodiscard]] const Clock& clock() const noexcept { return clock_; }
  /// What the force of the motors may be at most after rounding [N].
  [[nodiscard]] double allowed_newton() const noexcept { return motors_.allowed_newton(); }
  void set_specification(DeviceSpecification specification) {
    specification_ = std::move(specification);
  }
  /// The fields that every driver of a session has.
  template <class Config>
  [[nodiscard]] static DeviceSpecification specified(const std::string& model_name,
                                                     const Config& config) {
    return {.model_name = model_name,
            .workspace_half_extent_m = config.workspace_half_extent_m,
            .peak_force_newton = config.limits.peak_force_newton,
            .continuous_force_newton = config.limits.continuous_force_newton,
            .position_resolution_m = config.position_resolution_m};
  }

 private:
  bool transfer(const Vector3& force_newton, DeviceSample& sample) noexcept {
    sample = {};
    const Transfer outcome = exchange(force_newton, sample);
    sample.sampled_at = clock_.now();
    error_ = device_error(outcome);
    if (outcome == Transfer::kClosed) disconnect();
    return outcome == Transfer::kDone;
  }

  const Clock& clock_;
  MotorForce motors_;
  DeviceSpecification specification_;
  DeviceError error_ = DeviceError::kNone;
};

/// @param field   "device.hapi"
/// @param remedy  of whatever is in the way
/// @throws SetupError  no such device, or it does not become ready within `start_up.limit`
template <class Device, class Config>
std::unique_ptr<HapticDevice> open_wire_device(const char* field, const char* remedy,
                                               const Config& config, const Clock& clock,
                                               const StartUp& start_up) {
  try {
    return std::make_unique<Device>(config, clock, start_up);
  } catch (const SetupError&) {
    throw;
  } catch (const std::exception& error) {
    throw SetupError(std::string(field) + ": " + error.what() + "; " + remedy);
  }
}

}  // namespace palpate::device
