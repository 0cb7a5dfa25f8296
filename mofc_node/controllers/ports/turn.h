// SPDX-License-Identifier: Apache-2.0
/// @file
/// turn.h — how far a body turned between two orientations, for a port of torque about fixed axes.
#pragma once

#include <Eigen/Geometry>

namespace palpate::controllers {

/// Half the axial part of R − Rᵀ, R the rotation from `before` to `after`: its axis times the sine
/// of its angle, about axes that stand still. There are no Euler angles in it, hence no singular
/// pose; the sign and length of the quaternions do not matter. A quaternion of length 0 gives NaN.
///
/// A torque τ that stands still works τ·∫ω dt, which no function of the two orientations gives: the
/// body may turn about several axes in between. Along a way of angle φ the two differ by at most
/// φ²/2 (turn_doubt_rad). Lemma: finite_rotation. No allocation, no throw.
/// @return rad, per axis
[[nodiscard]] inline Eigen::Vector3d turned_rad(const Eigen::Quaterniond& before,
                                                const Eigen::Quaterniond& after) noexcept {
  const Eigen::Quaterniond turn = after.normalized() * before.normalized().conjugate();
  return 2.0 * turn.w() * turn.vec();
}

/// The most by which turned_rad() misses ∫ω dt less the errors of the two orientations, which a
/// ledger of resolution q counts by itself: (φ + 2ε)²/2 with φ the longest way and ε the error of
/// an orientation.
/// @param omega_max_rad_per_s  no faster, about whatever axis   @param duration_s  ≥ 0
/// @param resolution_rad  q ≥ 0: each orientation is the true one, turned by at most q/2 about each
/// axis
[[nodiscard]] inline double turn_doubt_rad(double omega_max_rad_per_s, double duration_s,
                                           double resolution_rad) noexcept {
  constexpr double kSqrt3 = 1.7320508075688773;
  const double way = omega_max_rad_per_s * duration_s + kSqrt3 * resolution_rad;
  return 0.5 * way * way;
}

}  // namespace palpate::controllers
