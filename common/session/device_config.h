// SPDX-License-Identifier: Apache-2.0
// device_config.h — the tick of the device and the limits of its force.
#pragma once

#include <cstdint>
#include <optional>

#include "common/core/time.h"
#include "common/core/workspace_map.h"
#include "common/session/device_profile.h"

namespace palpate {

/// The independent monitor of the energy: device_node/monitor.
struct MonitorConfig {
  bool is_on = true;
  /// Fastest hand that the session's controller assumes; infinite: it assumes none.
  double v_max_m_per_s = 0.5;
  /// It is that of each axis by itself, as of joints; false: of the hand in space.
  bool is_v_max_per_axis = false;

  /// No hand is faster, all axes together.
  [[nodiscard]] double fastest_m_per_s() const noexcept {
    constexpr double kSqrt3 = 1.7320508075688773;
    return is_v_max_per_axis ? kSqrt3 * v_max_m_per_s : v_max_m_per_s;
  }
};

struct DeviceConfig {
  double rate_hz = 1000.0;
  Duration reply{};                ///< δ_max: latest deadline for the answer, after the reading
  Duration prompt{};               ///< δ_p: answers within it have the first claim to the credit
  Duration lease{};                ///< T_hold: every command may act that long; ≤ 3 periods
  Duration longest_lease{};        ///< and no command longer than that, whatever the credit
  Duration limp_after{};           ///< silence before the fallback force fades
  Duration fade{};                 ///< length of that fade
  Duration start_ramp{};           ///< at the start the force limit grows from 0 over this time
  double peak_force_newton = 3.3;  ///< limit of this session; that of the device holds too
  double slew_newton_per_s = 0.0;  ///< limit on the growth of the force; 0: none
  double v_fault_m_per_s = 10.0;   ///< faster motion is an encoder fault
  WorkspaceConfig workspace;
  DeviceProfile profile;
  std::optional<WristProfile> wrist = {};  ///< none: the device gives no torque
  MonitorConfig monitor;
  /// Force only while this button is held; none: no such button.
  std::optional<std::uint32_t> dead_man_button = {};
  /// Forces above f_co although the motors do not end a force by themselves.
  bool accepts_no_motor_watchdog = false;
  /// Positions may be older, and forces begin later, than the device's stamps by so much.
  Duration latency{};
  bool skips_motor_check = false;    ///< a real device is enabled without device_node/motor_check.h
  bool has_hands_off_check = false;  ///< at the start: device_node/identification/hands_off_check.h
};

}  // namespace palpate
