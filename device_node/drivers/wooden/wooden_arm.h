// SPDX-License-Identifier: Apache-2.0
// wooden_arm.h — the kinematics of WoodenHaptics: body a turns about the upright axis, arms b and c
// about axes across it, each held at its own angle against the upright.
#pragma once

#include <Eigen/LU>
#include <cmath>
#include <optional>

#include "common/core/vector.h"

namespace palpate::device {

struct WoodenGeometry {
  double base_m = 0.08;  ///< height of the axis of b
  double arm_m = 0.205;  ///< length of b
  double rod_m = 0.245;  ///< length of c
};

/// Frame: x away from the base, z up, origin in the base [m]; angles a, b, c [rad]: b from the
/// upwards direction, c from the downwards one.
class WoodenArm {
 public:
  explicit WoodenArm(const WoodenGeometry& geometry) : g_(geometry) {}

  [[nodiscard]] Vector3 handle_m(const Vector3& angles_rad) const noexcept {
    const double reach = reach_m(angles_rad);
    return {std::cos(angles_rad[0]) * reach, std::sin(angles_rad[0]) * reach,
            g_.base_m + g_.arm_m * std::cos(angles_rad[1]) - g_.rod_m * std::cos(angles_rad[2])};
  }

  /// With the elbow upwards; nothing out of reach.
  [[nodiscard]] std::optional<Vector3> angles_rad(const Vector3& handle_m) const noexcept {
    const double reach = std::hypot(handle_m.x(), handle_m.y());
    const double up = handle_m.z() - g_.base_m;
    const double distance = std::hypot(reach, up);
    const double cosine = (g_.arm_m * g_.arm_m + distance * distance - g_.rod_m * g_.rod_m) /
                          (2.0 * g_.arm_m * distance);
    if (!(std::abs(cosine) <= 1.0)) return {};
    const double b = std::atan2(reach, up) - std::acos(cosine);
    const double c = std::atan2(reach - g_.arm_m * std::sin(b), g_.arm_m * std::cos(b) - up);
    return Vector3(std::atan2(handle_m.y(), handle_m.x()), b, c);
  }

  /// ∂handle/∂angles [m/rad]; nothing close to a singular place.
  [[nodiscard]] std::optional<Matrix3> jacobian(const Vector3& angles_rad) const noexcept {
    const double ca = std::cos(angles_rad[0]);
    const double sa = std::sin(angles_rad[0]);
    const double reach = reach_m(angles_rad);
    const double b_across = g_.arm_m * std::cos(angles_rad[1]);
    const double c_across = g_.rod_m * std::cos(angles_rad[2]);
    Matrix3 jacobian;
    jacobian << -sa * reach, ca * b_across, ca * c_across,  //
        ca * reach, sa * b_across, sa * c_across,           //
        0.0, -g_.arm_m * std::sin(angles_rad[1]), g_.rod_m * std::sin(angles_rad[2]);
    const double size = g_.arm_m * g_.rod_m * (g_.arm_m + g_.rod_m);
    if (!(std::abs(jacobian.determinant()) > 1e-3 * size)) return {};
    return jacobian;
  }

 private:
  [[nodiscard]] double reach_m(const Vector3& angles_rad) const noexcept {
    return g_.arm_m * std::sin(angles_rad[1]) + g_.rod_m * std::sin(angles_rad[2]);
  }

  WoodenGeometry g_;
};

}  // namespace palpate::device
