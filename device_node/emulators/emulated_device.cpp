// SPDX-License-Identifier: Apache-2.0
#include "device_node/emulators/emulated_device.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <string_view>
#include <utility>

#include "common/core/check.h"

namespace palpate::device {
namespace {

constexpr std::array<std::pair<std::string_view, WireFault>, 18> kWireFaults{
    {{"unplugged", WireFault::kUnplugged},
     {"silent", WireFault::kSilent},
     {"delayed", WireFault::kDelayed},
     {"garbage", WireFault::kGarbage},
     {"short", WireFault::kShort},
     {"wrong_id", WireFault::kWrongId},
     {"stuck", WireFault::kStuck},
     {"echo", WireFault::kEcho},
     {"no_watchdog", WireFault::kNoWatchdog},
     {"no_supply", WireFault::kNoSupply},
     {"uncalibrated", WireFault::kUncalibrated},
     {"power_cycle", WireFault::kPowerCycle},
     {"encoder_zero", WireFault::kEncoderZero},
     {"set_up_anywhere", WireFault::kSetUpAnywhere},
     {"doubled", WireFault::kDoubled},
     {"grip_gone", WireFault::kGripGone},
     {"grip_off", WireFault::kGripOff},
     {"grip_frozen", WireFault::kGripFrozen}}};

constexpr Duration kForever = std::chrono::hours(24);

bool read_number(std::string_view text, double& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && value >= 0.0 && value < 1e6;
}

bool is_in(const PlannedFault& fault, double now_s) {
  return now_s >= fault.from_s && now_s < fault.from_s + fault.length_s;
}

std::vector<FaultOutcome> outcomes_of(const std::vector<PlannedFault>& faults) {
  std::vector<FaultOutcome> outcomes;
  for (const PlannedFault& fault : faults) outcomes.push_back({.fault = fault});
  return outcomes;
}

}  // namespace

PlannedFault parse_fault(const std::string& text) {
  const std::string_view all = text;
  const std::size_t at = all.find('@');
  const std::size_t colon = all.find(':');
  if (at != std::string_view::npos && colon != std::string_view::npos && at < colon) {
    for (const auto& [name, kind] : kWireFaults) {
      PlannedFault fault{.kind = kind};
      double length_ms = 0.0;
      if (all.substr(0, at) == name &&
          read_number(all.substr(at + 1, colon - at - 1), fault.from_s) &&
          read_number(all.substr(colon + 1), length_ms)) {
        fault.length_s = 1e-3 * length_ms;
        return fault;
      }
    }
  }
  std::string kinds;
  for (const auto& [name, kind] : kWireFaults) {
    kinds += (kinds.empty() ? "" : ", ") + std::string(name);
  }
  throw SetupError("--fault \"" + text +
                   "\": give KIND@SECONDS:MILLISECONDS, such as "
                   "unplugged@2:500; kinds are " +
                   kinds);
}

EmulatedDevice::EmulatedDevice(const SimulatedDeviceConfig& device, const HandConfig& hand,
                               const Clock& clock, std::uint64_t seed, Duration watchdog,
                               const std::vector<PlannedFault>& faults)
    : clock_(clock),
      start_(clock.now()),
      device_(device, hand, clock, seed),
      watchdog_(watchdog),
      outcomes_(outcomes_of(faults)) {}

WireFault EmulatedDevice::fault() const noexcept {
  const std::scoped_lock lock(faults_);
  const double now_s = this->now_s();
  for (const FaultOutcome& outcome : outcomes_) {
    const PlannedFault& fault = outcome.fault;
    if (fault.kind <= WireFault::kEcho && is_in(fault, now_s)) return fault.kind;
  }
  return WireFault::kNone;
}

bool EmulatedDevice::has(WireFault kind) const noexcept {
  const std::scoped_lock lock(faults_);
  return std::any_of(outcomes_.begin(), outcomes_.end(), [&](const FaultOutcome& outcome) {
    return outcome.fault.kind == kind && is_in(outcome.fault, now_s());
  });
}

bool EmulatedDevice::takes_begin_of(WireFault kind) noexcept {
  const std::scoped_lock lock(faults_);
  bool has_begun = false;
  for (FaultOutcome& outcome : outcomes_) {
    if (outcome.fault.kind != kind || outcome.has_begun || now_s() < outcome.fault.from_s) continue;
    outcome.has_begun = has_begun = true;
  }
  return has_begun;
}

Duration EmulatedDevice::watchdog() const noexcept {
  return has(WireFault::kNoWatchdog) ? kForever : watchdog_;
}

DeviceSample EmulatedDevice::switch_to(const Vector3& force_on_hand_newton) noexcept {
  DeviceSample sample;
  const Vector3 made_newton =
      has(WireFault::kNoSupply) ? Vector3(Vector3::Zero()) : force_on_hand_newton;
  static_cast<void>(device_.apply(made_newton, watchdog(), sample));
  note_switch(sample.sampled_at, sample.applied_force_newton.norm());
  ++messages_;
  return seen(sample);
}

DeviceSample EmulatedDevice::read() noexcept {
  DeviceSample sample;
  static_cast<void>(device_.read(sample));
  ++messages_;
  return seen(sample);
}

void EmulatedDevice::let_go() noexcept {
  if (has(WireFault::kNoWatchdog)) return;
  static_cast<void>(device_.release());
  note_switch(clock_.now(), 0.0);
}

void EmulatedDevice::plan(const PlannedFault& fault) {
  const std::scoped_lock lock(faults_);
  outcomes_.push_back({.fault = fault});
}

double EmulatedDevice::acting_newton() const noexcept {
  const std::scoped_lock lock(faults_);
  return clock_.now() < force_end_ ? force_newton_ : 0.0;
}

std::vector<FaultOutcome> EmulatedDevice::outcomes() {
  const std::scoped_lock lock(faults_);
  note_force_until(clock_.now());
  return outcomes_;
}

void EmulatedDevice::note_switch(TimePoint at, double force_newton) noexcept {
  const Duration watchdog = this->watchdog();
  const std::scoped_lock lock(faults_);
  note_force_until(at);
  force_newton_ = force_newton;
  force_since_ = at;
  force_end_ = at + watchdog;
}

void EmulatedDevice::note_force_until(TimePoint now) noexcept {
  const TimePoint force_end = std::min(now, force_end_);
  if (force_newton_ == 0.0) return;
  for (FaultOutcome& outcome : outcomes_) {
    const TimePoint begin = start_ + from_seconds(outcome.fault.from_s);
    const TimePoint end = begin + from_seconds(outcome.fault.length_s);
    if (force_end <= begin || force_since_ >= end) continue;
    if (force_since_ <= begin) outcome.force_newton = force_newton_;
    outcome.pushed_for = std::min(force_end, end) - begin;
  }
}

DeviceSample EmulatedDevice::seen(const DeviceSample& sample) noexcept {
  least_energy_joule_ = device_.true_state().minimum_energy_joule;
  if (fault() == WireFault::kStuck)
    last_.sampled_at = sample.sampled_at;
  else
    last_ = sample;
  return last_;
}

}  // namespace palpate::device
