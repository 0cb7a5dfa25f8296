// SPDX-License-Identifier: Apache-2.0
// wire_device.h — what the drivers share whose device answers each message with one reading: the
// limits of the motors, the lease, release, reopening and the errors.
#pragma once

#include <algorithm>
#include <chrono>
#include <exception>
#include <memory>
#include <span>
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
    if (!may_be_relied_on()) return false;
    return transfer(motors_.at(clock_.now()), sample);
  }

  [[nodiscard]] bool apply(const Vector3& force_on_hand_newton, Duration lease,
                           DeviceSample& at_switch) noexcept final {
    if (!force_on_hand_newton.allFinite()) {
      static_cast<void>(release());
      error_ = DeviceError::kFailed;
      return false;
    }
    if (!may_be_relied_on()) return false;
    return transfer(motors_.set(force_on_hand_newton, lease, clock_.now()), at_switch);
  }

  [[nodiscard]] bool release() noexcept final {
    motors_.set(Vector3::Zero(), Duration::zero(), clock_.now());
    error_ = is_connected() ? DeviceError::kNone : DeviceError::kUnplugged;
    // after a failed transfer the first answer may be that of an earlier message
    for (int messages = is_in_step_ ? 1 : 2; error_ == DeviceError::kNone && messages > 0;
         --messages) {
      error_ = device_error(noted(release_once()));
    }
    if (error_ != DeviceError::kNone) return false;
    is_in_step_ = true;
    return true;
  }

  [[nodiscard]] DevicePhase phase() const noexcept final {
    if (!is_connected()) return DevicePhase::kClosed;
    return is_calibrated_ ? DevicePhase::kCalibrated : DevicePhase::kConnected;
  }

  [[nodiscard]] bool calibrate() noexcept final {
    try {
      if (is_connected() && !is_calibrated_) is_calibrated_ = take_calibration();
    } catch (const std::exception&) {
      is_calibrated_ = false;
    }
    return phase() == DevicePhase::kCalibrated;
  }

  [[nodiscard]] DeviceError last_error() const noexcept final { return error_; }

  void tap(WireTap* tap) noexcept final { tap_ = tap; }

  [[nodiscard]] bool reopen(Duration within) noexcept final {
    is_calibrated_ = false;
    try {
      if (!release()) {
        disconnect();
        connect(within);
        if (!release()) return false;
      }
      is_calibrated_ = knows_its_calibration();
      return is_connected();
    } catch (const std::exception&) {
      disconnect();
      return false;
    }
  }

 protected:
  WireDevice(const MotorLimits& limits, const Clock& clock) : clock_(clock), motors_(limits) {}

  /// Opens the connection; there is none.
  /// @throws std::runtime_error  no device that answers; says why
  virtual void connect(Duration within) = 0;
  [[nodiscard]] virtual bool is_connected() const noexcept = 0;
  virtual void disconnect() noexcept = 0;
  /// One message with a force [N], D, and its answer: position, force applied, buttons, and what
  /// the motors did meanwhile by turning. Called without a connection, too: kClosed.
  [[nodiscard]] virtual Transfer exchange(const Vector3& force_newton,
                                          DeviceSample& sample) noexcept = 0;

  /// Whether the device itself says that it is calibrated, and answers with a position.
  /// @throws std::runtime_error  the connection failed
  [[nodiscard]] virtual bool knows_its_calibration() { return false; }
  /// A person did what specification().calibration asks for.
  /// @return  whether the device is calibrated now, and answers with a position
  /// @throws std::runtime_error  the connection failed
  [[nodiscard]] virtual bool take_calibration() { return knows_its_calibration(); }
  /// Of constructors: the device was calibrated as it was opened.
  void set_calibrated() noexcept { is_calibrated_ = true; }

  /// One message without force and its answer, whatever that says of the position.
  [[nodiscard]] virtual Transfer release_once() noexcept = 0;
  /// For destructors: nobody calls release() again.
  void release_finally() noexcept {
    for (int attempts = 0; attempts < kLastAttempts && is_connected(); ++attempts) {
      if (release()) return;
    }
  }

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

  /// Every message of exchange() and release_once() passes here, and every answer or its absence.
  void sent(std::span<const std::byte> message) noexcept {
    if (tap_ != nullptr) tap_->transferred(clock_.now(), true, message);
  }
  void received(Transfer outcome, std::span<const std::byte> message) noexcept {
    if (tap_ == nullptr) return;
    tap_->transferred(clock_.now(), false,
                      outcome == Transfer::kDone ? message : std::span<const std::byte>());
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
  /// Without a calibration there are neither positions nor forces.
  bool may_be_relied_on() noexcept {
    if (!is_connected() || is_calibrated_) return true;
    error_ = DeviceError::kNotReady;
    return false;
  }

  bool transfer(const Vector3& force_newton, DeviceSample& sample) noexcept {
    sample = {};
    const TimePoint began_at = clock_.now();
    const Transfer outcome = noted(exchange(force_newton, sample));
    sample.sampled_at = clock_.now();
    // the device read and switched at some time in between
    sample.skew = sample.sampled_at - began_at;
    error_ = device_error(outcome);
    return outcome == Transfer::kDone;
  }
  Transfer noted(Transfer outcome) noexcept {
    if (outcome != Transfer::kDone) is_in_step_ = false;
    if (outcome == Transfer::kNotReady || outcome == Transfer::kClosed) is_calibrated_ = false;
    if (outcome == Transfer::kClosed) disconnect();
    return outcome;
  }

  static constexpr int kLastAttempts = 5;

  const Clock& clock_;
  WireTap* tap_ = nullptr;
  MotorForce motors_;
  DeviceSpecification specification_;
  DeviceError error_ = DeviceError::kNone;
  bool is_calibrated_ = false;
  bool is_in_step_ = true;  // the next answer is that of the next message
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
