// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/energy_ledger.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace palpate::controllers {
namespace {

// Moved this many resolutions, a window loses at most 1 − (1 − √3/16)² = 20 % to the quantisation,
// on a single axis 12 %.
constexpr double kWindowResolutions = 16.0;

// The path of so many resolutions says in which direction friction acts. Shorter ones make its
// force change more often, longer ones let it lag behind the hand.
constexpr double kRecentResolutions = 16.0;

// One step back of an encoder is as long as the play is wide, but for rounding.
constexpr double kEdge = 1.0 - 1e-6;

// More than the rounding error of a few operations, relative to their largest term. Sums are
// lowered by it, so that rounding costs credit and never makes any.
constexpr double kRounding = 8.0 * std::numeric_limits<double>::epsilon();

/// Lower bound of a − b, a and b being right to within rounding.
double less_rounding(double a, double b) { return a - b - kRounding * (std::abs(a) + std::abs(b)); }

/// Lower bound of a + b, a and b ≥ 0.
double sum_from_below(double a, double b) { return (a + b) * (1.0 - kRounding); }

}  // namespace

EnergyLedger::EnergyLedger(double f_d, double f_co, double q)
    : f_co_newton_(f_co), resolution_m_(q), counts_{Count(f_d, f_co, q, std::numbers::sqrt3 * q)} {}

EnergyLedger::EnergyLedger(const AxisFriction& friction, double q) : resolution_m_(q), used_(3) {
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<int>(i);
    counts_[i] = Count(friction.f_d[axis], friction.f_co[axis], q, q);
  }
}

Vector3 EnergyLedger::part(std::size_t i, const Vector3& v) const noexcept {
  if (used_ == 1) return v;
  Vector3 along = Vector3::Zero();
  along[static_cast<int>(i)] = v[static_cast<int>(i)];
  return along;
}

void EnergyLedger::restart(const Vector3& hand_position_m) noexcept {
  carried_joule_ = 0.0;
  position_m_ = hand_position_m;
  for (std::size_t i = 0; i < used_; ++i) counts_[i].restart(part(i, hand_position_m));
}

void EnergyLedger::book(double duration_s, const Vector3& force_on_hand_newton,
                        const Vector3& hand_position_at_end_m) noexcept {
  position_m_ = hand_position_at_end_m;
  for (std::size_t i = 0; i < used_; ++i) {
    counts_[i].book(duration_s, part(i, -force_on_hand_newton), part(i, hand_position_at_end_m));
  }
}

void EnergyLedger::book_unread(double most_drawn_joule,
                               const Vector3& hand_position_at_end_m) noexcept {
  const double before = energy_joule();
  restart(hand_position_at_end_m);
  carried_joule_ = less_rounding(before, most_drawn_joule);
}

/// Symbols as in docs/theory.md §2.5: u, Δ, b, c.
void EnergyLedger::book_release(const Release& release) noexcept {
  const double before = energy_joule();
  const Vector3& F = release.force_on_hand_newton;
  const double newton = F.norm();
  const Vector3 moved = release.hand_position_at_end_m - position_m_;
  double energy = 0.0;
  if (newton > 0.0) {
    // furthest along F at which the force can have ended
    const double along = F.dot(moved) / newton;
    const double c = 0.5 * resolution_m_ * F.lpNorm<1>() / newton;
    const double b =
        std::min(release.v_max_m_per_s * release.acted_s,
                 along + release.v_max_m_per_s * (release.duration_s - release.acted_s));
    energy = -newton * (b + c);
    // and back again is a path that the ends do not show
    if (newton >= 2.0 * f_co_newton_) {
      const double w = std::numbers::sqrt3 * resolution_m_;
      energy += f_co_newton_ * std::max(0.0, 2.0 * b - along - moved.norm() - w);
    }
    energy -= kRounding * newton * (c + moved.norm() + release.v_max_m_per_s * release.duration_s);
  }
  position_m_ = release.hand_position_at_end_m;
  for (std::size_t i = 0; i < used_; ++i) {
    counts_[i].book_release(release.duration_s, part(i, -F), part(i, position_m_));
  }
  carried_joule_ = less_rounding(carried_joule_, -energy);
  const double least = less_rounding(before, release.most_drawn_joule);
  if (energy_joule() < least) {
    restart(position_m_);
    carried_joule_ = least;
  }
}

void EnergyLedger::forfeit(const Vector3& hand_position_m) noexcept {
  const double before = energy_joule();
  restart(hand_position_m);
  carried_joule_ = std::min(before, 0.0);
}

void EnergyLedger::limit(double joule) noexcept {
  carried_joule_ -= std::max(0.0, energy_joule() - joule);
}

double EnergyLedger::dissipated_joule() const noexcept {
  double sum = 0.0;
  for (const Count& count : counts()) sum += count.dissipated_joule();
  return sum;
}

