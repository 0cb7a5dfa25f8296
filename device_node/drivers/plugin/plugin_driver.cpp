// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/plugin/plugin_driver.h"

#include <dlfcn.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <utility>

#include "common/core/check.h"
#include "device_node/drivers/plugin/palpate_device.h"

namespace palpate::device {
namespace {

struct CloseLibrary {
  void operator()(void* library) const noexcept { dlclose(library); }
};
using Library = std::unique_ptr<void, CloseLibrary>;

[[noreturn]] void refuse(const PluginConfig& config, const std::string& why) {
  throw SetupError("device.plugin.library: \"" + config.library + "\": " + why);
}

const palpate_device_driver& driver_in(const Library& library, const PluginConfig& config) {
  const auto entry = reinterpret_cast<palpate_device_driver_of_function>(
      dlsym(library.get(), PALPATE_DEVICE_ENTRY));
  if (entry == nullptr) {
    refuse(config, "no function " PALPATE_DEVICE_ENTRY "; is it a driver for Palpate?");
  }
  const palpate_device_driver* const driver = entry(PALPATE_DEVICE_ABI);
  if (driver == nullptr || driver->abi != PALPATE_DEVICE_ABI ||
      driver->size < offsetof(palpate_device_driver, set_wrist_torque)) {
    refuse(config, "made for another version of palpate_device.h; this program has version " +
                       std::to_string(PALPATE_DEVICE_ABI) + ": build it again");
  }
  if (driver->open == nullptr || driver->close == nullptr || driver->specification == nullptr ||
      driver->read == nullptr || driver->apply == nullptr || driver->release == nullptr) {
    refuse(config, "lacks open, close, specification, read, apply or release");
  }
  return *driver;
}

Matrix3 columns_of(const double (&vectors)[3][3]) {
  return Eigen::Map<const Matrix3>(&vectors[0][0]);
}
Vector3 vector_of(const double (&values)[3]) { return {values[0], values[1], values[2]}; }

/// What the library's functions see of this program.
class Host {
 public:
  Host(const Clock& clock, const StartUp& start_up) : clock_(clock), start_up_(start_up) {}
  Host(const Host&) = delete;
  Host& operator=(const Host&) = delete;

  [[nodiscard]] const palpate_device_host* interface() const { return &interface_; }

 private:
  static int64_t clock_ns(void* context) {
    return static_cast<Host*>(context)->clock_.now().time_since_epoch().count();
  }
  static void prompt(void* context, const char* text) {
    if (text != nullptr) static_cast<Host*>(context)->start_up_.prompt(text);
  }
  static int is_stopped(void* context) {
    return static_cast<Host*>(context)->start_up_.stop.stop_requested() ? 1 : 0;
  }

  const Clock& clock_;
  StartUp start_up_;
  palpate_device_host interface_{.size = sizeof(palpate_device_host),
                                 .reserved = 0,
                                 .context = this,
                                 .clock_ns = clock_ns,
                                 .prompt = prompt,
                                 .is_stopped = is_stopped,
                                 .start_limit_s = to_seconds(start_up_.limit)};
};

class PluginDevice final : public HapticDevice {
 public:
  PluginDevice(const PluginConfig& config, const Clock& clock, const StartUp& start_up)
      : host_(clock, start_up), clock_(clock) {
    library_.reset(dlopen(config.library.c_str(), RTLD_NOW | RTLD_LOCAL));
    if (!library_) refuse(config, dlerror());
    driver_ = &driver_in(library_, config);
    std::array<char, 512> error{};
    device_ = driver_->open(config.options.c_str(), host_.interface(), error.data(), error.size());
    error.back() = '\0';
    for (char& c : error) {  // it goes to a terminal
      if (c != '\0' && (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)) c = '?';
    }
    if (device_ == nullptr) {
      refuse(config, error[0] != '\0' ? error.data() : "the device could not be opened");
    }
    take_specification(config);
  }
  ~PluginDevice() override {
    if (device_ != nullptr) driver_->close(device_);
  }
  PluginDevice(const PluginDevice&) = delete;
  PluginDevice& operator=(const PluginDevice&) = delete;

