// SPDX-License-Identifier: Apache-2.0
#include "device_node/motor_check.h"

#include <Eigen/LU>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>

namespace palpate::device {
namespace {

using namespace std::complex_literals;

constexpr double kCycles = 4.0;    // of a block
constexpr double kBlock_s = 0.25;  // 16 Hz
constexpr std::size_t kLeastReadings = 24;
constexpr int kLeastBlocks = 4;
constexpr int kMostBlocks = 20;
constexpr double kHasMotor = 0.7;  // of a unit force: else the axes beside it have it
constexpr Duration kLongestGap = std::chrono::milliseconds(4);  // beyond a period
constexpr int kMostInterruptions = 100;                         // of a check
constexpr double kSignificant = 5.0;                            // standard errors
constexpr double kLeastSeen_ratio = 0.02;                       // of the resolution
constexpr double kSame_m = 1e-9;  // positions that are computed from the same counts
constexpr double kMiddleLag_rad = 110.0 * std::numbers::pi / 180.0;
constexpr double kLeastMade = 0.1;     // of what was asked for
constexpr double kLeastCosine = 0.17;  // 80°
constexpr double kMostAcross = 2.0;
constexpr double kTooStrong = 1.5;
constexpr double kStillHandle = 5.0;  // amplitudes, in a block

/// The amplitudes of a cos ωt + b sin ωt in readings that are that and a cubic: rows of least
/// squares with the weights of a Hann window, as a − ib.
std::vector<std::complex<double>> wave_of(std::size_t n) {
  using Columns = Eigen::Matrix<double, Eigen::Dynamic, 6>;
  const auto rows = static_cast<Eigen::Index>(n);
  Columns columns(rows, 6);
  Eigen::VectorXd weights(rows);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const double turn = static_cast<double>(i) / static_cast<double>(n);
    const double t = 2.0 * turn - 1.0;
    const double phase = 2.0 * std::numbers::pi * kCycles * turn;
    columns.row(i) << 1.0, t, t * t, t * t * t, std::cos(phase), std::sin(phase);
    weights[i] = std::pow(std::sin(std::numbers::pi * (turn + 0.5 / static_cast<double>(n))), 2);
  }
  const Eigen::Matrix<double, 6, Eigen::Dynamic> weighted =
      columns.transpose() * weights.asDiagonal();
  const Eigen::Matrix<double, 6, Eigen::Dynamic> fit =
      Eigen::Matrix<double, 6, 6>(weighted * columns).inverse() * weighted;
  std::vector<std::complex<double>> wave(n);
  for (Eigen::Index i = 0; i < rows; ++i) {
    wave[static_cast<std::size_t>(i)] = {fit(4, i), -fit(5, i)};
  }
  return wave;
}

double friction_along(const Vector3& axis, double isotropic, const Vector3* per_axis) {
  return per_axis == nullptr ? isotropic : per_axis->dot(axis.cwiseAbs2());
}

}  // namespace

MotorCheck::MotorCheck(const MotorCheckPlan& plan)
    : profile_(plan.profile),
      rate_hz_(plan.rate_hz),
      block_(std::max(kLeastReadings, static_cast<std::size_t>(std::lround(kBlock_s * rate_hz_)))),
      omega_rad_per_s_(2.0 * std::numbers::pi * kCycles * rate_hz_ / static_cast<double>(block_)),
      lag_rad_(0.5 * omega_rad_per_s_ * to_seconds(plan.latency)),
      wave_(wave_of(block_)) {
  for (int i = 0; i < 3; ++i) {
    const Vector3 along = plan.force_axes.col(i);
    if (along.norm() < kHasMotor) continue;
    axes_[axis_count_] = along.normalized();
    const double coulomb_newton =
        friction_along(axes_[axis_count_], profile_.coulomb_newton,
                       profile_.per_axis ? &profile_.per_axis->coulomb_newton : nullptr);
    push_newton_[axis_count_] =
        std::min(plan.limit_newton, coulomb_newton + kBeyondFriction_newton);
    ++axis_count_;
  }
  begin();
}

