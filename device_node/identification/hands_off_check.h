// SPDX-License-Identifier: Apache-2.0
// hands_off_check.h — a short look at the friction before a session starts: does the device have
// what its profile claims? Nobody may hold it.
#pragma once

#include <cstdint>
#include <optional>
#include <stop_token>

#include "common/core/clock.h"
#include "common/session/device_profile.h"
#include "device_node/device.h"
#include "device_node/identification/friction_identification.h"

namespace palpate::device {

struct CheckedProfile {
  DeviceProfile profile;    ///< no value is above that of the profile that was checked
  bool is_lowered = false;  ///< the device contradicts the profile
  /// Least friction found at 0.05 m/s, as a share of what the profile claims; 1 where it holds.
  double ratio = 1.0;
};

/// Lines through the middle of the workspace, along the axes of D that have motors; about a minute.
[[nodiscard]] SweepPlan hands_off_plan(const DeviceSpecification& specification);

/// Compares a profile with what was measured along the axes of D. It is contradicted where the
/// friction at 0.05 m/s is less than 0.95 of what it claims, or the viscous part less than half;
/// f_d and f_co then become the measured lower bounds. No value is raised. Isotropic friction is
/// judged by every line, friction per axis by that of its axis.
[[nodiscard]] CheckedProfile checked_profile(const DeviceProfile& profile,
                                             const FrictionReport& report);

/// A check that a person has to acknowledge is refused before that.
/// @throws SetupError  the motors of the device end no force by themselves
void refuse_hands_off_check(const DeviceSpecification& specification);

/// The check: moves the device with its own motors, within the bounds of identify_friction(), and
/// returns with the motors limp. Throws as identify_friction() does.
/// @param dead_man_button, stop  @see SweepPlan
[[nodiscard]] inline CheckedProfile check_hands_off(
    HapticDevice& device, Clock& clock, const DeviceProfile& profile,
    std::optional<std::uint32_t> dead_man_button = {}, const std::stop_token& stop = {}) {
  SweepPlan plan = hands_off_plan(device.specification());
  plan.dead_man_button = dead_man_button;
  plan.stop = stop;
  return checked_profile(profile, identify_friction(device, clock, plan, {.may_move = true}));
}

}  // namespace palpate::device
