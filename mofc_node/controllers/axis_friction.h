// SPDX-License-Identifier: Apache-2.0
/// @file
/// axis_friction.h — friction that acts on each axis independently.
#pragma once

#include <Eigen/Core>

#include "mofc_equations.h"

namespace palpate::controllers {

/// Lower bounds of f_d,i v_i + f_co,i sgn(v_i) on axis i. Not the bounds of an isotropic friction
/// f_d v + f_co v/|v|: that takes f_co|v|, and Σ|v_i| may be √3 |v|, so its f_co,i is f_co/√3.
struct AxisFriction {
  Eigen::Vector3d f_d = Eigen::Vector3d::Zero();   ///< each ≥ 0 [N·s/m]
  Eigen::Vector3d f_co = Eigen::Vector3d::Zero();  ///< each ≥ 0 [N]

  /// The parameters of one axis.
  /// @param i  0 … 2   @param T  > 0 [s]
  [[nodiscard]] MofcParameters on_axis(int i, double T) const noexcept {
    return {.f_d = f_d[i], .f_co = f_co[i], .T = T};
  }
};

}  // namespace palpate::controllers
