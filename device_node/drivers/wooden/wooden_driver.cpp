// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/wooden/wooden_driver.h"

#include <linux/hidraw.h>
#include <sys/ioctl.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>

#include "device_node/drivers/held_torque.h"
#include "device_node/drivers/transport/packet_port.h"
#include "device_node/drivers/wire_device.h"
#include "device_node/drivers/wooden/wooden_wire.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

constexpr const char* kCalibration =
    "hold the handle at the calibration position and press the button of the board";
/// So near the calibration position the counters are taken to be those of the arm.
constexpr double kHeldAt_m = 5e-3;
constexpr int kFirstQuestions = 5;  // the first report may have been on its way for long

/// The only hidraw file of such a board.
std::string find_wooden() {
  std::vector<std::string> found;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator("/sys/class/hidraw", error)) {
    std::ifstream stream(entry.path() / "device" / "uevent");
    for (std::string line; std::getline(stream, line);) {
      // bus 3 is USB
      if (line == "HID_ID=0003:000016C0:00000486") {
        found.push_back("/dev/" + entry.path().filename().string());
      }
    }
  }
  if (found.size() == 1) return found.front();
  if (found.empty()) throw std::runtime_error("no HID " + to_text(kWoodenIds) + " on USB");
  std::string all;
  for (const std::string& path : found) all += " " + path;
  throw std::runtime_error("several boards, give one as port:" + all);
}

UsbIds hid_ids(const PacketPort& port, const std::string& path) {
  hidraw_devinfo info{};
  if (::ioctl(port.file(), HIDIOCGRAWINFO, &info) < 0)
    throw std::runtime_error(path + " is no hidraw file");
  return {.vendor = static_cast<std::uint16_t>(info.vendor),
          .product = static_cast<std::uint16_t>(info.product)};
}

class WoodenDevice final : public WireDevice {
 public:
  WoodenDevice(const WoodenConfig& config, const Clock& clock, const StartUp& start_up)
      : WireDevice(config.limits, clock), config_(config), drive_(config) {
    const TimePoint until = clock.now() + start_up.limit;
    DeviceSpecification specification = specified("WoodenHaptics", config);
    specification.button_count = 1;
    specification.calibration = kCalibration;
    bound_held_force(specification, config, drive_.rad_per_count.cwiseAbs(),
                     [this](const Vector3& handle_m) {
                       const std::optional<Vector3> angles_rad = drive_.arm.angles_rad(handle_m);
                       return angles_rad ? drive_.arm.jacobian(*angles_rad) : std::nullopt;
                     });
    set_specification(std::move(specification));
    connect_within(start_up, "the board");
    if (config.is_calibrated) return;  // calibrate() looks whether it is
    await_button(until, start_up);
    if (!set_counters()) {
      throw std::runtime_error("the board's counters are those of no position of the arm");
    }
    set_calibrated();
  }
  ~WoodenDevice() override { release_finally(); }
  WoodenDevice(const WoodenDevice&) = delete;
  WoodenDevice& operator=(const WoodenDevice&) = delete;

 private:
  void connect(Duration /*within*/) override {
    const std::string path = config_.port.empty() ? find_wooden() : config_.port;
    port_.emplace(path);
    const UsbIds ids = is_emulated(path) ? port_->emulated_ids(1s) : hid_ids(*port_, path);
    if (ids != kWoodenIds) {
      throw std::runtime_error(path + " is " + to_text(ids) + ", not " + to_text(kWoodenIds));
    }
    WoodenReading reading;
    for (int attempt = 0; attempt < kFirstQuestions; ++attempt) {
      if (ask({}, reading) == Transfer::kDone) return;
    }
    throw std::runtime_error(path + ": the board does not answer");
  }
  [[nodiscard]] bool is_connected() const noexcept override { return port_.has_value(); }
  void disconnect() noexcept override {
    port_.reset();
    angles_rad_.reset();
  }

  /// A person holds the handle at the calibration position and presses the button of the board.
  void await_button(TimePoint until, const StartUp& start_up) {
    WoodenReading reading;
    for (bool was_prompted = false;; was_prompted = true) {
      if (ask({}, reading) != Transfer::kDone) {
        throw std::runtime_error("the board stopped answering while it was calibrated");
      }
      if (reading.info == 1) return;
      if (!was_prompted) start_up.prompt(kCalibration);
      if (clock().now() >= until || start_up.stop.stop_requested()) {
        throw std::runtime_error(std::string("not calibrated in time: ") + kCalibration);
      }
      std::this_thread::sleep_for(10ms);
    }
  }

  /// @return  whether the board took them, and they are those of a position of the arm
  bool set_counters() noexcept {
    WoodenReading reading;
    DeviceSample passed;
    return ask({.command = kWoodenSetCounters, .attributes = config_.calibration_counts},
               reading) == Transfer::kDone &&
           exchange(Vector3::Zero(), passed) == Transfer::kDone;
  }

  /// The handle is held at the calibration position: by the board's button, or because the counters
  /// say so. After a power cycle they do not.
  [[nodiscard]] bool take_calibration() override {
    WoodenReading reading;
    if (ask({}, reading) != Transfer::kDone) return false;
    if (reading.info == 1) return set_counters();
    DeviceSample passed;
    return (handle_m(reading) -
            handle_m({.encoders = {config_.calibration_counts[0], config_.calibration_counts[1],
                                   config_.calibration_counts[2]}}))
                   .norm() <= kHeldAt_m &&
           exchange(Vector3::Zero(), passed) == Transfer::kDone;
  }

