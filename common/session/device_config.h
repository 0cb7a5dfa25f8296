// device_config.h — the device's tick and the limits of its force.
#pragma once

#include "common/core/time.h"
#include "common/core/workspace_map.h"
#include "common/session/device_profile.h"

namespace palpate {

struct DeviceConfig {
  double rate_hz = 1000.0;
  Duration reply{};                ///< deadline for the answer, from the reading
  Duration lease{};                ///< T_hold: valid_for of a command; ≤ 3 periods
  Duration limp_after{};           ///< silence after which the fallback fades
  Duration fade{};                 ///< length of that fade
  Duration start_ramp{};           ///< limp start: the force grows from nothing over this time
  double peak_force_newton = 3.3;  ///< of this session; the device's own limit holds too
  double slew_newton_per_s = 0.0;  ///< limit on growing force; 0: none
  double v_fault_m_per_s = 10.0;   ///< a hand that is faster is a fault of the encoder
  WorkspaceConfig workspace;
  DeviceProfile profile;
};

}  // namespace palpate