  [[nodiscard]] const DeviceSpecification& specification() const noexcept override {
    return specification_;
  }
  [[nodiscard]] bool read(DeviceSample& sample) noexcept override {
    palpate_device_reading reading = blank();
    if (!is_ok(driver_->read(device_, &reading)) || !convert(reading, sample)) return false;
    // the library ends a force at the first call after its lease, at the latest
    if (sample.sampled_at >= lease_end_) {
      acting_newton_.setZero();
      acting_newton_m_.setZero();
    }
    sample.applied_force_newton = acting_newton_;
    if (sample.wrist) sample.wrist->acting_torque_newton_m = acting_newton_m_;
    return true;
  }
  [[nodiscard]] bool apply(const Vector3& force_on_hand_newton, Duration lease,
                           DeviceSample& at_switch) noexcept override {
    if (!force_on_hand_newton.allFinite()) {
      static_cast<void>(release());
      error_ = DeviceError::kFailed;
      return false;
    }
    const Vector3 limited = limited_to_norm(force_on_hand_newton, specification_.peak_force_newton);
    if (has_wrist_) driver_->set_wrist_torque(device_, next_newton_m_.data());
    next_newton_m_.setZero();
    palpate_device_reading reading = blank();
    if (!is_ok(driver_->apply(device_, limited.data(), lease.count(), &reading)) ||
        !convert(reading, at_switch)) {
      return false;
    }
    acting_newton_ = at_switch.applied_force_newton;
    if (at_switch.wrist) acting_newton_m_ = at_switch.wrist->acting_torque_newton_m;
    lease_end_ = at_switch.sampled_at + lease;
    return true;
  }
  void set_wrist_torque(const Vector3& torque_on_hand_newton_m) noexcept override {
    // of a number that is none nothing is known: no torque
    next_newton_m_ =
        torque_on_hand_newton_m.allFinite()
            ? limited_per_component(torque_on_hand_newton_m, specification_.peak_torque_newton_m)
            : Vector3(Vector3::Zero());
  }
  [[nodiscard]] bool take_latched(DeviceSample& at_end) noexcept override {
    palpate_device_reading reading = blank();
    return driver_->take_latched != nullptr && driver_->take_latched(device_, &reading) == 1 &&
           convert(reading, at_end);
  }
  /// Confirmed by a switch to no force, which the library answers with an error if it failed.
  [[nodiscard]] bool release() noexcept override {
    acting_newton_.setZero();
    acting_newton_m_.setZero();
    next_newton_m_.setZero();
    driver_->release(device_);
    if (has_wrist_) driver_->set_wrist_torque(device_, next_newton_m_.data());
    palpate_device_reading passed = blank();
    return is_ok(driver_->apply(device_, Vector3(Vector3::Zero()).data(), 0, &passed));
  }
  [[nodiscard]] DeviceError last_error() const noexcept override { return error_; }
  [[nodiscard]] bool reopen(Duration /*within*/) noexcept override {
    return driver_->reopen == nullptr || driver_->reopen(device_) == 1;
  }

 private:
  static palpate_device_reading blank() noexcept {
    palpate_device_reading reading{};
    reading.size = sizeof(reading);
    reading.orientation_wxyz[0] = 1.0;
    return reading;
  }

  void take_specification(const PluginConfig& config) {
    palpate_device_specification s{};
    s.size = sizeof(s);
    driver_->specification(device_, &s);
    s.model_name[sizeof(s.model_name) - 1] = '\0';
    const Vector3 workspace = vector_of(s.workspace_half_extent_m);
    // negated: a NaN is refused too
    if (!(workspace.minCoeff() > 0.0) || !workspace.allFinite() ||
        !(s.continuous_force_newton > 0.0) || !(s.peak_force_newton >= s.continuous_force_newton) ||
        !std::isfinite(s.peak_force_newton) || !(s.position_resolution_m >= 0.0) ||
        !(s.position_resolution_m < 0.01) || s.button_count > 32 ||
        !(s.held_force_ratio == 0.0 || s.held_force_ratio >= 1.0) ||
        !(s.turning_per_m >= 0.0 && std::isfinite(s.turning_per_m))) {
      driver_->close(std::exchange(device_, nullptr));
      refuse(config,
             "its specification needs a workspace > 0, 0 < continuous force ≤ peak force, a "
             "resolution of 0 … 0.01 m, at most 32 buttons, a held_force_ratio of 0 or ≥ 1 and a "
             "finite "
             "turning_per_m ≥ 0");
    }
    specification_ = {.model_name = s.model_name[0] != '\0' ? s.model_name : "plug-in",
                      .workspace_half_extent_m = workspace,
                      .peak_force_newton = s.peak_force_newton,
                      .continuous_force_newton = s.continuous_force_newton,
                      .position_resolution_m = s.position_resolution_m,
                      .button_count = s.button_count,
                      .has_motor_watchdog = (s.flags & PALPATE_DEVICE_HAS_WATCHDOG) != 0,
                      .has_position_latch = (s.flags & PALPATE_DEVICE_HAS_LATCH) != 0,
                      .held_force_ratio = std::max(1.0, s.held_force_ratio),
                      .turning_per_m = s.turning_per_m};
    measures_force_ = (s.flags & PALPATE_DEVICE_MEASURES_FORCE) != 0;
    if (config.uses_wrist) take_wrist(config, s);
  }

