// SPDX-License-Identifier: Apache-2.0
// held_torque.h — what motors with held currents do while the arm turns: between two messages the
// torques stay, and with them not the force.
#pragma once

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <limits>
#include <optional>
#include <vector>

#include "common/core/vector.h"
#include "device_node/device.h"

namespace palpate::device {

/// DeviceSpecification::held_force_ratio, from 5 × 5 × 5 places of the workspace: torques τ = J_pᵀ
/// F, commanded at p, make J_q⁻ᵀ τ at q, at most ‖J_q⁻ᵀ J_pᵀ‖ |F|.
/// @param jacobian_at  of a place of D: std::optional<Matrix3>, ∂position/∂angles; nothing at a
///                     singular place, nor where the arm cannot be, which such places border on
/// @return             ≥ 1; infinite where the workspace has such a place
template <class JacobianAt>
double held_force_ratio(const Vector3& workspace_half_extent_m, const JacobianAt& jacobian_at) {
  constexpr int kPlaces = 5;
  constexpr double kBetween = 1.02;  // places between those looked at
  std::vector<Matrix3> commanded;    // J_pᵀ
  std::vector<Matrix3> elsewhere;    // J_q⁻ᵀ
  for (int i = 0; i < kPlaces * kPlaces * kPlaces; ++i) {
    const Eigen::Vector3i place(i % kPlaces, i / kPlaces % kPlaces, i / (kPlaces * kPlaces));
    const Vector3 share = place.cast<double>() / (0.5 * (kPlaces - 1)) - Vector3::Ones();
    const std::optional<Matrix3> jacobian =
        jacobian_at(Vector3(share.cwiseProduct(workspace_half_extent_m)));
    if (!jacobian) return std::numeric_limits<double>::infinity();
    commanded.emplace_back(jacobian->transpose());
    elsewhere.emplace_back(commanded.back().inverse());
  }
  double most = 1.0;
  for (const Matrix3& torque_by_force : commanded) {
    for (const Matrix3& force_by_torque : elsewhere) {
      const Matrix3 ratio = force_by_torque * torque_by_force;
      most = std::max(most, Eigen::JacobiSVD<Matrix3>(ratio).singularValues()[0]);
    }
  }
  return kBetween * most;
}

/// The same of a driver whose settings say where its arm is mounted.
/// @param jacobian_at  as above, of a place in the frame of the arm
template <class Config, class JacobianAt>
double held_force_ratio_of(const Config& config, const JacobianAt& jacobian_at) {
  return held_force_ratio(config.workspace_half_extent_m, [&](const Vector3& position_m) {
    return jacobian_at(Vector3(config.rotation.conjugate() * position_m + config.origin_m));
  });
}

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
