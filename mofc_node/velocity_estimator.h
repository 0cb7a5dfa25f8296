// SPDX-License-Identifier: Apache-2.0
// velocity_estimator.h — the tool's velocity from its quantised positions, and its position within
// the count. For the tissue's force only: the energy ledger never sees them.
//
// Every estimator trades three properties against one another: bias (error on a steady motion),
// noise (one count q of the encoder in one period T is q/T: 55 mm/s, 8 N at 150 N·s/m) and lag (a
// damper b on a mass m decays in m/b; an estimate with a longer lag makes it ring). Below, q:
// resolution, T: period, W: window, A: bound of the acceleration. build/release/bin/velocity_bench
// measures all of them.
//
// All are exact on a uniform motion without quantisation (resolution 0), accept irregular stamps (a
// sample that is not later than the last one is ignored and the estimate stays), and return zero
// for the first sample after construction or reset(). After a gap they continue: see each.
//
// The default is the Kalman filter with the motors' force as its known input and a model of the
// hand. Without that input, no filter smooth enough for the ledger follows a damper that decays in
// 2 ms (150 N·s/m on 0.3 kg). Figures: docs/benchmarks.md.
// Thread: the caller's. No allocation after construction, no lock, no throw.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <memory>

#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/session/mofc_config.h"

namespace palpate::mofc {

class VelocityEstimator {
 public:
  virtual ~VelocityEstimator() = default;

  virtual void reset() noexcept = 0;

  /// Adds the position measured at `t`; returns the velocity there.
  /// @param mean_force_newton  force of the motors on the hand since the last sample, time average
  virtual Vector3 update(const Vector3& position_m, TimePoint t,
                         const Vector3& mean_force_newton) noexcept = 0;

  /// The position at the last update, which measured `measured_m`: within ±q/2 of that.
  [[nodiscard]] virtual Vector3 position_m(const Vector3& measured_m) const noexcept {
    return measured_m;
  }
};

/// @param resolution_m  q of the positions that will be given, per axis; 0: exact
/// @param scale_ratio   displacement in those positions per displacement of the hand
/// @param coulomb_newton  friction of the device that acts for sure, f_co
[[nodiscard]] std::unique_ptr<VelocityEstimator> make_velocity_estimator(
    const VelocityEstimatorConfig& config, double resolution_m, double scale_ratio,
    double coulomb_newton = 0.0);

/// First-order low-pass of time constant τ; 0: passes on.
class LowPass {
 public:
  explicit LowPass(Duration time_constant) : time_constant_s_(to_seconds(time_constant)) {}

  void reset() noexcept { value_.setZero(); }
  Vector3 update(const Vector3& input, double dt_s) noexcept;
  [[nodiscard]] const Vector3& value() const noexcept { return value_; }

 private:
  double time_constant_s_;
  Vector3 value_ = Vector3::Zero();
};

/// (x_k − x_{k−1}) / T, then a low-pass of time constant τ; τ = 0: the backward difference alone.
///
///   bias   none
///   noise  up to q/T; the low-pass divides it by about √(2τ/T) while counts come often, and leaves
///          pulses of q/τ while they come less often than every τ
///   lag    T/2 + τ
///   gap    the mean velocity over it
class DifferenceEstimator final : public VelocityEstimator {
 public:
  explicit DifferenceEstimator(Duration time_constant) : low_pass_(time_constant) {}

  void reset() noexcept override;
  Vector3 update(const Vector3& position_m, TimePoint t,
                 const Vector3& mean_force_newton) noexcept override;

 private:
  LowPass low_pass_;
  bool has_sample_ = false;
  Vector3 last_position_m_ = Vector3::Zero();
  TimePoint last_time_{};
};

/// First-order adaptive windowing, [FOAW]: per axis the slope over the longest window whose end
/// points' line passes within q of every sample between them, at most `max_window` long.
///
///   bias   none: a uniform motion fills the window
///   error  end fit: at most q/W + A·W/2 for encoder errors within ±q/2, W the window in use;
///          best fit (regular stamps): at most 1.5 q/W + 0.57 A·W, and less noise on average
///   lag    W/2: long when slow, short when the motion bends
///   rest   zero from `max_window` after the last count on
///   gap    longer than the window: the mean velocity over it
///
/// Differs from [FOAW]: the window of the best fit is found with the end fit's line, so that a step
/// costs O(samples in the window); a `time_constant` > 0 smoothes the steps between windows, adds
/// its lag, and voids the bounds above.
class AdaptiveWindowEstimator final : public VelocityEstimator {
 public:
  /// Longest window in samples: 32 ms at 4 kHz.
  static constexpr std::size_t kMaxSamples = 129;

  AdaptiveWindowEstimator(const AdaptiveWindowVelocity& config, double resolution_m);

