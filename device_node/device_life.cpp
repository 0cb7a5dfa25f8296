// SPDX-License-Identifier: Apache-2.0
// A device's way to a force and back: acknowledgement, check of the motors, faults, release.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>

#include "common/core/check.h"
#include "device_node/device_node.h"

namespace palpate::device {
namespace {

/// A lost connection, while the motors may still push: an attempt may take so long, each so often.
constexpr Duration kReopenWithin = std::chrono::milliseconds(100);
constexpr Duration kReopenEvery = std::chrono::milliseconds(500);
/// After a person asked for it.
constexpr Duration kResetWithin = std::chrono::milliseconds(500);

std::string newton_text(double newton) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.3g N", newton);
  return text.data();
}

std::string micrometre_text(double metre) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.4g µm", 1e6 * metre);
  return text.data();
}

/// The motors end a force by themselves, or the session accepts that they do not, and it can.
bool may_exceed_friction(const DeviceConfig& config, const DeviceSpecification& specification) {
  return specification.has_motor_watchdog ||
         (config.accepts_no_motor_watchdog && std::isfinite(specification.turning_per_m));
}

}  // namespace

/// Lemma: held_torque.
double largest_force_newton(const DeviceConfig& config,
                            const DeviceSpecification& specification) noexcept {
  return may_exceed_friction(config, specification)
             ? specification.peak_force_newton
             : std::min(specification.peak_force_newton,
                        config.profile.coulomb_newton / specification.held_force_ratio);
}

DeviceConfig with_torque_limit(DeviceConfig config, const DeviceSpecification& specification) {
  if (config.wrist && !specification.has_motor_watchdog) {
    config.wrist->peak_torque_newton_m =
        std::min(config.wrist->peak_torque_newton_m, config.wrist->coulomb_newton_m);
  }
  return config;
}

std::optional<FrictionLimit> friction_limit(const DeviceConfig& config,
                                            const DeviceSpecification& specification,
                                            const std::string& driver) {
  if (may_exceed_friction(config, specification)) return std::nullopt;
  const double newton = largest_force_newton(config, specification);
  if (config.peak_force_newton < newton) {
    return FrictionLimit{config.peak_force_newton, false, "device.peak_force_newton", ""};
  }
  FrictionLimit limit{newton, specification.held_force_ratio > 1.0,
                      "f_co, device.profile.coulomb_newton", ""};
  if (std::isinf(specification.held_force_ratio)) {
    limit.why = "nothing bounds what the currents that the motors hold are elsewhere: ";
    if (driver == "plugin") {
      limit.why += "the library of device.plugin states no held_force_ratio";
      limit.remedy = "if the maker of the device states one, give it in device.plugin.options";
    } else {
      limit.why += "the workspace reaches a singular place of the arm";
      limit.remedy = "give a smaller device." + driver + ".mount.workspace_half_extent_m";
    }
  } else if (limit.is_below_friction) {
    std::array<char, 32> ratio{};
    std::snprintf(ratio.data(), ratio.size(), "%.3g", specification.held_force_ratio);
    limit.why += std::string(", divided by ") + ratio.data() +
                 ": the currents that the motors hold can be so many times that force elsewhere in "
                 "the workspace";
  }
  return limit;
}

void refuse_unmonitored(const DeviceConfig& config, const DeviceSpecification& specification,
                        bool is_unsafe) {
  if (config.monitor.is_on || specification.is_simulated || is_unsafe) return;
  throw SetupError("device.monitor: off: device \"" + specification.model_name +
                   "\" is real, and a clamp that fails could move the hand with full force; leave "
                   "the field out, or give --unsafe");
}

void refuse_missing_button(const DeviceConfig& config, const DeviceSpecification& specification) {
  if (!config.dead_man_button || *config.dead_man_button < specification.button_count) return;
  throw SetupError(
      "device.dead_man_button: " + std::to_string(*config.dead_man_button) + ": device \"" +
      specification.model_name + "\" has " + std::to_string(specification.button_count) +
      " buttons, counted from 0, and no force would ever act; give one of them, or leave it out");
}

void refuse_unlikely_friction(const DeviceConfig& config,
                              const DeviceSpecification& specification) {
  const double most_newton = kMostFriction_ratio * specification.peak_force_newton;
  if (specification.is_simulated) return;
  const double most_newton_m = kMostFriction_ratio * specification.peak_torque_newton_m.minCoeff();
  if (config.wrist && config.wrist->coulomb_newton_m > most_newton_m) {
    std::array<char, 160> text{};
    std::snprintf(
        text.data(), text.size(),
        "device.wrist.coulomb_newton_m: %.3g N·m: of more than a quarter of the weakest motor, "
        "%.3g N·m, ",
        config.wrist->coulomb_newton_m, most_newton_m);
    throw SetupError(
        std::string(text.data()) +
        "it is not believed that the joint's friction absorbs what the motor does; measure "
        "it joint by joint");
  }
  if (config.profile.coulomb_newton <= most_newton) return;
  throw SetupError("device.profile.coulomb_newton: " + newton_text(config.profile.coulomb_newton) +
                   ": device \"" + specification.model_name + "\" has motors of " +
                   newton_text(specification.peak_force_newton) +
                   ", and of a friction of more than a quarter of that, " +
                   newton_text(most_newton) +
                   ", it is not believed that it absorbs what the motors do; measure it with "
                   "palpate identify");
}