void MotorCheck::begin() noexcept {
  verdict_ = axis_count_ == 0 ? MotorVerdict::kGood : MotorVerdict::kChecking;
  gain_ = 0.0;
  axis_ = 0;
  interruptions_ = 0;
  begin_axis();
}

void MotorCheck::begin_axis() noexcept {
  index_ = ending_ = 0;
  has_moved_ = false;
  range_m_ = 0.0;
  blocks_ = 0;
  sum_.setZero();
  squares_.setZero();
  begin_block();
}

void MotorCheck::begin_block() noexcept {
  block_position_.setZero();
  block_requested_ = block_applied_ = 0.0;
}

Vector3 MotorCheck::next(TimePoint at, const Vector3& position_m) noexcept {
  if (verdict_ != MotorVerdict::kChecking) return Vector3::Zero();
  if (index_ > 0 && ending_ == 0 && at - last_at_ > kLongestGap + from_seconds(1.5 / rate_hz_)) {
    begin_axis();
    if (++interruptions_ > kMostInterruptions) {
      verdict_ = MotorVerdict::kInterrupted;
      return Vector3::Zero();
    }
  } else if (index_ > 0) {
    fill_in(std::lround(to_seconds(at - last_at_) * rate_hz_), position_m);
    if (verdict_ != MotorVerdict::kChecking) return Vector3::Zero();
  }
  last_at_ = at;
  last_m_ = position_m;
  if (index_ == 0) first_m_ = position_m;
  has_moved_ = has_moved_ || (position_m - first_m_).cwiseAbs().maxCoeff() > kSame_m;

  // the sign of the push changes twice in each cycle
  const std::size_t half_wave = index_ * static_cast<std::size_t>(2.0 * kCycles) / block_;
  if (index_ == 0 || half_wave != half_wave_) half_wave_m_ = position_m;
  half_wave_ = half_wave;
  if ((position_m - half_wave_m_).cwiseAbs().maxCoeff() > kFarthest_m) {
    verdict_ = MotorVerdict::kTooStrong;
    return Vector3::Zero();
  }

  const std::size_t ramp = block_ / 2;  // whole cycles
  const double wave =
      push_newton_[axis_] * std::sin(2.0 * std::numbers::pi * kCycles *
                                     static_cast<double>((index_ + block_ - ramp) % block_) /
                                     static_cast<double>(block_));
  double share = std::min(1.0, static_cast<double>(index_) / static_cast<double>(ramp));
  if (ending_ > 0) {
    share = static_cast<double>(ending_ - 1) / static_cast<double>(ramp);
  }
  take(position_m);
  requested_newton_ = share * wave;
  return requested_newton_ * axes_[axis_];
}

void MotorCheck::take(const Vector3& position_m) noexcept {
  const std::size_t ramp = block_ / 2;
  if (ending_ > 0 || index_ < ramp) return;
  const std::size_t i = (index_ - ramp) % block_;
  const double along_m = axes_[axis_].dot(position_m);
  block_low_m_ = i == 0 ? along_m : std::min(block_low_m_, along_m);
  block_high_m_ = i == 0 ? along_m : std::max(block_high_m_, along_m);
  block_position_ += wave_[i] * position_m.cast<Complex>();
}

/// Readings of ticks that were skipped: the last push went on, and the handle moved evenly.
void MotorCheck::fill_in(std::int64_t periods, const Vector3& position_m) noexcept {
  const Vector3 from_m = last_m_;
  const std::size_t axis = axis_;
  for (std::int64_t i = 1; i < periods; ++i) {
    if (verdict_ != MotorVerdict::kChecking || axis_ != axis) return;
    const double share = static_cast<double>(i) / static_cast<double>(periods);
    take(from_m + share * (position_m - from_m));
    applied(last_applied_newton_);
  }
}