  void reset() noexcept override;
  Vector3 update(const Vector3& position_m, TimePoint t,
                 const Vector3& mean_force_newton) noexcept override;

  /// W of the last estimate, per axis; 0 before the second sample.
  [[nodiscard]] const Vector3& window_s() const noexcept { return window_s_; }

 private:
  struct Sample {
    Vector3 position_m = Vector3::Zero();
    TimePoint time{};
  };
  /// The sample `back` before the newest; back < count_.
  [[nodiscard]] const Sample& sample(std::size_t back) const noexcept {
    return samples_[(newest_ + kMaxSamples - back) % kMaxSamples];
  }
  [[nodiscard]] std::size_t longest_window(int axis, std::size_t allowed) const noexcept;
  [[nodiscard]] double best_fit_slope(int axis, std::size_t window) const noexcept;

  AdaptiveWindowVelocity config_;
  double resolution_m_;
  LowPass low_pass_;
  std::array<Sample, kMaxSamples> samples_{};
  std::array<double, kMaxSamples> age_s_{};  // age of each sample relative to the newest
  std::size_t newest_ = 0;
  std::size_t count_ = 0;
  Vector3 window_s_ = Vector3::Zero();
};

/// Kalman filter on a model of hand and device, each axis alone:
///
///   x′ = v      v′ = a + F/m − f_co v̂/m       F  force of the motors, m  moving mass
///   a′ = κ (u − v) + β (u′ − v′) + jerk       a  acceleration by the hand
///   u′ = w                                    u  velocity that the hand intends
///
/// a is that of a spring and a damper towards where the hand wants to be, κ = K/m, β = B/m. jerk
/// and w are white noise of density S (m²/s⁵) and S_u (m²/s³). K = B = 0: constant acceleration.
/// Model kConstantVelocity: a = 0 and v′ has white noise of density S (m²/s³). What the filter has
/// to learn from the encoder is only what the model does not know, which changes slowly: hence the
/// motors' force, which changes within a tick at a contact, and the hand's answer to it.
///
/// A reading says that x lies within ±q/2 of it: the estimate takes mean and variance of its normal
/// distribution, truncated to that interval [Curry70]. Two rules for what a count really tells:
///
///   a new count   x has just crossed the edge: only the part of the count that the hand can have
///                 reached since the last reading is left; far less than q in slow motion. Where
///                 readings do not change by whole counts (a device with joints) all of it.
///   the same one  tells nothing new, unless the filter expected to have left it. Counted as news
///   in
///                 every tick it would make a filter too sure of the count's centre.
///
///   bias     none
///   error    1 kHz, q = 0.055 mm: velocity_bench
///   surprise a reading more than 2.5 standard deviations off enlarges the covariance, most that of
///   v rest     a hand that stops crosses no edge; after time t |v| is at most about q/t gap up to
///   0.25 s the model runs on; then it begins anew
class KalmanEstimator final : public VelocityEstimator {
 public:
  /// @param resolution_m    > 0, else 1 nm is taken
  /// @param scale_ratio     displacement in the positions per displacement of the hand
  /// @param coulomb_newton  ≥ 0, f_co
  KalmanEstimator(const KalmanVelocity& config, double resolution_m, double scale_ratio,
                  double coulomb_newton);

  void reset() noexcept override { has_sample_ = false; }
  Vector3 update(const Vector3& position_m, TimePoint t,
                 const Vector3& mean_force_newton) noexcept override;
  [[nodiscard]] Vector3 position_m(const Vector3& measured_m) const noexcept override;

 private:
  using State = Eigen::Vector4d;  // x, v, a, u
  using Square = Eigen::Matrix4d;
  struct Axis {
    State state = State::Zero();
    Square covariance = Square::Zero();
    double measured_m = 0.0;
  };

  void begin(const Vector3& position_m) noexcept;
  /// Makes transition, noise and input those of a step of `h` seconds.
  void use_step(double h) noexcept;
  void correct(Axis& axis, double measured_m, double since_s) const noexcept;
  /// Position or velocity of the axes.
  [[nodiscard]] Vector3 state(int derivative) const noexcept;

  double half_count_m_;
  double acceleration_per_newton_ = 0.0;
  double friction_m_per_s2_ = 0.0;
  Square rate_ = Square::Zero();      // of the state, without noise
  State input_rate_ = State::Zero();  // per m/s² of known acceleration
  Square density_ = Square::Zero();   // of the white noise
  Square first_covariance_ = Square::Zero();

  double step_s_ = 0.0;  // of the next three
  Square transition_ = Square::Identity();
  Square noise_ = Square::Zero();
  State input_ = State::Zero();

  bool has_sample_ = false;
  TimePoint last_time_{};
  Vector3 previous_force_newton_ = Vector3::Zero();
  std::array<Axis, 3> axes_{};
};

}  // namespace palpate::mofc