  [[nodiscard]] Vector3 angles_rad(const WoodenReading& reading) const noexcept {
    return drive_.rad_per_count.cwiseProduct(
        Vector3(reading.encoders[0], reading.encoders[1], reading.encoders[2]));
  }
  [[nodiscard]] Vector3 handle_m(const WoodenReading& reading) const noexcept {
    return drive_.arm.handle_m(angles_rad(reading));
  }

  /// The board sends one report after each command that it takes.
  Transfer ask(const WoodenCommand& command, WoodenReading& reading) noexcept {
    if (!port_) return Transfer::kClosed;
    port_->discard_input();
    const auto packet = wooden_command(command);
    sent(std::as_bytes(std::span(packet)));
    Transfer transfer = port_->write(packet, config_.transfer_limit);
    if (transfer != Transfer::kDone) return transfer;
    // one more than a report has: a longer one is seen
    std::array<std::byte, kWoodenReportBytes + 1> report{};
    std::size_t size = 0;
    transfer = port_->read(report, size, config_.transfer_limit);
    received(transfer, std::span(report).first(size));
    if (transfer != Transfer::kDone) return transfer;
    return read_wooden_report(std::span(report).first(size), reading) ? Transfer::kDone
                                                                      : Transfer::kCorrupt;
  }

  Transfer release_once() noexcept override {
    held_.forget();
    WoodenReading passed;
    return ask({}, passed);
  }

  Transfer exchange(const Vector3& force_newton, DeviceSample& sample) noexcept override {
    // an answer too many: each would be that of an earlier message
    if (port_ && angles_rad_ && port_->has_input()) return Transfer::kCorrupt;
    WoodenCommand command;
    sample.applied_force_newton = currents(force_newton, command.currents_ma);
    WoodenReading reading;
    const Transfer transfer = ask(command, reading);
    if (transfer != Transfer::kDone) return transfer;
    const Vector3 angles = angles_rad(reading);
    const std::optional<Matrix3> jacobian = drive_.arm.jacobian(angles);
    if (!jacobian) return Transfer::kCorrupt;  // no place of the workspace
    angles_rad_ = angles;
    sample.hand_position_m = config_.rotation * (drive_.arm.handle_m(angles) - config_.origin_m);
    sample.buttons = is_wooden_button_held(reading) ? 1 : 0;
    held_.answered(Vector3(command.currents_ma[0], command.currents_ma[1], command.currents_ma[2])
                       .cwiseQuotient(drive_.ma_per_newton_m),
                   angles, mounted(config_, jacobian), sample);
    return Transfer::kDone;
  }

  /// @return  the force that these currents make, D [N]: whole milliamperes, scaled to the largest
  Vector3 currents(const Vector3& force_newton, WoodenCounts& currents_ma) const noexcept {
    // torques by the angles of the last answer: a period old
    const std::optional<Matrix3> jacobian =
        angles_rad_ ? drive_.arm.jacobian(*angles_rad_) : std::optional<Matrix3>();
    if (!jacobian || force_newton.isZero(0.0)) return Vector3::Zero();
    Vector3 ma = drive_.ma_per_newton_m.cwiseProduct(
        Vector3(jacobian->transpose() * (config_.rotation.conjugate() * force_newton)));
    scale_counts(ma, drive_.largest_ma);
    const Matrix3 newton_per_ma =
        jacobian->transpose().inverse() * drive_.ma_per_newton_m.cwiseInverse().asDiagonal();
    const Vector3 made_newton = round_counts(ma, newton_per_ma, allowed_newton());
    for (std::size_t axis = 0; axis < kWoodenAxes; ++axis) {
      currents_ma[axis] = static_cast<std::int16_t>(ma[static_cast<Eigen::Index>(axis)]);
    }
    return config_.rotation * made_newton;
  }

  WoodenConfig config_;
  WoodenDrive drive_;
  std::optional<PacketPort> port_;
  std::optional<Vector3> angles_rad_;  // of the last answer
  HeldTorque held_;
};

}  // namespace

WoodenDrive::WoodenDrive(const WoodenConfig& config)
    : arm({.base_m = config.base_m, .arm_m = config.arm_m, .rod_m = config.rod_m}),
      largest_ma(std::min(std::floor(1e3 * config.largest_current_a), 32767.0)) {
  for (std::size_t axis = 0; axis < kWoodenAxes; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    const double turns =
        (config.are_reversed[axis] ? -1.0 : 1.0) * config.capstans_m[axis] / config.drums_m[axis];
    rad_per_count[i] = turns * 2.0 * std::numbers::pi / config.encoder_resolutions[axis];
    ma_per_newton_m[i] = 1e3 * turns / config.torque_constants_newton_m_per_a[axis];
  }
}

std::unique_ptr<HapticDevice> open_wooden(const WoodenConfig& config, const Clock& clock,
                                          const StartUp& start_up) {
  return open_wire_device<WoodenDevice>(
      "device.wooden", "is it powered, and may you use it? `palpate devices` lists it", config,
      clock, start_up);
}

}  // namespace palpate::device
