// SPDX-License-Identifier: Apache-2.0
/// @file
/// energy_count.h — what one friction has dissipated and one force has worked, at least.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::controllers {

/// Rounding, and the lengths over which friction is observed.
namespace detail {

/// Moved this many resolutions, a window loses at most 1 − (1 − √3/16)² = 20 % to the quantisation,
/// on a single axis 12 %.
inline constexpr double kWindowResolutions = 16.0;

/// The path of so many resolutions says in which direction friction acts. Shorter ones make its
/// force change more often, longer ones let it lag behind the hand.
inline constexpr double kRecentResolutions = 16.0;

/// One step back of an encoder is as long as the play is wide, but for rounding.
inline constexpr double kEdge = 1.0 - 1e-6;

/// More than the rounding error of a few operations, relative to their largest term. Sums are
/// lowered by it, so that rounding costs credit and never makes any.
inline constexpr double kRounding = 8.0 * std::numeric_limits<double>::epsilon();

/// Lower bound of a − b, a and b being right to within rounding.
inline double less_rounding(double a, double b) {
  return a - b - kRounding * (std::abs(a) + std::abs(b));
}

/// Lower bound of a + b, a and b ≥ 0.
inline double sum_from_below(double a, double b) { return (a + b) * (1.0 - kRounding); }

}  // namespace detail

/// One count of an energy ledger (EnergyLedger, PortLedger, which say what it is): of one isotropic
/// friction in `kAxes` dimensions. In newtons and metres; for a joint read newton metres and
/// radians. Lemmas: telescoping, held_friction, quantised_path. No allocation, no throw.
template <int kAxes>
class EnergyCount {
 public:
  using Vector = Eigen::Matrix<double, kAxes, 1>;  ///< of positions and forces

  /// Counts nothing.
  EnergyCount() = default;
  /// @param f_d  ≥ 0, viscous   @param f_co  ≥ 0, Coulomb   @param q  ≥ 0, of each coordinate
  /// @param w  a displacement's norm is within ±w of the measured one
  EnergyCount(double f_d, double f_co, double q, double w) : f_d_(f_d), f_co_(f_co), q_(q), w_(w) {}
  /// Begins with no energy at this measured position.
  void restart(const Vector& position_m) noexcept;
  /// Books an interval during which the user exerted the force f.
  /// @param duration_s  ≥ 0, measured   @param f  on the environment
  /// @param position_at_end_m  measured
  void book(double duration_s, const Vector& f, const Vector& position_at_end_m) noexcept;
  /// The same without the work: the force ended on the way, where nothing was read.
  void book_release(double duration_s, const Vector& f, const Vector& position_at_end_m) noexcept;
  /// Of all that is booked.
  [[nodiscard]] double energy_joule() const noexcept { return energy_joule_; }
  /// By friction, on the paths that are sure.
  [[nodiscard]] double dissipated_joule() const noexcept { return dissipated_joule_; }

 private:
  /// Makes g that of the interval.
  void hold(const Vector& f, const Vector& position_at_end_m) noexcept;
  void work(const Vector& force_newton, const Vector& position_at_end_m) noexcept;
  void move_to(const Vector& position_m, double duration_s) noexcept;
  void begin_window() noexcept;  // at position_m_
  void sum_up() noexcept;
  [[nodiscard]] double window_viscous_joule() const noexcept;

  double f_d_ = 0.0;
  double f_co_ = 0.0;
  double q_ = 0.0;
  double w_ = 0.0;  // a displacement's norm is within ±w of the measured one

  Vector position_m_ = Vector::Zero();
  double work_joule_ = 0.0;              // Σ g·dh
  Vector held_newton_ = Vector::Zero();  // g(k−1)
  double variation_newton_ = 0.0;        // |g(0)|₁ + Σ|Δg|₁

  Vector play_m_ = Vector::Zero();  // output of a play operator of half-width q/2
  Vector path_m_ = Vector::Zero();  // L: of that output, the recent part
  double friction_joule_ = 0.0;

  Vector window_start_m_ = Vector::Zero();
  double window_s_ = 0.0;
  double closed_windows_viscous_joule_ = 0.0;

  // of all that is booked
  double dissipated_joule_ = 0.0;
  double energy_joule_ = 0.0;
};

template <int kAxes>
void EnergyCount<kAxes>::restart(const Vector& position_m) noexcept {
  position_m_ = position_m;
  work_joule_ = 0.0;
  held_newton_.setZero();
  variation_newton_ = 0.0;
  play_m_ = position_m;
  path_m_.setZero();
  friction_joule_ = 0.0;
  closed_windows_viscous_joule_ = 0.0;
  begin_window();
  sum_up();
}