double EnergyLedger::energy_joule() const noexcept {
  double sum = carried_joule_;
  double magnitude = std::abs(carried_joule_);
  for (const Count& count : counts()) {
    const double energy = count.energy_joule();
    sum += energy;
    magnitude += std::abs(energy);
  }
  return sum - kRounding * magnitude;
}

// --- one count ----------------------------------------------------------------------------------

void EnergyLedger::Count::restart(const Vector3& position_m) noexcept {
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

void EnergyLedger::Count::begin_window() noexcept {
  window_start_m_ = position_m_;
  window_s_ = 0.0;
}

void EnergyLedger::Count::book(double duration_s, const Vector3& f,
                               const Vector3& position_at_end_m) noexcept {
  hold(f, position_at_end_m);
  work(held_newton_, position_at_end_m);
  move_to(position_at_end_m, duration_s);
}

void EnergyLedger::Count::book_release(double duration_s, const Vector3& f,
                                       const Vector3& position_at_end_m) noexcept {
  hold(f, position_at_end_m);
  held_newton_ -= f;  // where no position was read: no error of one
  work(held_newton_, position_at_end_m);
  move_to(position_at_end_m, duration_s);
}

void EnergyLedger::Count::hold(const Vector3& f, const Vector3& position_at_end_m) noexcept {
  const Vector3 moved = position_at_end_m - position_m_;

  // towards where, how far for sure, and which share of its recent path an axis has
  const Vector3 toward = position_at_end_m - play_m_;
  const Vector3 half_width = Vector3::Constant(0.5 * q_);
  const Vector3 play_m =
      play_m_.cwiseMax(position_at_end_m - half_width).cwiseMin(position_at_end_m + half_width);
  const Vector3 sure_m = play_m - play_m_;
  play_m_ = play_m;
  const double length_m = sure_m.lpNorm<1>();
  if (length_m > 0.0) {
    const double recent_m = kRecentResolutions * q_;
    path_m_ = path_m_ * (recent_m / (recent_m + length_m)) + sure_m.cwiseAbs();
  }
  const double norm_m = path_m_.norm();

  Vector3 held;
  for (int i = 0; i < 3; ++i) {
    const double share = norm_m > 0.0 ? path_m_[i] / norm_m : 0.0;
    // less what rounds g
    const double most_newton =
        std::max(0.0, less_rounding(f_co_ * share, kRounding * std::abs(f[i])));
    const bool goes_on = toward[i] * moved[i] > 0.0 && std::abs(toward[i]) >= kEdge * half_width[i];
    held[i] = goes_on ? f[i] + std::copysign(most_newton, toward[i])
                      : std::clamp(held_newton_[i], f[i] - most_newton, f[i] + most_newton);
    friction_joule_ = sum_from_below(friction_joule_, most_newton * std::abs(sure_m[i]));
  }
  if (held != held_newton_) {
    variation_newton_ += (held - held_newton_).lpNorm<1>();
    variation_newton_ *= 1.0 + kRounding;
  }
  held_newton_ = held;
}

void EnergyLedger::Count::work(const Vector3& force_newton,
                               const Vector3& position_at_end_m) noexcept {
  const Vector3 moved = position_at_end_m - position_m_;
  if (moved.isZero(0.0)) return;
  work_joule_ += force_newton.dot(moved);
  work_joule_ -=
      kRounding * (std::abs(work_joule_) + force_newton.cwiseAbs().dot(moved.cwiseAbs()));
}

void EnergyLedger::Count::move_to(const Vector3& position_m, double duration_s) noexcept {
  position_m_ = position_m;
  window_s_ = (window_s_ + duration_s) * (1.0 + kRounding);
  if ((position_m_ - window_start_m_).norm() >= kWindowResolutions * q_ && window_s_ > 0.0) {
    closed_windows_viscous_joule_ =
        sum_from_below(closed_windows_viscous_joule_, window_viscous_joule());
    begin_window();
  }
  sum_up();
}

double EnergyLedger::Count::window_viscous_joule() const noexcept {
  if (!(window_s_ > 0.0)) return 0.0;
  const double moved = std::max(0.0, less_rounding((position_m_ - window_start_m_).norm(), w_));
  return f_d_ * moved * moved / window_s_;
}

/// Once for each booking: the sums are read more often.
void EnergyLedger::Count::sum_up() noexcept {
  const double viscous = closed_windows_viscous_joule_ + window_viscous_joule();
  dissipated_joule_ = friction_joule_ + viscous;
  const double quantisation = 0.5 * q_ * (held_newton_.lpNorm<1>() + variation_newton_);
  energy_joule_ = work_joule_ - quantisation + viscous -
                  kRounding * (std::abs(work_joule_) + quantisation + viscous);
}

}  // namespace palpate::controllers
