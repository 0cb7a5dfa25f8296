// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/falcon/falcon_driver.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>

#include "device_node/drivers/falcon/falcon_delta.h"
#include "device_node/drivers/falcon/falcon_firmware.h"
#include "device_node/drivers/held_torque.h"
#include "device_node/drivers/wire_device.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr int kLoadAttempts = 3;  // loading is known to fail now and then
constexpr int kQuestionsAfterLoading = 100;
constexpr const char* kHoming = "pull the Falcon's grip out and push it in again to home it";

std::optional<Matrix3> falcon_jacobian(const Vector3& grip_m) {
  const std::optional<Vector3> angles_rad = FalconDelta::angles_rad(grip_m);
  return angles_rad ? FalconDelta::jacobian(grip_m, *angles_rad) : std::nullopt;
}

class FalconDevice final : public WireDevice {
 public:
  FalconDevice(const FalconConfig& config, const Clock& clock, const StartUp& start_up)
      : WireDevice(config.limits, clock), config_(config) {
    const TimePoint until = clock.now() + start_up.limit;
    DeviceSpecification specification = specified("Novint Falcon", config);
    specification.button_count = 4;
    specification.calibration = kHoming;
    bound_held_force(specification, config, Vector3::Constant(FalconDelta::kCount_rad),
                     falcon_jacobian);
    set_specification(std::move(specification));
    if (!config.firmware_file.empty()) image_ = read_falcon_image(config.firmware_file);
    connect_within(start_up, "the Falcon");
    if (!answers(2)) load_firmware(start_up);
    await_homing(until, start_up);
    // the angles, for the first force
    DeviceSample passed;
    if (exchange(Vector3::Zero(), passed) != Transfer::kDone) {
      throw std::runtime_error("the Falcon's encoders are at no position of its legs");
    }
    set_calibrated();
  }
  ~FalconDevice() override { release_finally(); }
  FalconDevice(const FalconDevice&) = delete;
  FalconDevice& operator=(const FalconDevice&) = delete;

 private:
  void connect(Duration /*within*/) override {
    line_.emplace(
        open_usb(config_.port.empty() ? find_usb_device(kFalconIds) : config_.port, kFalconIds));
    set_falcon_running(*line_);
  }
  [[nodiscard]] bool is_connected() const noexcept override { return line_.has_value(); }
  void disconnect() noexcept override { line_.reset(); }
  [[nodiscard]] bool knows_its_calibration() override {
    grip_m_.reset();
    DeviceSample passed;
    return exchange(Vector3::Zero(), passed) == Transfer::kDone;
  }

  void load_firmware(const StartUp& start_up) {
    if (image_.empty()) {
      throw std::runtime_error("no firmware answers; give firmware_file, the vendor's image");
    }
    for (int attempt = 1;; ++attempt) {
      std::string why = "the firmware does not answer after loading";
      try {
        load_falcon_firmware(*line_, image_);
        set_falcon_running(*line_);
        if (answers(kQuestionsAfterLoading)) return;
      } catch (const std::runtime_error& error) {
        why = error.what();
      }
      const std::string nth = "loading the firmware, attempt " + std::to_string(attempt) + " of " +
                              std::to_string(kLoadAttempts) + ": " + why;
      if (attempt == kLoadAttempts || start_up.stop.stop_requested()) {
        throw std::runtime_error(nth);
      }
      start_up.prompt(nth);
    }
  }

  /// Whether firmware runs. The first messages to it may be lost.
  bool answers(int attempts) noexcept {
    FalconReading reading;
    while (attempts-- > 0) {
      if (ask({}, reading) == Transfer::kDone) return true;
      if (line_->purge() != Transfer::kDone) return false;
    }
    return false;
  }

  /// The position is known once each leg has passed the index of its encoder.
  void await_homing(TimePoint until, const StartUp& start_up) {
    FalconReading reading;
    for (bool was_prompted = false;; was_prompted = true) {
      if (ask({}, reading) != Transfer::kDone) {
        throw std::runtime_error("the Falcon stopped answering while it was homed");
      }
      if (reading.homed == kFalconAllHomed) return;
      if (!was_prompted) start_up.prompt(kHoming);
      if (clock().now() >= until || start_up.stop.stop_requested()) {
        throw std::runtime_error(std::string("not homed in time: ") + kHoming);
      }
      std::this_thread::sleep_for(10ms);
    }
  }

