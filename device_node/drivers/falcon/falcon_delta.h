// SPDX-License-Identifier: Apache-2.0
// falcon_delta.h — the Falcon's kinematics: three legs of an arm and a parallelogram each, as R. E.
// Stamper, "A Three Degree of Freedom Parallel Manipulator with Only Translational Degrees of
// Freedom", PhD thesis 97-4, University of Maryland, 1997. Dimensions as libnifalcon measured them.
#pragma once

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "common/core/vector.h"

namespace palpate::device {

/// Frame: x to the right, y up, z towards the person [m]; angles of the arms [rad].
class FalconDelta {
 public:
  /// 320 slots of an encoder wheel, four edges each, on a shaft that turns the arm by a cable
  /// [rad].
  static constexpr double kCount_rad = 2.0 * std::numbers::pi / (4.0 * 320.0) * (0.01425 / 0.110);

  /// Angles of the arms; nothing out of reach.
  [[nodiscard]] static std::optional<Vector3> angles_rad(const Vector3& grip_m) noexcept {
    Vector3 angles;
    for (int leg = 0; leg < 3; ++leg) {
      const Vector3 p = in_leg(leg, grip_m);
      const std::optional<double> shin_m = shin(p.y());
      if (!shin_m) return {};
      // the triangle of arm and shin in the plane of the leg
      const double u = p.x() + kC_m;
      const double reach = std::hypot(u, p.z());
      const double cosine =
          (kA_m * kA_m + reach * reach - *shin_m * *shin_m) / (2.0 * kA_m * reach);
      if (!(std::abs(cosine) <= 1.0)) return {};
      angles[leg] = std::atan2(p.z(), u) - std::acos(cosine);
    }
    return angles;
  }

  /// Where the grip is, by Newton's method.
  /// @param guess_m  near it, such as the position of a millisecond ago
  /// @return  nothing where the legs do not meet
  [[nodiscard]] static std::optional<Vector3> grip_m(const Vector3& angles_rad,
                                                     const Vector3& guess_m) noexcept {
    Vector3 grip = guess_m;
    for (int i = 0; i < kNewtonSteps; ++i) {
      const std::optional<Legs> legs = at(grip, angles_rad);
      if (!legs) return {};
      const Matrix3 inverse = legs->by_grip.inverse();
      const Vector3 step = -inverse * legs->gap;
      if (!step.allFinite()) return {};
      grip += step;
      if (step.norm() < 1e-12) return grip;
    }
    return {};
  }

  /// ∂grip/∂angles [m/rad]; nothing out of reach or at a singular place.
  [[nodiscard]] static std::optional<Matrix3> jacobian(const Vector3& grip_m,
                                                       const Vector3& angles_rad) noexcept {
    const std::optional<Legs> legs = at(grip_m, angles_rad);
    if (!legs || legs->by_angle.cwiseAbs().minCoeff() < 1e-6) return {};
    const Matrix3 inverse = legs->by_grip.inverse();
    if (!inverse.allFinite() || inverse.cwiseAbs().maxCoeff() > 1e4) return {};
    return Matrix3(-inverse * legs->by_angle.asDiagonal());
  }

  /// A place in the middle of the workspace.
  [[nodiscard]] static Vector3 middle_m() noexcept { return {0.0, 0.0, 0.12}; }

 private:
  static constexpr double kA_m = 0.060;     // arm
  static constexpr double kB_m = 0.1025;    // long side of the parallelogram
  static constexpr double kC_m = 0.01443;   // from the shin to the middle of the grip, along u
  static constexpr double kD_m = 0.01125;   // from the parallelogram to the grip
  static constexpr double kE_m = 0.01125;   // from the arm to the parallelogram
  static constexpr double kF_m = -0.025;    // from the shin to the middle of the grip, along v
  static constexpr double kR_m = 0.0400;    // base of a leg, along u
  static constexpr double kS_m = -0.02309;  // base of a leg, along v
  static constexpr int kNewtonSteps = 20;

  /// Of each leg: |grip − arm|² − shin², zero where it meets, and its derivatives.
  struct Legs {
    Vector3 gap;
    Matrix3 by_grip;
    Vector3 by_angle;
  };

  /// Turns leg 0, 1 or 2 to the desk.
  [[nodiscard]] static double leg_angle(int leg) noexcept {
    constexpr double kPi = std::numbers::pi;
    constexpr std::array<double, 3> kAngles{kPi / 2, -kPi / 6, -5 * kPi / 6};
    return kAngles[static_cast<std::size_t>(leg)] + kPi / 12;
  }
  /// From the base of the leg, in its frame u, v, w.
  [[nodiscard]] static Vector3 in_leg(int leg, const Vector3& grip_m) noexcept {
    const double c = std::cos(leg_angle(leg));
    const double s = std::sin(leg_angle(leg));
    return {c * grip_m.x() + s * grip_m.y() - kR_m, -s * grip_m.x() + c * grip_m.y() - kS_m,
            grip_m.z()};
  }
  /// Length of the shin in the plane of the leg [m].
  [[nodiscard]] static std::optional<double> shin(double v_m) noexcept {
    const double q = (v_m + kF_m) / kB_m;
    if (!(std::abs(q) < 0.999)) return {};
    return kD_m + kE_m + kB_m * std::sqrt(1.0 - q * q);
  }
  [[nodiscard]] static std::optional<Legs> at(const Vector3& grip_m,
                                              const Vector3& angles_rad) noexcept {
    Legs legs;
    for (int leg = 0; leg < 3; ++leg) {
      const Vector3 p = in_leg(leg, grip_m);
      const std::optional<double> shin_m = shin(p.y());
      if (!shin_m) return {};
      const double c = kA_m * std::cos(angles_rad[leg]);
      const double s = kA_m * std::sin(angles_rad[leg]);
      const double u = p.x() + kC_m - c;
      const double w = p.z() - s;
      const double q = (p.y() + kF_m) / kB_m;
      const double shin_by_v = -q / std::sqrt(1.0 - q * q);
      legs.gap[leg] = u * u + w * w - *shin_m * *shin_m;
      legs.by_angle[leg] = 2.0 * (u * s - w * c);
      const Vector3 by_leg(2.0 * u, -2.0 * *shin_m * shin_by_v, 2.0 * w);
      const double cl = std::cos(leg_angle(leg));
      const double sl = std::sin(leg_angle(leg));
      legs.by_grip.row(leg) << cl * by_leg.x() - sl * by_leg.y(), sl * by_leg.x() + cl * by_leg.y(),
          by_leg.z();
    }
    return legs;
  }
};

}  // namespace palpate::device
