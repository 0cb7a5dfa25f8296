// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/velocity_estimator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
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

// A reading further from what the filter expects, in standard deviations, contradicts its model.
constexpr double kSurprise = 2.5;

// Of such a contradiction, the variance that a jump of the velocity gets.
constexpr double kStrikeShare = 0.1;

// Least change of a reading that is one, and how far from whole counts whole changes are, in
// counts.
constexpr double kCountTolerance = 0.01;

// The moving mass is not known better than this: a hand's depends on its grip.
constexpr double kMassError = 0.1;

// Slower, Coulomb friction is taken as proportional to the velocity.
constexpr double kStictionSpeed_m_per_s = 2e-3;

// Longest step of the series for the model; a longer time between two samples is several steps.
constexpr double kLongestStep_s = 5e-3;

// After a longer gap than this the filter begins anew.
constexpr double kLongestGap_s = 0.25;

// Of an interval of the normal distribution that counts as narrow.
constexpr double kNarrow = 0.02;

template <class... Ts>
struct Overloaded : Ts... {
  using Ts::operator()...;
};
template <class... Ts>
Overloaded(Ts...) -> Overloaded<Ts...>;

}  // namespace

std::unique_ptr<VelocityEstimator> make_velocity_estimator(const VelocityEstimatorConfig& config,
                                                           double resolution_m, double scale_ratio,
                                                           double coulomb_newton) {
  using Made = std::unique_ptr<VelocityEstimator>;
  return std::visit(Overloaded{[](const DifferenceVelocity& c) -> Made {
                                 return std::make_unique<DifferenceEstimator>(c.time_constant);
                               },
                               [&](const AdaptiveWindowVelocity& c) -> Made {
                                 return std::make_unique<AdaptiveWindowEstimator>(c, resolution_m);
                               },
                               [&](const KalmanVelocity& c) -> Made {
                                 return std::make_unique<KalmanEstimator>(
                                     c, resolution_m, scale_ratio, coulomb_newton);
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

namespace {

/// Mean and variance of a standard normal variable of which is known that it lies in [from, to].
struct TruncatedNormal {
  double mean = 0.0;
  double variance = 1.0;
};

TruncatedNormal truncated_normal(double from, double to) noexcept {
  const double width = to - from;
  const double middle = 0.5 * (from + to);
  if (width < kNarrow) {  // there the density is a straight line, and the closed form all rounding
    const double uniform = width * width / 12.0;
    return {middle * (1.0 - uniform), uniform};
  }
  const auto density = [](double x) {
    return std::exp(-0.5 * x * x) * (0.5 * std::numbers::inv_sqrtpi * std::numbers::sqrt2);
  };
  // from the side where the tail is short
  const double side = middle > 0.0 ? 1.0 : -1.0;
  const double probability = 0.5 * std::abs(std::erfc(side * from / std::numbers::sqrt2) -
                                            std::erfc(side * to / std::numbers::sqrt2));
  const double mean = (density(from) - density(to)) / probability;
  const double variance =
      1.0 + (from * density(from) - to * density(to)) / probability - mean * mean;
  return {mean, std::max(variance, 0.0)};
}

}  // namespace

KalmanEstimator::KalmanEstimator(const KalmanVelocity& config, double resolution_m,
                                 double scale_ratio, double coulomb_newton)
    : half_count_m_(0.5 * std::max(resolution_m, kLeastResolution_m)) {
  const bool is_hand_known = config.moving_mass_kg > 0.0;
  const double per_mass = is_hand_known ? 1.0 / config.moving_mass_kg : 0.0;
  acceleration_per_newton_ = scale_ratio * per_mass;
  friction_m_per_s2_ = acceleration_per_newton_ * coulomb_newton;
  first_covariance_.diagonal() << half_count_m_ * half_count_m_ / 3.0,
      kFirstVelocity_m_per_s * kFirstVelocity_m_per_s, 0.0, 0.0;
  rate_(0, 1) = 1.0;
  input_rate_[1] = 1.0;
  if (config.model == KalmanVelocity::Model::kConstantVelocity) {
    density_(1, 1) = config.noise_density;
    return;
  }
  const double stiffness = config.hand_stiffness_newton_per_m * per_mass;
  const double damping = config.hand_damping_newton_s_per_m * per_mass;
  rate_(1, 2) = 1.0;
  rate_(2, 1) = -stiffness;
  rate_(2, 2) = -damping;
  rate_(2, 3) = stiffness;
  input_rate_[2] = -damping;
  density_(2, 2) = config.noise_density;
  first_covariance_(2, 2) = kFirstAcceleration_m_per_s2 * kFirstAcceleration_m_per_s2;
  if (!(stiffness > 0.0)) return;  // where the hand wants to go cannot be seen
  const double intention = config.intention_density;
  density_(2, 2) += intention * damping * damping;
  density_(2, 3) = density_(3, 2) = intention * damping;
  density_(3, 3) = intention;
  first_covariance_(3, 3) = kFirstVelocity_m_per_s * kFirstVelocity_m_per_s;
}

Vector3 KalmanEstimator::position_m(const Vector3& measured_m) const noexcept {
  if (!has_sample_) return measured_m;
  const Eigen::Array3d off_m = (state(0) - measured_m).array();
  return measured_m + off_m.max(-half_count_m_).min(half_count_m_).matrix();
}

Vector3 KalmanEstimator::state(int derivative) const noexcept {
  return {axes_[0].state[derivative], axes_[1].state[derivative], axes_[2].state[derivative]};
}

void KalmanEstimator::begin(const Vector3& position_m) noexcept {
  has_sample_ = true;
  previous_force_newton_.setZero();
  for (int i = 0; i < 3; ++i) {
    Axis& axis = axes_[static_cast<std::size_t>(i)];
    axis = {.state = {position_m[i], 0.0, 0.0, 0.0},
            .covariance = first_covariance_,
            .measured_m = position_m[i]};
  }
}

void KalmanEstimator::use_step(double h) noexcept {
  if (h == step_s_) return;
  step_s_ = h;
  const auto over = [this](double t) {
    const Square at = t * rate_;
    const Square at2 = at * at;
    return Square(Square::Identity() + at + 0.5 * at2 + at2 * at / 6.0);
  };
  transition_ = over(h);
  const Square half = over(0.5 * h);
  noise_ = h / 6.0 *
           (density_ + 4.0 * half * density_ * half.transpose() +
            transition_ * density_ * transition_.transpose());
  const State bent = rate_ * input_rate_;
  input_ = h * (input_rate_ + h / 2.0 * bent + h * h / 6.0 * (rate_ * bent));
}

Vector3 KalmanEstimator::update(const Vector3& position_m, TimePoint t,
                                const Vector3& mean_force_newton) noexcept {
  const double since_s = to_seconds(t - last_time_);
  if (has_sample_ && since_s <= 0.0) return state(1);
  last_time_ = t;
  if (!has_sample_ || since_s > kLongestGap_s) {
    begin(position_m);
    return state(1);
  }
  const double steps = std::ceil(since_s / kLongestStep_s);
  use_step(since_s / steps);

  // a change of the force shows the error of the mass
  const Vector3 unsure_m_per_s2 =
      kMassError * acceleration_per_newton_ * (mean_force_newton - previous_force_newton_);
  previous_force_newton_ = mean_force_newton;
  const double speed_m_per_s = std::max(state(1).norm(), kStictionSpeed_m_per_s);
  for (int i = 0; i < 3; ++i) {
    Axis& axis = axes_[static_cast<std::size_t>(i)];
    if (density_(2, 2) > 0.0) axis.covariance(2, 2) += unsure_m_per_s2[i] * unsure_m_per_s2[i];
    const double known_m_per_s2 = acceleration_per_newton_ * mean_force_newton[i] -
                                  friction_m_per_s2_ * axis.state[1] / speed_m_per_s;
    for (double step = 0.0; step < steps; ++step) {
      axis.state = (transition_ * axis.state + known_m_per_s2 * input_).eval();
      axis.covariance = (transition_ * axis.covariance * transition_.transpose() + noise_).eval();
    }
    correct(axis, position_m[i], since_s);
  }
  if (!state(0).allFinite() || !state(1).allFinite()) begin(position_m);
  return state(1);
}

void KalmanEstimator::correct(Axis& axis, double measured_m, double since_s) const noexcept {
  // the count, or the part of it that can be reached from the edge just crossed
  double low_m = measured_m - half_count_m_;
  double high_m = measured_m + half_count_m_;
  const double counts = (measured_m - axis.measured_m) / (2.0 * half_count_m_);
  const bool is_new = std::abs(counts) > kCountTolerance;
  if (is_new && std::abs(counts - std::round(counts)) < kCountTolerance) {
    const double reach_m =
        (std::abs(axis.state[1]) + 2.0 * std::sqrt(axis.covariance(1, 1))) * since_s +
        kCountTolerance * half_count_m_;
    if (counts > 0.0) {
      high_m = std::min(high_m, low_m + reach_m);
    } else {
      low_m = std::max(low_m, high_m - reach_m);
    }
  }
  axis.measured_m = measured_m;

  const double middle_m = 0.5 * (low_m + high_m) - axis.state[0];
  const double half_m = 0.5 * (high_m - low_m);
  const double off_m = std::abs(middle_m) - half_m;
  double variance_m2 = axis.covariance(0, 0);
  // the same count again: news only where another one was expected
  if (!is_new && off_m <= 0.0 && variance_m2 < half_m * half_m / 3.0) return;

  // innovation outside the gate: inflate the covariance; something may have struck the hand
  const double least_m2 = off_m > 0.0 ? std::pow(off_m / kSurprise, 2) : 0.0;
  if (least_m2 > variance_m2) {
    axis.covariance *= least_m2 / variance_m2;
    axis.covariance(1, 1) += kStrikeShare * (least_m2 - variance_m2) / (since_s * since_s);
    variance_m2 = least_m2;
  }
  const double sigma_m = std::sqrt(variance_m2);
  const TruncatedNormal seen =
      truncated_normal((middle_m - half_m) / sigma_m, (middle_m + half_m) / sigma_m);

  const State gain = axis.covariance.col(0) / variance_m2;
  const Eigen::Matrix<double, 1, 4> row = axis.covariance.row(0);
  axis.state += gain * (sigma_m * seen.mean);
  axis.covariance -= (1.0 - seen.variance) * gain * row;
  // as a product, not as a difference: where little was known that would be all rounding
  axis.covariance.row(0) = seen.variance * row;
  axis.covariance.col(0) = axis.covariance.row(0).transpose().eval();
  axis.covariance = (0.5 * (axis.covariance + axis.covariance.transpose())).eval();
}

}  // namespace palpate::mofc
