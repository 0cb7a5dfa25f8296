// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/verdict/device_findings.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <utility>

#include "common/telemetry/verdict/causes.h"
#include "common/telemetry/verdict/fault_remedy.h"
#include "common/telemetry/verdict/remedies.h"

namespace palpate {
namespace {

/// Of the tissue; the pushes of the check of its motors are none.
bool gave_no_force(const DeviceCounters& device) {
  switch (device.phase) {
    case DevicePhase::kClosed:
    case DevicePhase::kConnected:
    case DevicePhase::kCalibrated:
      return device.max_force_newton == 0.0;
    case DevicePhase::kChecking:
      return device.answered_ticks == 0;
    case DevicePhase::kUnknown:
    case DevicePhase::kEnabled:
    case DevicePhase::kFaulted:
      break;
  }
  return false;
}

const char* remedy_before_enabled(DevicePhase phase) {
  switch (phase) {
    case DevicePhase::kCalibrated:
      return "acknowledge it: SIGUSR2 (event=acknowledge_with in the log), or press "
             "device.dead_man_button";
    case DevicePhase::kChecking:
      return "hold the handle loosely and still until it is enabled, and run longer";
    default:
      return "connect and calibrate it as device_node asks";
  }
}

std::uint64_t waited_ticks(const DeviceCounters& device) {
  return device.uncalibrated_ticks + device.unacknowledged_ticks + device.checking_ticks;
}

double waited_ratio(const DeviceCounters& device, std::uint64_t ticks) {
  return ratio(waited_ticks(device), ticks);
}

/// "waited for its calibration (58 %) and for an acknowledgement (3 %)"
std::string waited_text(const DeviceCounters& device, std::uint64_t ticks) {
  std::string text;
  const auto part = [&](std::uint64_t count, const char* what) {
    if (count == 0) return;
    text +=
        (text.empty() ? "" : ", ") + std::string(what) + " (" + percent(ratio(count, ticks)) + ")";
  };
  part(device.uncalibrated_ticks, "waited for its connection or calibration");
  part(device.unacknowledged_ticks, "waited for an acknowledgement");
  part(device.checking_ticks, "checked its motors");
  return text;
}

}  // namespace

bool has_fault(const RunFacts& facts) {
  return facts.device.device_faults > 0 || facts.device.phase == DevicePhase::kFaulted;
}

std::vector<RunFinding> device_findings(const RunFacts& facts) {
  std::vector<RunFinding> findings;
  const auto add = [&](OwnFinding&& one) { findings.push_back(std::move(one).finding()); };
  const DeviceCounters& device = facts.device;
  const std::uint64_t ticks = device.loop.ticks + device.loop.skipped_ticks;
  if (has_fault(facts)) {
    const bool is_reset = device.fault_resets >= device.device_faults;
    const bool is_of_before =
        !is_reset && facts.device_node.restarts > 0;  // a process that is gone
    const bool is_latched = device.phase == DevicePhase::kFaulted || (!is_reset && !is_of_before);
    std::string text = fmt::format("device fault: {}", name(device.last_fault));
    if (device.device_faults > 1) text += fmt::format(", {} faults", device.device_faults);
    text +=
        fmt::format("; no force in {} of the ticks{}", percent(ratio(device.fault_ticks, ticks)),
                    is_latched     ? ", latched at the end"
                    : is_of_before ? ", before device_node was started again"
                                   : ", reset since");
    const bool is_jump =
        device.last_fault == FaultReason::kPositionJumped && is_path_too_fast(facts);
    add({Grade::kBad, "device_fault", text,
         is_jump ? path_remedy(facts) : remedy_of(device.last_fault)});
  }
  if (device.is_release_unconfirmed) {
    add({Grade::kBad, "release_unconfirmed", "the device did not confirm its release",
         kReleaseUnconfirmedText});
  }
  if (!has_fault(facts) && device.loop.ticks > 0 && gave_no_force(device)) {
    add({Grade::kBad, "device_not_enabled",
         device.phase == DevicePhase::kChecking
             ? "the device gave no force of the tissue: its motors were still checked at the end"
             : fmt::format("the device gave no force: it is only {}", name(device.phase)),
         remedy_before_enabled(device.phase)});
  }
  if (const double waited = waited_ratio(device, ticks); waited >= kFairRatio) {
    add({Grade::kFair, "device_waited",
         "no force in " + percent(waited) + " of the ticks: after its first force the device " +
             waited_text(device, ticks),
         remedy_before_enabled(device.uncalibrated_ticks >= device.unacknowledged_ticks
                                   ? DevicePhase::kConnected
                                   : DevicePhase::kCalibrated),
         waited});
  }
  const double without_hand = ratio(device.dead_man_ticks, ticks);
  if (without_hand >= kFairRatio) {
    add({Grade::kFair, "dead_man_button",
         "no force in " + percent(without_hand) + " of the ticks: the dead-man button was not held",
         "hold device.dead_man_button, or leave it out of the session", without_hand});
  }
  if (const double frozen = ratio(device.frozen_ticks, ticks); frozen > 0.0) {
    add({frozen >= kFairRatio ? Grade::kFair : Grade::kGood, "position_frozen",
         "no force in " + percent(frozen) +
             " of the ticks: the positions stood still under a force",
         "check the encoders; an arm at its end stop, or one that leans on something, does the "
         "same",
         frozen});
  }
  if (device.coarse_readings > 0) {
    add({Grade::kBad, "encoder_coarse",
         fmt::format("{} readings had steps coarser than the profile says", device.coarse_readings),
         "give the true one in device.profile.position_resolution_m"});
  }
  if (device.outside_readings > 0) {  // a tick has two, before and at its switch
    add({Grade::kBad, "outside_workspace",
         thousands(static_cast<double>(device.outside_readings)) +
             " readings were outside of the device's workspace, where nothing bounds what the "
             "currents do that its motors hold",
         "keep the hand inside, or give a larger mount.workspace_half_extent_m",
         std::min(1.0, ratio(device.outside_readings, 2 * ticks))});
  }
  if (const double repeated = ratio(device.repeated_readings, ticks); repeated >= kFairRatio) {
    add({Grade::kFair, "readings_repeated",
         percent(repeated) + " of the readings had the stamp of the one before",
         "the driver has no newer reading at each tick: let it wait for one, or lower "
         "device.rate_hz to the rate of the device",
         repeated});
  }
  return findings;
}

}  // namespace palpate