  Transfer ask(const FalconCounts& motors, FalconReading& reading) noexcept {
    if (!line_) return Transfer::kClosed;
    const auto flags =
        static_cast<std::uint8_t>(kFalconHoming | (is_homed_ ? kFalconGreen : kFalconRed));
    const auto command = falcon_command(motors, flags);
    sent(std::as_bytes(std::span(command)));
    Transfer transfer = line_->write(command, config_.transfer_limit);
    if (transfer != Transfer::kDone) return transfer;
    FalconMessage answer{};
    transfer = line_->read(answer, config_.transfer_limit);
    received(transfer, std::as_bytes(std::span(answer)));
    if (transfer != Transfer::kDone) return transfer;
    // more than one answer: this is that of an earlier message
    if (line_->has_more() || !read_falcon_answer(answer, reading)) return Transfer::kCorrupt;
    is_homed_ = reading.homed == kFalconAllHomed;
    return Transfer::kDone;
  }

  /// What an earlier transfer left on the line is forgotten, then the motors are sent 0.
  Transfer release_once() noexcept override {
    if (!line_) return Transfer::kClosed;
    const Transfer purged = line_->purge();
    held_.forget();
    FalconReading passed;
    return purged == Transfer::kDone ? ask({}, passed) : purged;
  }

  Transfer exchange(const Vector3& force_newton, DeviceSample& sample) noexcept {
    FalconCounts motors{};
    sample.applied_force_newton = motor_counts(force_newton, motors);
    FalconReading reading;
    const Transfer transfer = ask(motors, reading);
    if (transfer != Transfer::kDone) return transfer;
    if (!is_homed_) return Transfer::kNotReady;  // it lost its power in between
    angles_rad_ = falcon_angles_rad(config_, reading.encoders);
    const std::optional<Vector3> grip_m =
        FalconDelta::grip_m(angles_rad_, grip_m_.value_or(FalconDelta::middle_m()));
    if (!grip_m) return Transfer::kCorrupt;  // legs that cannot meet
    grip_m_ = grip_m;
    sample.hand_position_m = config_.rotation * (*grip_m - config_.origin_m);
    sample.buttons = reading.buttons;
    held_.answered(Vector3(motors[0], motors[1], motors[2]) / config_.torque_gain, angles_rad_,
                   mounted(config_, FalconDelta::jacobian(*grip_m_, angles_rad_)), sample);
    return Transfer::kDone;
  }

  /// @return  the force that these counts make, D [N]: whole numbers, scaled to the largest
  Vector3 motor_counts(const Vector3& force_newton, FalconCounts& motors) const noexcept {
    if (!grip_m_ || force_newton.isZero(0.0)) return Vector3::Zero();
    // torques by the angles of the last answer: a period old
    const std::optional<Matrix3> jacobian = FalconDelta::jacobian(*grip_m_, angles_rad_);
    if (!jacobian) return Vector3::Zero();
    Vector3 counts =
        config_.torque_gain * jacobian->transpose() * (config_.rotation.conjugate() * force_newton);
    scale_counts(counts, config_.largest_torque);
    const Matrix3 newton_per_count = jacobian->transpose().inverse() / config_.torque_gain;
    const Vector3 made_newton = round_counts(counts, newton_per_count, allowed_newton());
    for (std::size_t leg = 0; leg < kFalconLegs; ++leg) {
      motors[leg] = static_cast<std::int16_t>(counts[static_cast<Eigen::Index>(leg)]);
    }
    return config_.rotation * made_newton;
  }

  FalconConfig config_;
  std::vector<std::byte> image_;
  std::optional<FtdiLine> line_;
  std::optional<Vector3> grip_m_;  // of the last answer, frame of the device
  Vector3 angles_rad_ = Vector3::Zero();
  bool is_homed_ = false;
  HeldTorque held_;
};

}  // namespace

Vector3 falcon_angles_rad(const FalconConfig& config, const FalconCounts& encoders) noexcept {
  const double offset_rad = config.encoder_offset_deg * std::numbers::pi / 180.0;
  return Vector3(encoders[0], encoders[1], encoders[2]) * FalconDelta::kCount_rad +
         Vector3::Constant(offset_rad);
}

std::unique_ptr<HapticDevice> open_falcon(const FalconConfig& config, const Clock& clock,
                                          const StartUp& start_up) {
  return open_wire_device<FalconDevice>(
      "device.falcon", "is it powered, and may you use it? `palpate devices` lists it", config,
      clock, start_up);
}

}  // namespace palpate::device
