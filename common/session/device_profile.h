// device_profile.h — what the controller may assume of the device. The true values of a simulated
// device are elsewhere (simulation_config.h): the controller never sees them.
#pragma once

#include <optional>

#include "common/core/vector.h"

namespace palpate {

/// Friction that acts on each axis of D by itself: f_d,i v_i + f_co,i sgn(v_i).
struct FrictionPerAxis {
  Vector3 viscous_newton_s_per_m = Vector3::Zero();  ///< f_d,i
  Vector3 coulomb_newton = Vector3::Zero();          ///< f_co,i
};

/// What the ledger may count on: lower bounds over the workspace (docs/theory.md §1).
struct DeviceProfile {
  double viscous_newton_s_per_m = 0.1;   ///< f_d of the isotropic friction f_d v + f_co v/|v|
  double coulomb_newton = 0.1;           ///< f_co; at most the smallest f_co,i
  double position_resolution_m = 55e-6;  ///< q, per axis
  std::optional<FrictionPerAxis> per_axis = {};
};

}  // namespace palpate
