// SPDX-License-Identifier: Apache-2.0
// held_torque.h — what motors with held currents do while the arm turns: between two messages the
// torques stay, and with them not the force.
#pragma once

#include "common/core/vector.h"
#include "device_node/device.h"

namespace palpate::device {

/// The work of torques τ over joint angles is τ·Δθ, exactly; the energy is counted with F·Δx, F as
/// it was reported. The difference goes into DeviceSample::turning_joule.
class HeldTorque {
 public:
  /// After each answer.
  /// @param torque_newton_m  held from now on
  /// @param angles_rad       of the answer
  /// @param sample           its position and the force reported; receives turning_joule
  void answered(const Vector3& torque_newton_m, const Vector3& angles_rad,
                DeviceSample& sample) noexcept {
    if (is_known_) {
      sample.turning_joule = torque_newton_m_.dot(angles_rad - angles_rad_) -
                             force_newton_.dot(sample.hand_position_m - position_m_);
    }
    is_known_ = true;
    torque_newton_m_ = torque_newton_m;
    angles_rad_ = angles_rad;
    force_newton_ = sample.applied_force_newton;
    position_m_ = sample.hand_position_m;
  }
  /// The motors were released, or nobody knows what they hold.
  void forget() noexcept { is_known_ = false; }

 private:
  bool is_known_ = false;
  Vector3 torque_newton_m_ = Vector3::Zero();
  Vector3 angles_rad_ = Vector3::Zero();
  Vector3 force_newton_ = Vector3::Zero();
  Vector3 position_m_ = Vector3::Zero();
};

}  // namespace palpate::device
