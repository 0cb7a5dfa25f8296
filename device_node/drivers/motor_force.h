// motor_force.h — the force that a driver's motors may do now: within peak and continuous force,
// for no longer than its lease.
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
  const Vector3& set(const Vector3& asked_newton, Duration lease, TimePoint now) noexcept {
    pass_until(now);
    force_newton_ = lease > Duration::zero() ? limited_to_norm(asked_newton, limit_newton(lease))
                                             : Vector3(Vector3::Zero());
    lease_end_ = now + std::max(lease, Duration::zero());
    return force_newton_;
  }
  /// The force that acts now: none after its lease.
  const Vector3& at(TimePoint now) noexcept {
    pass_until(now);
    if (now >= lease_end_) force_newton_.setZero();
    return force_newton_;
  }

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
  TimePoint since_{};
  TimePoint lease_end_{};
  double heat_ = 0.0;
};

}  // namespace palpate::device
