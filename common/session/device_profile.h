// SPDX-License-Identifier: Apache-2.0
// device_profile.h — what the controller may assume about the device. The controller never sees the
// true values of a simulated device (simulation_config.h).
#pragma once

#include <optional>

#include "common/core/vector.h"

namespace palpate {

/// Friction of each axis of D: f_d,i v_i + f_co,i sgn(v_i).
struct FrictionPerAxis {
  Vector3 viscous_newton_s_per_m = Vector3::Zero();  ///< f_d,i
  Vector3 coulomb_newton = Vector3::Zero();          ///< f_co,i
};

/// Lower bounds over the workspace, which the ledger relies on (docs/theory.md §1).
struct DeviceProfile {
  double viscous_newton_s_per_m = 0.1;   ///< f_d of the isotropic friction f_d v + f_co v/|v|
  double coulomb_newton = 0.1;           ///< f_co; at most the smallest f_co,i
  double position_resolution_m = 55e-6;  ///< q, per axis
  std::optional<FrictionPerAxis> per_axis = {};
};

/// Three joints of the handle, all alike (core/messages.h), as the clamp may count on them.
struct WristProfile {
  double viscous_newton_m_s_per_rad = 2e-4;  ///< f_d, at least
  double coulomb_newton_m = 2e-3;            ///< f_co, at least
  double angle_resolution_rad = 1e-4;        ///< q
  double peak_torque_newton_m = 0.2;
  double v_max_rad_per_s = 6.0;  ///< the hand turns no joint faster
};

}  // namespace palpate
