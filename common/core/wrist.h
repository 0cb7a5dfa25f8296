// SPDX-License-Identifier: Apache-2.0
// wrist.h — the handle of a device that turns: three joints whose axes meet in the tip. Values of
// its joints are Vector3, one component per joint. Angles are continuous, without jumps by turns.
#pragma once

#include "common/core/vector.h"

namespace palpate {

/// One reading. A torque T about the tip asks the joints for axesᵀ T [N·m]; what the joints turn by
/// turns the tool by axes · dθ.
struct WristPose {
  Vector3 angle_rad = Vector3::Zero();
  Matrix3 axes = Matrix3::Identity();  ///< columns: unit, D, as they stand at these angles
};

/// The same with what the motors of the joints do at the time of the reading.
struct WristState {
  WristPose pose{};
  Vector3 acting_torque_newton_m = Vector3::Zero();  ///< on the hand, per joint
};

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
/// Its orientation, D from T.
[[nodiscard]] inline Quaternion orientation_of_wrist(const Vector3& angle_rad) noexcept {
  return Quaternion(Eigen::AngleAxisd(angle_rad.x(), Vector3::UnitX())) *
         Quaternion(Eigen::AngleAxisd(angle_rad.y(), Vector3::UnitY())) *
         Quaternion(Eigen::AngleAxisd(angle_rad.z(), Vector3::UnitZ()));
}

/// Each joint's torque at most that of `most_newton_m`, ≥ 0.
[[nodiscard]] inline Vector3 limited_per_joint(const Vector3& torque_newton_m,
                                               const Vector3& most_newton_m) noexcept {
  return torque_newton_m.cwiseMin(most_newton_m).cwiseMax(-most_newton_m);
}

}  // namespace palpate
