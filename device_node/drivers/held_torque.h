// SPDX-License-Identifier: Apache-2.0
// held_torque.h — what motors with held currents do while the arm turns: between two messages the
// torques stay, and with them not the force.
#pragma once

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "common/core/vector.h"
#include "device_node/device.h"

namespace palpate::device {

/// What the force of held currents can become as the arm turns.
struct HeldForce {
  double ratio = std::numeric_limits<double>::infinity();  ///< held_force_ratio
  double turning_per_m = std::numeric_limits<double>::infinity();
  Vector3 step_m =
      Vector3::Zero();  ///< Σ |J_ij| of a step of each encoder, the largest on each axis
};

/// Torques τ = J_pᵀ F, commanded at p, make J_q⁻ᵀ τ at q, at most ‖J_q⁻ᵀ J_pᵀ‖ |F|. From all pairs
/// of 5 × 5 × 5 places of the workspace and of the two where J and J⁻¹ are largest, which are
/// climbed to from the best of 21 × 21 × 21, and from there to the worst pair; the change per
/// metre, from steps of 10 µm, likewise.
/// @param jacobian_at  of a place of D: std::optional<Matrix3>, ∂position/∂angles; nothing at a
///                     singular place, nor where the arm cannot be, which such places border on
/// @param count_rad    a step of each encoder
/// @return             a ratio ≥ 1; both infinite where the workspace has such a place, or det J
///                     another sign
template <class JacobianAt>
HeldForce held_force(const Vector3& workspace_half_extent_m, const Vector3& count_rad,
                     const JacobianAt& jacobian_at) {
  constexpr double kBetween = 1.02;  // places between those looked at
  constexpr int kPairs = 5;
  constexpr int kPlaces = 21;
  constexpr double kStep_m = 1e-5;
  const auto place_m = [&](const Vector3& share) {
    return Vector3(share.cwiseProduct(workspace_half_extent_m));
  };
  /// Calls with each place of a grid, −1 … 1 on each axis, until one returns false.
  const auto each = [](int count, const auto& call) {
    for (int i = 0; i < count * count * count; ++i) {
      const Eigen::Vector3i place(i % count, i / count % count, i / (count * count));
      if (!call(Vector3(place.cast<double>() / (0.5 * (count - 1)) - Vector3::Ones())))
        return false;
    }
    return true;
  };

  struct Most {
    double (*of)(const Matrix3& jacobian);
    double value = -1.0;
    Vector3 share = Vector3::Zero();
  };
  std::array<Most, 2> largest{Most{[](const Matrix3& j) { return j.norm(); }},
                              Most{[](const Matrix3& j) { return j.inverse().norm(); }}};
  double sign = 0.0;
  Vector3 step_m = Vector3::Zero();
  /// False: a singular place, or one beyond.
  const auto look = [&](const Vector3& share, Most& most) {
    const std::optional<Matrix3> jacobian = jacobian_at(place_m(share));
    const double determinant = jacobian ? jacobian->determinant() : 0.0;
    if (sign == 0.0) sign = determinant;
    if (!(determinant * sign > 0.0)) return false;
    step_m = step_m.cwiseMax(jacobian->cwiseAbs() * count_rad);
    if (const double value = most.of(*jacobian); value > most.value) {
      most.value = value;
      most.share = share;
    }
    return true;
  };
  const auto look_at_both = [&](const Vector3& share) {
    return look(share, largest[0]) && look(share, largest[1]);
  };
  if (!each(kPlaces, look_at_both)) return {};
  for (Most& most : largest) {
    for (double step = 2.0 / (kPlaces - 1); step > 1e-4;) {
      const Vector3 from = most.share;
      for (int way = 0; way < 6; ++way) {
        Vector3 share = from;
        share[way / 2] = std::clamp(share[way / 2] + (way % 2 == 0 ? step : -step), -1.0, 1.0);
        if (!look(share, most)) return {};
      }
      if (most.share == from) step *= 0.5;
    }
  }

  HeldForce held{.ratio = 1.0, .turning_per_m = 0.0, .step_m = step_m};
  /// From there along the coordinates to a place, or a pair of places, where it is largest.
  const auto climbed = [](auto at, const auto& of) {
    double value = of(at);
    for (double step = 1.0 / (kPairs - 1); step > 1e-3;) {
      const auto from = at;
      const double before = value;
      for (std::size_t way = 0; way < 2 * from.size(); ++way) {
        auto beside = from;
        beside[way / 2] = std::clamp(from[way / 2] + (way % 2 == 0 ? step : -step), -1.0, 1.0);
        const double other = of(beside);
        if (other <= (1.0 + 1e-9) * value) continue;
        value = other;
        at = beside;
      }
      if (value == before) step *= 0.5;
    }
    return kBetween * value;
  };
  const auto turning_at = [&](const std::array<double, 3>& share) {
    const Vector3 at_m = place_m(Vector3(share[0], share[1], share[2]));
    const std::optional<Matrix3> here = jacobian_at(at_m);
    if (!here) return std::numeric_limits<double>::infinity();
    const Matrix3 torque_by_force = here->transpose();
    double turning2 = 0.0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double inward_m = share[axis] > 0.0 ? -kStep_m : kStep_m;
      const std::optional<Matrix3> beside =
          jacobian_at(Vector3(at_m + inward_m * Vector3::Unit(static_cast<Eigen::Index>(axis))));
      if (!beside) continue;
      const Matrix3 turned = beside->transpose().inverse() * torque_by_force - Matrix3::Identity();
      turning2 += turned.squaredNorm() / (kStep_m * kStep_m);
    }
    return std::sqrt(turning2);
  };
  const auto ratio_of = [](const Matrix3& force_by_torque, const Matrix3& torque_by_force) {
    return Eigen::JacobiSVD<Matrix3>(Matrix3(force_by_torque * torque_by_force))
        .singularValues()[0];
  };
  /// Commanded at the first place, at the second one.
  const auto ratio_at = [&](const std::array<double, 6>& share) {
    const auto here = jacobian_at(place_m(Vector3(share[0], share[1], share[2])));
    const auto there = jacobian_at(place_m(Vector3(share[3], share[4], share[5])));
    if (!here || !there) return std::numeric_limits<double>::infinity();
    return ratio_of(there->transpose().inverse(), here->transpose());
  };
  struct Place {
    std::array<double, 3> share;
    Matrix3 torque_by_force;
    Matrix3 force_by_torque;
  };
  std::vector<Place> places;
  std::array<double, 3> turning_most{};
  double turning = -1.0;
  const auto take = [&](const Vector3& share) {
    const Matrix3 torque_by_force = jacobian_at(place_m(share))->transpose();
    places.push_back(
        {{share.x(), share.y(), share.z()}, torque_by_force, torque_by_force.inverse()});
    if (const double here = turning_at(places.back().share); here > turning) {
      turning = here;
      turning_most = places.back().share;
    }
    return true;
  };
  each(kPairs, take);
  for (const Most& most : largest) take(most.share);
  std::array<double, 6> worst_pair{};
  double ratio = 0.0;
  for (const Place& a : places) {
    for (const Place& b : places) {
      const double other = ratio_of(b.force_by_torque, a.torque_by_force);
      if (other <= ratio) continue;
      ratio = other;
      worst_pair = {a.share[0], a.share[1], a.share[2], b.share[0], b.share[1], b.share[2]};
    }
  }
  held.turning_per_m = climbed(turning_most, turning_at);
  held.ratio = std::max(1.0, climbed(worst_pair, ratio_at));
  return held;
}

