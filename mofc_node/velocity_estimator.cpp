#include "mofc_node/velocity_estimator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <variant>

namespace palpate::mofc {
namespace {

// Ties are meant to pass: positions are whole counts only up to rounding.
constexpr double kTieTolerance = 1e-9;

// What is known of a hand before its second sample: standard deviations.
constexpr double kFirstVelocity_m_per_s = 1.0;
constexpr double kFirstAcceleration_m_per_s2 = 10.0;

// Stands for an exact encoder: a filter without measurement noise is a difference quotient.
constexpr double kLeastResolution_m = 1e-9;

template <class... Ts>
struct Overloaded : Ts... {
  using Ts::operator()...;
};

}  // namespace

std::unique_ptr<VelocityEstimator> make_velocity_estimator(const VelocityEstimatorConfig& config,
                                                           double resolution_m,
                                                           double scale_ratio) {
  using Made = std::unique_ptr<VelocityEstimator>;
  const auto per_newton = [&](double mass_kg) {
    return mass_kg > 0.0 ? scale_ratio / mass_kg : 0.0;
  };
  return std::visit(Overloaded{[](const DifferenceVelocity& c) -> Made {
                                 return std::make_unique<DifferenceEstimator>(c.time_constant);
                               },
                               [&](const AdaptiveWindowVelocity& c) -> Made {
                                 return std::make_unique<AdaptiveWindowEstimator>(c, resolution_m);
                               },
                               [&](const KalmanVelocity& c) -> Made {
                                 if (c.model == KalmanVelocity::Model::kConstantVelocity) {
                                   return std::make_unique<KalmanEstimator<2>>(
                                       c.noise_density, resolution_m, per_newton(c.moving_mass_kg));
                                 }
                                 return std::make_unique<KalmanEstimator<3>>(
                                     c.noise_density, resolution_m, per_newton(c.moving_mass_kg));
                               }},
                    config);
}

Vector3 LowPass::update(const Vector3& input, double dt_s) noexcept {
  const double gain = time_constant_s_ > 0.0 ? -std::expm1(-dt_s / time_constant_s_) : 1.0;
  value_ += gain * (input - value_);
  return value_;
}

// --- difference -------------------------------------------------------------------------------

void DifferenceEstimator::reset() noexcept {
  has_sample_ = false;
  low_pass_.reset();
}

Vector3 DifferenceEstimator::update(const Vector3& position_m, TimePoint t,
                                    const Vector3& /*mean_force_newton*/) noexcept {
  const double dt_s = to_seconds(t - last_time_);
  if (has_sample_) {
    if (dt_s <= 0.0) return low_pass_.value();
    low_pass_.update((position_m - last_position_m_) / dt_s, dt_s);
  }
  has_sample_ = true;
  last_position_m_ = position_m;
  last_time_ = t;
  return low_pass_.value();
}

// --- adaptive window --------------------------------------------------------------------------

AdaptiveWindowEstimator::AdaptiveWindowEstimator(const AdaptiveWindowVelocity& config,
                                                 double resolution_m)
    : config_(config), resolution_m_(resolution_m), low_pass_(config.time_constant) {}

void AdaptiveWindowEstimator::reset() noexcept {
  count_ = 0;
  window_s_.setZero();
  low_pass_.reset();
}

Vector3 AdaptiveWindowEstimator::update(const Vector3& position_m, TimePoint t,
                                        const Vector3& /*mean_force_newton*/) noexcept {
  if (count_ > 0 && t <= sample(0).time) return low_pass_.value();
  newest_ = (newest_ + 1) % kMaxSamples;
  samples_[newest_] = {position_m, t};
  count_ = std::min(count_ + 1, kMaxSamples);
  if (count_ < 2) return low_pass_.value();

  // the samples that a window may reach back to: always the one before
  std::size_t allowed = 0;
  for (std::size_t back = 1; back < count_; ++back) {
    const Duration age = t - sample(back).time;
    if (back > 1 && age > config_.max_window) break;
    age_s_[back] = to_seconds(age);
    allowed = back;
  }

  Vector3 velocity;
  for (int axis = 0; axis < 3; ++axis) {
    const std::size_t window = longest_window(axis, allowed);
    window_s_[axis] = age_s_[window];
    velocity[axis] = config_.is_best_fit
                         ? best_fit_slope(axis, window)
                         : (position_m[axis] - sample(window).position_m[axis]) / age_s_[window];
  }
  return low_pass_.update(velocity, age_s_[1]);
}

std::size_t AdaptiveWindowEstimator::longest_window(int axis, std::size_t allowed) const noexcept {
  // slopes of lines through the newest sample that pass within q of every sample so far
  double least = -std::numeric_limits<double>::infinity();
  double most = std::numeric_limits<double>::infinity();
  const double newest_m = sample(0).position_m[axis];
  const double q = resolution_m_ * (1.0 + kTieTolerance);
  std::size_t longest = 1;
  for (std::size_t back = 1; back <= allowed && least <= most; ++back) {
    const double rise_m = newest_m - sample(back).position_m[axis];
    const double slope = rise_m / age_s_[back];
    if (least <= slope && slope <= most) longest = back;
    least = std::max(least, (rise_m - q) / age_s_[back]);
    most = std::min(most, (rise_m + q) / age_s_[back]);
  }
  return longest;
}

double AdaptiveWindowEstimator::best_fit_slope(int axis, std::size_t window) const noexcept {
  const double newest_m = sample(0).position_m[axis];
  double mean_age_s = 0.0;
  for (std::size_t back = 1; back <= window; ++back) mean_age_s += age_s_[back];
  mean_age_s /= static_cast<double>(window + 1);
  double moment = 0.0;  // the newest adds nothing: positions are taken from it
  double spread = mean_age_s * mean_age_s;
  for (std::size_t back = 1; back <= window; ++back) {
    const double from_mean_s = mean_age_s - age_s_[back];
    moment += from_mean_s * (sample(back).position_m[axis] - newest_m);
    spread += from_mean_s * from_mean_s;
  }
  return moment / spread;
}

// --- Kalman -----------------------------------------------------------------------------------

template <int Order>
KalmanEstimator<Order>::KalmanEstimator(double noise_density, double resolution_m,
                                        double acceleration_per_newton)
    : noise_density_(noise_density),
      measurement_variance_m2_(std::pow(std::max(resolution_m, kLeastResolution_m), 2) / 12.0),
      acceleration_per_newton_(acceleration_per_newton) {}

template <int Order>
Vector3 KalmanEstimator<Order>::update(const Vector3& position_m, TimePoint t,
                                       const Vector3& mean_force_newton) noexcept {
  if (!has_sample_) {
    has_sample_ = true;
    last_time_ = t;
    state_.setZero();
    state_.row(0) = position_m.transpose();
    covariance_.setZero();
    covariance_(0, 0) = measurement_variance_m2_;
    covariance_(1, 1) = kFirstVelocity_m_per_s * kFirstVelocity_m_per_s;
    if constexpr (Order == 3) {
      covariance_(2, 2) = kFirstAcceleration_m_per_s2 * kFirstAcceleration_m_per_s2;
    }
    return velocity();
  }
  const double h = to_seconds(t - last_time_);
  if (h <= 0.0) return velocity();
  last_time_ = t;

  // predict: transition of the noise-free model, and the white noise integrated over h
  Square transition = Square::Identity();
  Square noise;
  transition(0, 1) = h;
  if constexpr (Order == 2) {
    noise << h * h * h / 3.0, h * h / 2.0,  //
        h * h / 2.0, h;
  } else {
    transition(0, 2) = h * h / 2.0;
    transition(1, 2) = h;
    const double h2 = h * h;
    const double h3 = h2 * h;
    noise << h2 * h3 / 20.0, h2 * h2 / 8.0, h3 / 6.0,  //
        h2 * h2 / 8.0, h3 / 3.0, h2 / 2.0,             //
        h3 / 6.0, h2 / 2.0, h;
  }
  state_ = (transition * state_).eval();
  const Vector3 known_m_per_s2 = acceleration_per_newton_ * mean_force_newton;
  state_.row(0) += (0.5 * h * h * known_m_per_s2).transpose();
  state_.row(1) += (h * known_m_per_s2).transpose();
  covariance_ = (transition * covariance_ * transition.transpose() + noise_density_ * noise).eval();

  // correct: only the position is measured
  const double surprise_variance_m2 = covariance_(0, 0) + measurement_variance_m2_;
  const Eigen::Matrix<double, Order, 1> gain = covariance_.col(0) / surprise_variance_m2;
  const Eigen::Matrix<double, 1, Order> seen = covariance_.row(0);
  const Eigen::Matrix<double, 1, 3> surprise_m = position_m.transpose() - state_.row(0);
  state_ += gain * surprise_m;
  covariance_ -= gain * seen;
  // as a product, not as a difference: after a long gap that would be all rounding
  covariance_.row(0) = (measurement_variance_m2_ / surprise_variance_m2) * seen;
  covariance_.col(0) = covariance_.row(0).transpose().eval();
  covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
  return velocity();
}

template class KalmanEstimator<2>;
template class KalmanEstimator<3>;

}  // namespace palpate::mofc