void MotorCheck::applied(const Vector3& force_newton) noexcept {
  if (verdict_ != MotorVerdict::kChecking) return;
  last_applied_newton_ = force_newton;
  const std::size_t ramp = block_ / 2;
  const std::size_t index = index_++;
  if (ending_ > 0) {
    if (--ending_ > 0) return;
    if (++axis_ < axis_count_) return begin_axis();
    axis_ = axis_count_ - 1;
    verdict_ = gain_ >= kTooStrong ? MotorVerdict::kTooStrong : MotorVerdict::kGood;
    return;
  }
  if (index < ramp) return;
  const std::size_t i = (index - ramp) % block_;
  block_requested_ += wave_[i] * requested_newton_;
  block_applied_ += wave_[i] * axes_[axis_].dot(force_newton);
  if (i + 1 < block_) return;
  finish_block();
  if (verdict_ == MotorVerdict::kChecking && blocks_ >= kLeastBlocks && has_decided()) {
    ending_ = ramp;
  }
}

void MotorCheck::finish_block() noexcept {
  // limited and quantised as the motors say, but in the direction that was asked for; it acts from
  // its reading to the next, half a period later on average
  const double made_ratio = std::abs(block_applied_) / std::abs(block_requested_);
  const Complex force = (made_ratio > kLeastMade ? made_ratio : 1.0) * block_requested_ *
                        std::exp(-1i * (0.5 * omega_rad_per_s_ / rate_hz_));
  force_newton_ = std::abs(force);
  const Complex3 response = block_position_ / force;
  sum_ += response;
  squares_ += response.cwiseAbs2();
  ++blocks_;
  range_m_ = std::max(range_m_, block_high_m_ - block_low_m_);
  begin_block();
}

/// True: the axis is good. A verdict ends the check.
bool MotorCheck::has_decided() noexcept {
  const double n = blocks_;
  const Complex3 mean = sum_ / n;
  const Vector3 variance = ((squares_ / n - mean.cwiseAbs2()) * (n / (n - 1.0))).cwiseMax(0.0);
  const double error = std::sqrt(variance.sum() / n);
  const Complex along = axes_[axis_].cast<Complex>().dot(mean);
  const double across = (mean - along * axes_[axis_].cast<Complex>()).norm();
  const auto is_seen = [&](double response) {
    return response > kSignificant * error &&
           response * force_newton_ > kLeastSeen_ratio * profile_.position_resolution_m + kSame_m;
  };
  if (is_seen(std::max(std::abs(along), across)) && across > kMostAcross * std::abs(along)) {
    verdict_ = MotorVerdict::kWrongWay;
    return false;
  }
  if (is_seen(std::abs(along))) {
    const double cosine = std::cos(std::arg(along) + lag_rad_ + kMiddleLag_rad);
    if (cosine < -kLeastCosine) {
      verdict_ = MotorVerdict::kWrongWay;
      return false;
    }
    if (cosine > kLeastCosine) {
      gain_ = std::max(gain_, gain_along(along));
      return true;
    }
  }
  if (blocks_ >= kMostBlocks) {
    verdict_ = has_moved_ ? MotorVerdict::kNotSeen : MotorVerdict::kFrozen;
  }
  return false;
}

double MotorCheck::gain_along(const Complex& along) const noexcept {
  const double amplitude_m = std::abs(along) * force_newton_;
  if (range_m_ > kStillHandle * amplitude_m) return 0.0;
  const Vector3& axis = axes_[axis_];
  const auto& per_axis = profile_.per_axis;
  const double coulomb =
      friction_along(axis, profile_.coulomb_newton, per_axis ? &per_axis->coulomb_newton : nullptr);
  const double viscous = friction_along(axis, profile_.viscous_newton_s_per_m,
                                        per_axis ? &per_axis->viscous_newton_s_per_m : nullptr);
  const double omega = omega_rad_per_s_;
  // late by some part of the latency: by the one for which the gain is least
  const double middle_rad =
      kMiddleLag_rad - std::arg(along * std::exp(1i * (lag_rad_ + kMiddleLag_rad)));
  const double lag_rad =
      std::clamp(std::numbers::pi / 2.0, middle_rad - lag_rad_, middle_rad + lag_rad_);
  const double work_watt = 0.5 * omega * force_newton_ * amplitude_m * std::sin(lag_rad);
  if (!(work_watt > 0.0)) return 0.0;
  return (2.0 * coulomb * amplitude_m * omega / std::numbers::pi +
          0.5 * viscous * omega * omega * amplitude_m * amplitude_m) /
         work_watt;
}

}  // namespace palpate::device
