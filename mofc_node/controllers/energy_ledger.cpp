// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/energy_ledger.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::controllers {
using detail::kRounding;
using detail::less_rounding;

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

}  // namespace palpate::controllers
