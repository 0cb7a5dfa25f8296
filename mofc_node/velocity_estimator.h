// velocity_estimator.h — the tool's velocity from its measured positions.
#pragma once

#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate::mofc {

/// Backward difference over the last interval, then a first-order low-pass of time constant τ:
///   v ← v + (1 − exp(−Δt/τ)) (Δx/Δt − v)
/// τ = 0 leaves the backward difference: no lag but T/2, noise q/T per count. τ > 0 divides the
/// noise by about √(2τ/T) and lags by τ. For damping forces only; the ledger never sees it.
class VelocityEstimator {
 public:
  explicit VelocityEstimator(Duration time_constant)
      : time_constant_s_(to_seconds(time_constant)) {}

  void reset() noexcept { has_sample_ = false; }

  /// Takes the position measured at `t` and gives the estimate there; zero for the first sample.
  Vector3 update(const Vector3& position_m, TimePoint t) noexcept {
    const double dt_s = to_seconds(t - last_time_);
    if (!has_sample_) {
      velocity_m_per_s_.setZero();
    } else if (dt_s > 0.0) {
      const Vector3 difference = (position_m - last_position_m_) / dt_s;
      const double gain = time_constant_s_ > 0.0 ? 1.0 - std::exp(-dt_s / time_constant_s_) : 1.0;
      velocity_m_per_s_ += gain * (difference - velocity_m_per_s_);
    }
    has_sample_ = true;
    last_position_m_ = position_m;
    last_time_ = t;
    return velocity_m_per_s_;
  }

 private:
  double time_constant_s_;
  bool has_sample_ = false;
  Vector3 velocity_m_per_s_ = Vector3::Zero();
  Vector3 last_position_m_ = Vector3::Zero();
  TimePoint last_time_{};
};

}  // namespace palpate::mofc
