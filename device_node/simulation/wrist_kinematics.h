// SPDX-License-Identifier: Apache-2.0
// wrist_kinematics.h — the wrist of the simulated device.
#pragma once

#include "common/core/vector.h"

namespace palpate::device {

/// A serial wrist: at angles of 0 its joints turn about x, y and z of D, in this order from the
/// base.
[[nodiscard]] inline Matrix3 axes_of_wrist(const Vector3& angle_rad) noexcept {
  const Eigen::AngleAxisd first(angle_rad.x(), Vector3::UnitX());
  const Eigen::AngleAxisd second(angle_rad.y(), Vector3::UnitY());
  Matrix3 axes;
  axes.col(0) = Vector3::UnitX();
  axes.col(1) = first * Vector3::UnitY();
  axes.col(2) = first * (second * Vector3::UnitZ());
  return axes;
}
/// How it turns the tool, D.
[[nodiscard]] inline Vector3 angular_velocity_of_wrist(const Vector3& angle_rad,
                                                       const Vector3& joints_rad_per_s) noexcept {
  if (joints_rad_per_s.isZero(0.0)) return Vector3::Zero();  // nearly always there is none
  return axes_of_wrist(angle_rad) * joints_rad_per_s;
}
/// Its orientation, D from T.
[[nodiscard]] inline Quaternion orientation_of_wrist(const Vector3& angle_rad) noexcept {
  return Quaternion(Eigen::AngleAxisd(angle_rad.x(), Vector3::UnitX())) *
         Quaternion(Eigen::AngleAxisd(angle_rad.y(), Vector3::UnitY())) *
         Quaternion(Eigen::AngleAxisd(angle_rad.z(), Vector3::UnitZ()));
}

}  // namespace palpate::device
