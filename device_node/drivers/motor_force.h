// SPDX-License-Identifier: Apache-2.0
// motor_force.h — the force that a driver's motors may do now: within peak and continuous force,
// for no longer than its lease, and in the motors' whole numbers.
#pragma once

#include <algorithm>
#include <cmath>

#include "common/core/time.h"
#include "common/session/driver_config.h"

namespace palpate::device {

/// Saturates, never cuts to zero. The continuous force is kept by a first-order model of the heat h
/// of the windings, τ ḣ = (F/F_continuous)² − h: h = 1 is what the continuous force leads to, and a
/// force is limited so that h stays ≤ 1 as long as the force may act.
class MotorForce {
 public:
  explicit MotorForce(const MotorLimits& limits) : limits_(limits) {}

  /// The force from now on, limited.
  /// @param lease  ≤ 0: none
  const Vector3& set(const Vector3& requested_newton, Duration lease, TimePoint now) noexcept {
    pass_until(now);
    allowed_newton_ = lease > Duration::zero() ? limit_newton(lease) : 0.0;
    force_newton_ = limited_to_norm(requested_newton, allowed_newton_);
    lease_end_ = now + std::max(lease, Duration::zero());
    return force_newton_;
  }
  /// The force that acts now: none after its lease.
  const Vector3& at(TimePoint now) noexcept {
    pass_until(now);
    if (now >= lease_end_) force_newton_.setZero();
    return force_newton_;
  }

  /// The limit of the last set() [N]: rounding must not exceed it.
  [[nodiscard]] double allowed_newton() const noexcept { return allowed_newton_; }
  /// The largest |F| that may act for `time` from now on [N]; never below the continuous force.
  [[nodiscard]] double limit_newton(Duration time) const noexcept {
    const double share = risen(time);
    const double square = share > 0.0 ? (1.0 - heat_) / share + heat_ : kAny;
    return std::min(limits_.peak_force_newton,
                    limits_.continuous_force_newton * std::sqrt(std::max(square, 1.0)));
  }
  /// 0: cold; 1: as warm as the continuous force makes the windings.
  [[nodiscard]] double heat() const noexcept { return heat_; }

 private:
  static constexpr double kAny = 1e12;

  void pass_until(TimePoint now) noexcept {
    const TimePoint end = std::min(now, lease_end_);
    heat(force_newton_.norm(), end - since_);
    heat(0.0, now - std::max(since_, end));
    since_ = now;
  }
  void heat(double force_newton, Duration time) noexcept {
    const double ratio = force_newton / limits_.continuous_force_newton;
    heat_ += (ratio * ratio - heat_) * risen(time);
  }
  /// 1 − e^(−t/τ)
  [[nodiscard]] double risen(Duration time) const noexcept {
    return -std::expm1(-std::max(to_seconds(time), 0.0) / limits_.thermal_time_s);
  }

  MotorLimits limits_;
  Vector3 force_newton_ = Vector3::Zero();
  double allowed_newton_ = 0.0;
  TimePoint since_{};
  TimePoint lease_end_{};
  double heat_ = 0.0;
};

/// Scales the counts of all motors together, so that none is above the largest.
inline void scale_counts(Vector3& counts, double largest) noexcept {
  const double most = counts.cwiseAbs().maxCoeff();
  if (most > largest) counts *= largest / most;
}

/// Rounds the counts of three motors to whole numbers: to the nearest, or, where these would make
/// more force than `limit_newton` or than the counts asked for, after scaling by so much that no
/// rounding can exceed it. What is asked for is covered, and what is more would not be.
/// @param newton_per_count  columns: the force of one count of each motor
/// @return                  the force of the rounded counts [N]
inline Vector3 round_counts(Vector3& counts, const Matrix3& newton_per_count,
                            double limit_newton) noexcept {
  const Vector3 wanted = counts;
  counts = wanted.array().round();
  Vector3 made_newton = newton_per_count * counts;
  const double wanted_newton = (newton_per_count * wanted).norm();
  constexpr double kExact = 1.0 + 1e-12;  // rounding of the two norms
  limit_newton = std::min(limit_newton, wanted_newton);
  if (made_newton.norm() <= kExact * limit_newton) return made_newton;
  const double rounding_newton = 0.5 * newton_per_count.colwise().norm().sum();
  const double scaled_newton = std::max(limit_newton - rounding_newton, 0.0);
  counts = (scaled_newton / wanted_newton * wanted).array().round();
  return newton_per_count * counts;
}

}  // namespace palpate::device
