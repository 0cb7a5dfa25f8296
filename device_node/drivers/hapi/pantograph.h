// SPDX-License-Identifier: Apache-2.0
// pantograph.h — the planar five-bar linkage of the hAPI boards: two motors on a base line, an arm
// on each, two rods that meet at the handle.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>

namespace palpate::device {

using Vector2 = Eigen::Vector2d;
using Matrix2 = Eigen::Matrix2d;

struct PantographGeometry {
  double arm_m = 0.05;   ///< l, from a motor to its elbow
  double rod_m = 0.07;   ///< L, from an elbow to the handle
  double base_m = 0.02;  ///< d, between the motors
};

/// Motor 0 at (0, 0), motor 1 at (d, 0); angles counter-clockwise from +x [rad]; the handle on the
/// side of +y.
class Pantograph {
 public:
  explicit Pantograph(const PantographGeometry& geometry) : g_(geometry) {}

  /// Where the handle is [m]; nothing where the rods do not meet.
  [[nodiscard]] std::optional<Vector2> handle_m(const Vector2& angles_rad) const noexcept {
    const Vector2 left = elbow_m(0, angles_rad);
    const Vector2 right = elbow_m(1, angles_rad);
    const Vector2 half = (right - left) / 2.0;
    const double square = g_.rod_m * g_.rod_m - half.squaredNorm();
    if (!(square > 0.0) || !(half.squaredNorm() > 0.0)) return {};
    const Vector2 up = Vector2(-half.y(), half.x()).normalized();
    return left + half + std::sqrt(square) * up;
  }

  /// Angles of the motors with the elbows outwards; nothing out of reach.
  [[nodiscard]] std::optional<Vector2> angles_rad(const Vector2& handle_m) const noexcept {
    Vector2 angles;
    for (int i = 0; i < 2; ++i) {
      const Vector2 reach = handle_m - motor_m(i);
      const double r = reach.norm();
      const double cosine =
          (g_.arm_m * g_.arm_m + r * r - g_.rod_m * g_.rod_m) / (2.0 * g_.arm_m * r);
      if (!(std::abs(cosine) <= 1.0)) return {};
      const double open = std::acos(cosine);
      angles[i] = std::atan2(reach.y(), reach.x()) + (i == 0 ? open : -open);
    }
    return angles;
  }

  /// ∂handle/∂angles [m/rad]; nothing at a singular place. Each rod keeps its length, which gives
  /// one row each: (P − E_i)·(dP − dE_i) = 0.
  [[nodiscard]] std::optional<Matrix2> jacobian(const Vector2& angles_rad) const noexcept {
    const std::optional<Vector2> handle = handle_m(angles_rad);
    if (!handle) return {};
    Matrix2 rods;
    Matrix2 arms = Matrix2::Zero();
    for (int i = 0; i < 2; ++i) {
      const Vector2 rod = *handle - elbow_m(i, angles_rad);
      const double a = angles_rad[i];
      rods.row(i) = rod.transpose();
      arms(i, i) = rod.dot(g_.arm_m * Vector2(-std::sin(a), std::cos(a)));
      // sin of the angle between arm and rod
      if (std::abs(arms(i, i)) < kLeastSine * g_.arm_m * g_.rod_m) return {};
    }
    // sin of the angle between the rods
    if (std::abs(rods.determinant()) < kLeastSine * g_.rod_m * g_.rod_m) return {};
    return Matrix2(rods.inverse() * arms);
  }

 private:
  static constexpr double kLeastSine = 1e-3;

  [[nodiscard]] Vector2 motor_m(int i) const noexcept { return {i == 0 ? 0.0 : g_.base_m, 0.0}; }
  [[nodiscard]] Vector2 elbow_m(int i, const Vector2& angles_rad) const noexcept {
    return motor_m(i) + g_.arm_m * Vector2(std::cos(angles_rad[i]), std::sin(angles_rad[i]));
  }

  PantographGeometry g_;
};

}  // namespace palpate::device