void refuse_finer_resolution(const DeviceConfig& config, const DeviceSpecification& specification) {
  const double step_m = specification.position_resolution_m;
  if (specification.is_simulated || config.profile.position_resolution_m >= step_m) return;
  std::array<char, 48> text{};
  // rounded up, to be taken as it is
  std::snprintf(text.data(), text.size(), "%.0fe-6", std::ceil(1e6 * step_m));
  throw SetupError(
      "device.profile.position_resolution_m: " +
      micrometre_text(config.profile.position_resolution_m) + ": the steps of device \"" +
      specification.model_name + "\" are up to " + micrometre_text(step_m) +
      " in its workspace, and more energy than is counted could be drawn; give " + text.data());
}

/// No command and no push of the check is stronger.
double DeviceNode::motor_limit_newton() const noexcept {
  return std::min(config_.peak_force_newton,
                  largest_force_newton(config_, device_.specification()));
}

/// A force that the device's friction absorbs needs none, whatever its sign.
bool DeviceNode::has_motor_check() const noexcept {
  return !device_.specification().is_simulated && !config_.skips_motor_check &&
         motor_limit_newton() > config_.profile.coulomb_newton;
}

/// Whether a person has acknowledged the device, and holds the dead-man button, if there is one. A
/// press of it acknowledges: one that began while no force could act.
bool DeviceNode::may_push(const DeviceSample& sample) noexcept {
  const auto& button = config_.dead_man_button;
  if (!button) return is_acknowledged_;
  if (((sample.buttons >> *button) & 1U) != 0) {
    is_acknowledged_ = is_acknowledged_ || was_let_go_;
    return is_acknowledged_;
  }
  was_let_go_ = true;
  ++counters_.dead_man_ticks;
  return false;
}

/// Where the dead-man button is not held, that is the reason.
void DeviceNode::count_waiting(const DeviceTick& record) noexcept {
  const auto& button = config_.dead_man_button;
  switch (phase()) {
    case DevicePhase::kClosed:
    case DevicePhase::kConnected:
      ++counters_.uncalibrated_ticks;
      break;
    case DevicePhase::kCalibrated:
      if (!button || ((record.buttons >> *button) & 1U) != 0) ++counters_.unacknowledged_ticks;
      break;
    case DevicePhase::kChecking:
      if (!button || ((record.buttons >> *button) & 1U) != 0) ++counters_.checking_ticks;
      break;
    case DevicePhase::kUnknown:
    case DevicePhase::kEnabled:
    case DevicePhase::kFaulted:
      break;
  }
}

/// The small push before the first force, and the tick that ends it. No command acts, nothing is
/// sent, and no account counts: they begin anew with the next reading.
FaultReason DeviceNode::check_motors(const DeviceSample& sample, bool may_push_now,
                                     TimePoint deadline, DeviceTick& record) noexcept {
  is_unbooked_ = true;
  follow_applied(sample, details_of(sample));
  record.buttons = sample.buttons;
  record_unsent(record);
  guard_.reset();
  if (!must_check_motors_ || !may_push_now) {  // enabled, or interrupted by the button
    if (release_once()) begin_anew();          // or the next tick is a fault
    restart_frozen();
    return FaultReason::kNone;
  }
  const Vector3 push_newton = motor_check_.next(sample.sampled_at, sample.hand_position_m);
  record.force_on_hand_newton = push_newton;
  const FaultReason reason =
      switch_to({.force_on_hand_newton = push_newton, .lease = config_.lease}, deadline, record);
  guard_.reset();
  if (reason != FaultReason::kNone) return reason;
  motor_check_.applied(record.force_on_hand_newton);
  counters_.checked_motor_gain = motor_check_.gain_at_least();
  switch (motor_check_.verdict()) {
    case MotorVerdict::kChecking:
      break;
    case MotorVerdict::kGood:
      must_check_motors_ = false;
      break;
    case MotorVerdict::kWrongWay:
      return FaultReason::kMotorsWrongWay;
    case MotorVerdict::kTooStrong:
      return FaultReason::kMotorsTooStrong;
    case MotorVerdict::kFrozen:
      return FaultReason::kPositionFrozen;
    case MotorVerdict::kNotSeen:
      return FaultReason::kMotorsNotSeen;
    case MotorVerdict::kInterrupted:
      return FaultReason::kCheckInterrupted;
  }
  return FaultReason::kNone;
}

