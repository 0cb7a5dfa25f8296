// SPDX-License-Identifier: Apache-2.0
/// @file
/// implicit_step.h — where a proxy goes within a period, so that the forces on it balance at the
/// end.
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>

namespace palpate {

/// Newton's method for the root of `residual`, the force on the proxy by its place. The steps are
/// halved until they help, because the force has a kink at the surface. At most 6 steps, or until
/// 0.1 µN are left; where no step helps, the best place so far. No allocation, no throw.
/// @param residual  Eigen::Vector3d(const Eigen::Vector3d&): place [m] → force [N], noexcept
/// @param start  the root without tissue [m]
/// @param slope  −∂ residual/∂p without tissue, > 0 [N/m]
/// @return the place at the end of the period [m], in the frame of `start`
template <class Residual>
[[nodiscard]] Eigen::Vector3d implicit_step(const Residual& residual, const Eigen::Vector3d& start,
                                            double slope) noexcept {
  constexpr int kMostIterations = 6;
  constexpr int kMostHalvings = 5;
  constexpr double kDifference_m = 1e-8;
  constexpr double kTolerance_newton = 1e-7;
  Eigen::Vector3d p = start;
  Eigen::Vector3d r = residual(p);
  for (int i = 0; i < kMostIterations && r.norm() > kTolerance_newton; ++i) {
    Eigen::Matrix3d fall;  // −∂r/∂p
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d beside = p + kDifference_m * Eigen::Vector3d::Unit(axis);
      fall.col(axis) = (r - residual(beside)) / kDifference_m;
    }
    Eigen::Vector3d moved = r / slope;
    if (std::abs(fall.determinant()) > 1e-3 * slope * slope * slope) moved = fall.inverse() * r;
    bool has_improved = false;
    for (int k = 0; k < kMostHalvings && !has_improved; ++k) {
      const Eigen::Vector3d next = residual(p + moved);
      has_improved = next.norm() < r.norm();
      if (has_improved) {
        p += moved;
        r = next;
      }
      moved *= 0.5;
    }
    if (!has_improved) break;
  }
  return p;
}

}  // namespace palpate
