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

struct KnownFault {
  std::string_view name;
  WireFault kind;
  std::string_view drivers = {};  ///< of which devices alone; none: of all
};
constexpr std::string_view kOfOneHandle = "haply_inverse hapi falcon wooden";
constexpr std::array<KnownFault, 36> kWireFaults{
    {{"unplugged", WireFault::kUnplugged},
     {"silent", WireFault::kSilent},
     {"delayed", WireFault::kDelayed},
     {"garbage", WireFault::kGarbage},
     {"short", WireFault::kShort},
     {"wrong_id", WireFault::kWrongId, "haply_inverse hapi dynamixel openarm"},
     {"stuck", WireFault::kStuck},
     {"echo", WireFault::kEcho, "falcon"},
     {"no_watchdog", WireFault::kNoWatchdog},
     {"no_supply", WireFault::kNoSupply},
     {"uncalibrated", WireFault::kUncalibrated, "haply_inverse"},
     {"power_cycle", WireFault::kPowerCycle, "hapi wooden"},
     {"encoder_zero", WireFault::kEncoderZero, "falcon wooden"},
     {"set_up_anywhere", WireFault::kSetUpAnywhere, "hapi"},
     {"doubled", WireFault::kDoubled},
     {"grip_gone", WireFault::kGripGone, "haply_inverse"},
     {"grip_off", WireFault::kGripOff, "haply_inverse"},
     {"grip_frozen", WireFault::kGripFrozen, "haply_inverse"},
     {"watchdog_20", WireFault::kWatchdog20, kOfOneHandle},
     {"watchdog_100", WireFault::kWatchdog100, kOfOneHandle},
     {"watchdog_500", WireFault::kWatchdog500, kOfOneHandle},
     {"late", WireFault::kLate, kOfOneHandle},
     {"one_tick", WireFault::kOneTick, kOfOneHandle},
     {"turning", WireFault::kTurning, "hapi falcon wooden"},
     {"reversed", WireFault::kReversed},
     {"strong", WireFault::kStrong},
     {"weight", WireFault::kWeight, kOfOneHandle},
     {"dropped", WireFault::kDropped},
     {"partial", WireFault::kPartial, "hapi falcon wooden dynamixel"},
     {"merged", WireFault::kMerged, kOfOneHandle},
     {"unlisted", WireFault::kUnlisted, "haply_inverse"},
     {"servo_gone", WireFault::kServoGone, "dynamixel openarm"},
     {"servo_reboot", WireFault::kServoReboot, "dynamixel openarm"},
     {"servo_overload", WireFault::kServoOverload, "dynamixel openarm"},
     {"bit_errors", WireFault::kBitErrors, "dynamixel"},
     {"bus_off", WireFault::kBusOff, "openarm"}}};

constexpr double kWeightNewton = 0.5;
constexpr std::uint64_t kDroppedOneIn = 20;

constexpr double kMostNumber = 1e6;  // s and ms

bool read_number(std::string_view text, double& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && value >= 0.0;
}

/// Takes effect as it begins, however long it is.
bool is_at_once(WireFault kind) {
  return kind == WireFault::kPowerCycle || kind == WireFault::kEncoderZero ||
         kind == WireFault::kServoReboot || kind == WireFault::kServoOverload;
}

/// Kinds of which one acts at a time; 0: beside all others. Of two that were given, that of the
/// earlier place in the group acts, or the one that was given first.
struct FaultGroup {
  int group = 0;
  int rank = 0;
};
FaultGroup group_of(WireFault kind) {
  constexpr std::array kWatchdogKinds{WireFault::kNoWatchdog, WireFault::kWatchdog20,
                                      WireFault::kWatchdog100, WireFault::kWatchdog500};
  constexpr std::array kTransferKinds{WireFault::kDoubled, WireFault::kMerged, WireFault::kPartial};
  constexpr std::array kGripKinds{WireFault::kGripGone, WireFault::kGripOff,
                                  WireFault::kGripFrozen};
  if (kind <= WireFault::kEcho) return {.group = 1};
  const auto within = [&](const auto& kinds, int group) -> FaultGroup {
    const auto at = std::find(kinds.begin(), kinds.end(), kind);
    return at == kinds.end() ? FaultGroup{}
                             : FaultGroup{group, static_cast<int>(at - kinds.begin())};
  };
  for (const FaultGroup& found :
       {within(kWatchdogKinds, 2), within(kTransferKinds, 3), within(kGripKinds, 4)}) {
    if (found.group > 0) return found;
  }
  return {};
}

SetupError fault_of_another(const std::string& text, const std::string& driver,
                            std::string_view drivers) {
  return SetupError("--fault \"" + text + "\": is no fault of " + driver + " but of " +
                    std::string(drivers) + "; leave it out");
}

std::vector<FaultOutcome> outcomes_of(const std::vector<PlannedFault>& faults) {
  std::vector<FaultOutcome> outcomes;
  outcomes.reserve(faults.size());
  for (const PlannedFault& fault : faults) outcomes.push_back({.fault = fault});
  return outcomes;
}

}  // namespace

std::vector<std::string> fault_kinds() {
  std::vector<std::string> kinds;
  kinds.reserve(kWireFaults.size());
  for (const KnownFault& known : kWireFaults) kinds.emplace_back(known.name);
  return kinds;
}