template <int kAxes>
void EnergyCount<kAxes>::begin_window() noexcept {
  window_start_m_ = position_m_;
  window_s_ = 0.0;
}

template <int kAxes>
void EnergyCount<kAxes>::book(double duration_s, const Vector& f,
                              const Vector& position_at_end_m) noexcept {
  hold(f, position_at_end_m);
  work(held_newton_, position_at_end_m);
  move_to(position_at_end_m, duration_s);
}

template <int kAxes>
void EnergyCount<kAxes>::book_release(double duration_s, const Vector& f,
                                      const Vector& position_at_end_m) noexcept {
  hold(f, position_at_end_m);
  held_newton_ -= f;  // where no position was read: no error of one
  work(held_newton_, position_at_end_m);
  move_to(position_at_end_m, duration_s);
}

template <int kAxes>
void EnergyCount<kAxes>::hold(const Vector& f, const Vector& position_at_end_m) noexcept {
  const Vector moved = position_at_end_m - position_m_;

  // towards where, how far for sure, and which share of its recent path an axis has
  const Vector toward = position_at_end_m - play_m_;
  const Vector half_width = Vector::Constant(0.5 * q_);
  const Vector play_m =
      play_m_.cwiseMax(position_at_end_m - half_width).cwiseMin(position_at_end_m + half_width);
  const Vector sure_m = play_m - play_m_;
  play_m_ = play_m;
  const double length_m = sure_m.template lpNorm<1>();
  if (length_m > 0.0) {
    const double recent_m = detail::kRecentResolutions * q_;
    path_m_ = path_m_ * (recent_m / (recent_m + length_m)) + sure_m.cwiseAbs();
  }
  const double norm_m = path_m_.norm();

  Vector held;
  for (int i = 0; i < kAxes; ++i) {
    const double share = norm_m > 0.0 ? path_m_[i] / norm_m : 0.0;
    // less what rounds g
    const double most_newton =
        std::max(0.0, detail::less_rounding(f_co_ * share, detail::kRounding * std::abs(f[i])));
    const bool goes_on =
        toward[i] * moved[i] > 0.0 && std::abs(toward[i]) >= detail::kEdge * half_width[i];
    held[i] = goes_on ? f[i] + std::copysign(most_newton, toward[i])
                      : std::clamp(held_newton_[i], f[i] - most_newton, f[i] + most_newton);
    friction_joule_ = detail::sum_from_below(friction_joule_, most_newton * std::abs(sure_m[i]));
  }
  if (held != held_newton_) {
    variation_newton_ += (held - held_newton_).template lpNorm<1>();
    variation_newton_ *= 1.0 + detail::kRounding;
  }
  held_newton_ = held;
}

template <int kAxes>
void EnergyCount<kAxes>::work(const Vector& force_newton,
                              const Vector& position_at_end_m) noexcept {
  const Vector moved = position_at_end_m - position_m_;
  if (moved.isZero(0.0)) return;
  work_joule_ += force_newton.dot(moved);
  work_joule_ -=
      detail::kRounding * (std::abs(work_joule_) + force_newton.cwiseAbs().dot(moved.cwiseAbs()));
}

template <int kAxes>
void EnergyCount<kAxes>::move_to(const Vector& position_m, double duration_s) noexcept {
  position_m_ = position_m;
  window_s_ = (window_s_ + duration_s) * (1.0 + detail::kRounding);
  if ((position_m_ - window_start_m_).norm() >= detail::kWindowResolutions * q_ &&
      window_s_ > 0.0) {
    closed_windows_viscous_joule_ =
        detail::sum_from_below(closed_windows_viscous_joule_, window_viscous_joule());
    begin_window();
  }
  sum_up();
}

template <int kAxes>
double EnergyCount<kAxes>::window_viscous_joule() const noexcept {
  if (!(window_s_ > 0.0)) return 0.0;
  const double moved =
      std::max(0.0, detail::less_rounding((position_m_ - window_start_m_).norm(), w_));
  return f_d_ * moved * moved / window_s_;
}

/// Once for each booking: the sums are read more often.
template <int kAxes>
void EnergyCount<kAxes>::sum_up() noexcept {
  const double viscous = closed_windows_viscous_joule_ + window_viscous_joule();
  dissipated_joule_ = friction_joule_ + viscous;
  const double quantisation = 0.5 * q_ * (held_newton_.template lpNorm<1>() + variation_newton_);
  energy_joule_ = work_joule_ - quantisation + viscous -
                  detail::kRounding * (std::abs(work_joule_) + quantisation + viscous);
}

}  // namespace palpate::controllers