  void take_wrist(const PluginConfig& config, const palpate_device_specification& s) {
    const auto refuse_closed = [&](const char* why) {
      driver_->close(std::exchange(device_, nullptr));
      refuse(config, why);
    };
    if ((s.flags & PALPATE_DEVICE_HAS_WRIST) == 0) {
      refuse_closed("device.wrist: this device has no wrist with motors; leave it out");
    }
    if (!PALPATE_DEVICE_KNOWS(palpate_device_driver, driver_, set_wrist_torque) ||
        driver_->set_wrist_torque == nullptr) {
      refuse_closed("says that it has a wrist, but lacks set_wrist_torque");
    }
    const Vector3 peak_newton_m = vector_of(s.peak_torque_newton_m);
    if (!(peak_newton_m.minCoeff<Eigen::PropagateNaN>() > 0.0) || !peak_newton_m.allFinite()) {
      refuse_closed("its specification needs a peak_torque_newton_m > 0 for each joint");
    }
    specification_.peak_torque_newton_m = peak_newton_m;
    has_wrist_ = true;
  }

  bool is_ok(int error) noexcept {
    error_ = error >= 0 && error <= PALPATE_DEVICE_NOT_READY ? static_cast<DeviceError>(error)
                                                             : DeviceError::kFailed;
    return error_ == DeviceError::kNone;
  }

  /// False for a stamp in the future and a force that its motors do not have: device_node judges
  /// positions, but takes stamps and forces as they are.
  bool convert(const palpate_device_reading& reading, DeviceSample& sample) noexcept {
    const TimePoint stamp{Duration(reading.sampled_at_ns)};
    const Duration skew(reading.skew_ns);
    const double* const q = reading.orientation_wxyz;
    const Quaternion orientation(q[0], q[1], q[2], q[3]);
    const double norm = orientation.norm();
    const Vector3 applied = vector_of(reading.applied_force_newton);
    const Vector3 measured = vector_of(reading.measured_force_newton);
    const Vector3 turned = vector_of(reading.turned_newton);
    // a NaN is not ≤, so that it is refused too
    const double peak_newton = specification_.peak_force_newton;
    const bool is_real = applied.norm() <= kRounding * peak_newton &&
                         std::isfinite(reading.turning_joule) && turned.allFinite() &&
                         skew >= Duration::zero() && skew <= kMostSkew &&
                         (!measures_force_ || measured.norm() <= kMostMeasured * peak_newton);
    if (stamp > clock_.now() || !(norm > 0.5 && norm < 2.0) || !is_real ||
        (has_wrist_ && !is_possible_wrist(reading))) {
      driver_->release(device_);
      error_ = DeviceError::kCorrupt;
      return false;
    }
    sample = {.hand_position_m = vector_of(reading.position_m),
              .orientation = orientation.normalized(),
              .buttons = reading.buttons,
              .sampled_at = stamp,
              .applied_force_newton = applied,
              .skew = skew,
              .turning_joule = reading.turning_joule,
              .turned_newton = turned};
    if (measures_force_) sample.measured_newton = measured;
    if (has_wrist_) {
      sample.wrist = WristState{.pose = {.angle_rad = vector_of(reading.wrist_angle_rad),
                                         .axes = columns_of(reading.wrist_axes)},
                                .acting_torque_newton_m = vector_of(reading.wrist_torque_newton_m)};
    }
    return true;
  }
  [[nodiscard]] bool is_possible_wrist(const palpate_device_reading& reading) const noexcept {
    const Vector3 angle_rad = vector_of(reading.wrist_angle_rad);
    const Vector3 lengths = columns_of(reading.wrist_axes).colwise().norm();
    const Vector3 most_newton_m = kRounding * specification_.peak_torque_newton_m;
    const Vector3 torque_newton_m = vector_of(reading.wrist_torque_newton_m).cwiseAbs();
    // a NaN is not ≤
    return angle_rad.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() <= kMostAngle_rad &&
           (lengths - Vector3::Ones()).cwiseAbs().maxCoeff<Eigen::PropagateNaN>() <= kUnit &&
           (torque_newton_m - most_newton_m).maxCoeff<Eigen::PropagateNaN>() <= 0.0;
  }

  static constexpr double kRounding = 1.001;     // of motors that quantise
  static constexpr double kMostMeasured = 10.0;  // what is more is no measurement
  static constexpr Duration kMostSkew = std::chrono::seconds(1);
  static constexpr double kMostAngle_rad = 1000.0;  // that hop 1 carries
  static constexpr double kUnit = 1e-6;

  Host host_;
  const Clock& clock_;
  Library library_;  // outlives the device
  const palpate_device_driver* driver_ = nullptr;
  palpate_device* device_ = nullptr;
  DeviceSpecification specification_;
  bool measures_force_ = false;
  DeviceError error_ = DeviceError::kNone;
  Vector3 acting_newton_ = Vector3::Zero();    // until lease_end_
  bool has_wrist_ = false;                     // that the session uses; per joint:
  Vector3 next_newton_m_ = Vector3::Zero();    // of the next apply()
  Vector3 acting_newton_m_ = Vector3::Zero();  // until lease_end_
  TimePoint lease_end_{};
};

}  // namespace

std::unique_ptr<HapticDevice> open_plugin(const PluginConfig& config, const Clock& clock,
                                          const StartUp& start_up) {
  return std::make_unique<PluginDevice>(config, clock, start_up);
}

}  // namespace palpate::device