PlannedFault parse_fault(const std::string& text, const std::string& driver) {
  const std::string_view all = text;
  const std::size_t at = all.find('@');
  const std::size_t colon = all.find(':');
  if (at != std::string_view::npos && colon != std::string_view::npos && at < colon) {
    for (const auto& [name, kind, drivers] : kWireFaults) {
      PlannedFault fault{.kind = kind};
      double length_ms = 0.0;
      if (all.substr(0, at) == name &&
          read_number(all.substr(at + 1, colon - at - 1), fault.from_s) &&
          read_number(all.substr(colon + 1), length_ms)) {
        fault.length_s = 1e-3 * length_ms;
        if (!drivers.empty() && drivers.find(driver) == std::string_view::npos) {
          throw fault_of_another(text, driver, drivers);
        }
        if (fault.from_s >= kMostNumber || length_ms >= kMostNumber) {
          throw SetupError("--fault \"" + text +
                           "\": SECONDS and MILLISECONDS are below 1,000,000; give less");
        }
        if (length_ms == 0.0 && !is_at_once(kind)) {
          throw SetupError("--fault \"" + text +
                           "\": lasts 0 ms, so nothing would happen; give its milliseconds");
        }
        return fault;
      }
    }
  }
  std::string kinds;
  for (const std::string& kind : fault_kinds()) kinds += (kinds.empty() ? "" : ", ") + kind;
  throw SetupError("--fault \"" + text +
                   "\": give KIND@SECONDS:MILLISECONDS, such as "
                   "unplugged@2:500; kinds are " +
                   kinds);
}

std::vector<std::pair<std::size_t, std::size_t>> hidden_faults(
    const std::vector<PlannedFault>& faults) {
  std::vector<std::pair<std::size_t, std::size_t>> hidden;
  for (std::size_t i = 0; i < faults.size(); ++i) {
    for (std::size_t k = i + 1; k < faults.size(); ++k) {
      const FaultGroup a = group_of(faults[i].kind);
      const FaultGroup b = group_of(faults[k].kind);
      const bool is_meeting = faults[i].from_s < faults[k].from_s + faults[k].length_s &&
                              faults[k].from_s < faults[i].from_s + faults[i].length_s;
      if (a.group == 0 || a.group != b.group || !is_meeting) continue;
      hidden.push_back(b.rank < a.rank ? std::pair(i, k) : std::pair(k, i));
    }
  }
  return hidden;
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
    if (fault.kind <= WireFault::kEcho && is_under_way(fault, now_s)) return fault.kind;
  }
  return WireFault::kNone;
}

bool EmulatedDevice::has(WireFault kind) const noexcept {
  const std::scoped_lock lock(faults_);
  return std::any_of(outcomes_.begin(), outcomes_.end(), [&](const FaultOutcome& outcome) {
    return outcome.fault.kind == kind && is_under_way(outcome.fault, now_s());
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
  constexpr std::pair<WireFault, Duration> kWatchdogs[] = {
      {WireFault::kNoWatchdog, HardwareVices::kNever},
      {WireFault::kWatchdog20, std::chrono::milliseconds(20)},
      {WireFault::kWatchdog100, std::chrono::milliseconds(100)},
      {WireFault::kWatchdog500, std::chrono::milliseconds(500)}};
  for (const auto& [kind, watchdog] : kWatchdogs) {
    if (has(kind)) return watchdog;
  }
  return watchdog_;
}

void EmulatedDevice::set_vices() noexcept {
  HardwareVices vices{.watchdog = watchdog()};
  if (has(WireFault::kLate)) {
    vices.sensing = vices.actuation = std::chrono::milliseconds(2);
    vices.has_jitter = true;
  }
  if (has(WireFault::kOneTick)) vices.acts_for = std::chrono::microseconds(500);
  if (has(WireFault::kReversed)) vices.gain = -1.0;
  if (has(WireFault::kStrong)) vices.gain = 2.0;
  if (has(WireFault::kWeight)) vices.weight_newton = Vector3(0, 0, -kWeightNewton);
  device_.set(vices);
}

DeviceSample EmulatedDevice::switch_to(const Vector3& force_on_hand_newton) noexcept {
  set_vices();
  return switched(device_.switch_to(has(WireFault::kNoSupply) ? Vector3(Vector3::Zero())
                                                              : force_on_hand_newton));
}

DeviceSample EmulatedDevice::switch_to(Hardware::HeldForce force_on_hand_newton) noexcept {
  if (has(WireFault::kNoSupply)) return switch_to(Vector3(Vector3::Zero()));
  set_vices();
  return switched(device_.switch_to(std::move(force_on_hand_newton)));
}

DeviceSample EmulatedDevice::switched(const DeviceSample& sample) noexcept {
  note_switch(sample.sampled_at, force_newton().norm());
  ++messages_;
  return seen(sample);
}

std::vector<std::vector<std::byte>> EmulatedDevice::transfers_of(
    std::span<const std::byte> answer) {
  if (has(WireFault::kDropped) && ++answers_ % kDroppedOneIn == 0) return {};
  const std::vector<std::byte> whole(answer.begin(), answer.end());
  const std::vector<std::byte> before = std::exchange(last_answer_, whole);
  if (has(WireFault::kDoubled)) return {whole, whole};
  if (has(WireFault::kMerged) && !before.empty()) {
    std::vector<std::byte> both = before;
    both.insert(both.end(), whole.begin(), whole.end());
    return {both};
  }
  const auto middle = whole.begin() + static_cast<std::ptrdiff_t>(whole.size() / 2);
  if (has(WireFault::kPartial)) return {{whole.begin(), middle}, {middle, whole.end()}};
  return {whole};
}

DeviceSample EmulatedDevice::read() noexcept {
  set_vices();
  const DeviceSample sample = device_.read();
  ++messages_;
  return seen(sample);
}

void EmulatedDevice::let_go() noexcept {
  if (has(WireFault::kNoWatchdog)) return;
  device_.let_go();
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