/// The record shows the last finite reading, even one that was judged impossible.
void DeviceNode::latch(FaultReason reason, DeviceTick& record) noexcept {
  fault_ = reason;
  is_acknowledged_ = false;
  was_let_go_ = false;
  must_check_motors_ = has_motor_check();
  motor_check_.begin();
  note({.kind = JournalKind::kFault, .at = clock_.now(), .fault = reason});
  restart_frozen();
  counters_.last_fault = reason;
  ++counters_.device_faults;
  record_acted(record);
  release_motors();
  record.switched_at = clock_.now();
  record.guard = GuardState::kFault;
  record_last_reading(record);
  notify_observer(record);
}

DevicePhase DeviceNode::phase() const noexcept {
  if (has_fault()) return DevicePhase::kFaulted;
  const DevicePhase reached = device_.phase();
  if (reached != DevicePhase::kCalibrated || !is_acknowledged_) return reached;
  return must_check_motors_ ? DevicePhase::kChecking : DevicePhase::kEnabled;
}

void DeviceNode::acknowledge() noexcept {
  const bool has_helped = has_fault() ? reset_fault() : calibrate_or_enable();
  if (!has_helped) ++vain_acknowledgements_;
}

bool DeviceNode::calibrate_or_enable() noexcept {
  if (device_.phase() == DevicePhase::kConnected) {
    // one that cannot be reached any more is as if it were new
    if (!device_.calibrate()) static_cast<void>(device_.reopen(kResetWithin));
    // one that was silent until now confirms its release now
    if (device_.phase() == DevicePhase::kCalibrated && release_once()) begin_anew();
  } else {
    is_acknowledged_ = device_.phase() == DevicePhase::kCalibrated;
  }
  return device_.phase() == DevicePhase::kCalibrated;
}

/// Takes no calibration: nobody was asked for it yet. A device that is silent until it has one
/// confirms its release with it.
bool DeviceNode::reset_fault() noexcept {
  const bool has_lost_calibration = device_.phase() == DevicePhase::kConnected;
  const bool was_released = is_released_;
  const bool is_reached = device_.reopen(kResetWithin) && release_once();
  const bool may_be_silent =
      !device_.specification().answers_uncalibrated && device_.phase() == DevicePhase::kConnected;
  // of one that was not released before nobody could know that it would be back
  if (!(is_reached ? was_released : may_be_silent)) return false;
  fault_ = FaultReason::kNone;
  ++counters_.fault_resets;
  if (device_.phase() == DevicePhase::kCalibrated) {
    begin_anew();
    is_acknowledged_ = !has_lost_calibration;
  }
  return true;
}

void DeviceNode::acknowledge(const SeenDevice& seen) noexcept {
  if (!waits_for_acknowledgement(seen.phase) || seen.phase != phase() ||
      seen.device_faults != counters_.device_faults) {
    ++counters_.page_acknowledgements_refused;
    return;
  }
  ++counters_.page_acknowledgements;
  acknowledge();
}

/// After a fault, a calibration or the check of the motors, motors released. What the encoder or
/// the hand did meanwhile is not known: the echo begins anew, which mofc_node takes as a gap, and a
/// debt from before stays.
void DeviceNode::begin_anew() noexcept {
  is_unbooked_ = false;
  judge_.begin();
  measured_.begin();
  applied_ = AppliedForces(device_.specification().has_motor_watchdog);
  monitor_.lost();
}

void DeviceNode::release_motors() noexcept {
  static_cast<void>(release_once());
  guard_.reset();
}

/// A force that the device did not confirm as ended goes on, in the accounts too.
bool DeviceNode::release_once() noexcept {
  is_released_ = device_.release();
  if (is_released_ && applied_.has_begun()) {
    const TimePoint now = clock_.now();
    applied_.released(now);
    monitor_.released(now);
  }
  return is_released_;
}

/// In a latched fault, until the device confirms it.
void DeviceNode::release_again() noexcept {
  const TimePoint now = clock_.now();
  if (device_.phase() == DevicePhase::kClosed && now >= reopens_at_) {
    reopens_at_ = now + kReopenEvery;
    static_cast<void>(device_.reopen(kReopenWithin));
  }
  static_cast<void>(release_once());
}

FaultReason DeviceNode::reason_of_last(FaultReason otherwise) const noexcept {
  switch (device_.last_error()) {
    case DeviceError::kTimeout:
      return FaultReason::kDeviceSilent;
    case DeviceError::kUnplugged:
      return FaultReason::kDeviceGone;
    case DeviceError::kCorrupt:
      return FaultReason::kDeviceCorrupt;
    case DeviceError::kNotReady:
      return FaultReason::kDeviceNotReady;
    case DeviceError::kNone:
    case DeviceError::kFailed:
      break;
  }
  return otherwise;
}

}  // namespace palpate::device