/// A Jacobian of the frame of the arm, in D.
template <class Config>
std::optional<Matrix3> mounted(const Config& config, const std::optional<Matrix3>& jacobian) {
  if (!jacobian) return {};
  return Matrix3(config.rotation.toRotationMatrix() * *jacobian);
}

/// The same of a driver whose settings say where its arm is mounted, into its specification. Its
/// resolution is no finer than the steps of the encoders.
/// @param count_rad    a step of each encoder
/// @param jacobian_at  as above, of a place in the frame of the arm
template <class Config, class JacobianAt>
void bound_held_force(DeviceSpecification& specification, const Config& config,
                      const Vector3& count_rad, const JacobianAt& jacobian_at) {
  const HeldForce held =
      held_force(config.workspace_half_extent_m, count_rad, [&](const Vector3& position_m) {
        return mounted(config, jacobian_at(Vector3(config.rotation.conjugate() * position_m +
                                                   config.origin_m)));
      });
  specification.held_force_ratio = held.ratio;
  specification.turning_per_m = held.turning_per_m;
  specification.position_resolution_m =
      std::max(specification.position_resolution_m, held.step_m.maxCoeff());
}

/// The work of torques τ over joint angles is τ·Δθ, exactly; the energy is counted with F·Δx, F as
/// it was reported. The difference goes into DeviceSample::turning_joule. A message that replaces
/// them changes the force where the arm is then by J⁻ᵀ Δτ: what of ΔF it is not, into
/// turned_newton.
class HeldTorque {
 public:
  /// After each answer.
  /// @param torque_newton_m  held from now on
  /// @param angles_rad       of the answer
  /// @param jacobian         J there, ∂position/∂angles, D; nothing at a singular place
  /// @param sample           its position and the force reported; receives turning_joule and
  ///                         turned_newton
  void answered(const Vector3& torque_newton_m, const Vector3& angles_rad,
                const std::optional<Matrix3>& jacobian, DeviceSample& sample) noexcept {
    if (is_known_) {
      sample.turning_joule = torque_newton_m_.dot(angles_rad - angles_rad_) -
                             force_newton_.dot(sample.hand_position_m - position_m_);
      if (jacobian) {
        const Matrix3 newton_by_torque = jacobian->inverse().transpose();
        sample.turned_newton = sample.applied_force_newton - force_newton_ -
                               newton_by_torque * (torque_newton_m - torque_newton_m_);
      }
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
