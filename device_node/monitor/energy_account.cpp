// SPDX-License-Identifier: Apache-2.0
#include "device_node/monitor/energy_account.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::device {
namespace {

// As many resolutions of motion as close a window, and of path as L remembers.
constexpr double kWindowResolutions = 16.0;
constexpr double kRecentResolutions = 16.0;

// A step of the encoder is the width of the play, up to rounding.
constexpr double kAtTheEdge = 1.0 - 1e-6;

/// More than the rounding error of the few operations of one sum, relative to its largest term.
constexpr double kUlps = 4.0 * std::numeric_limits<double>::epsilon();

/// a + b, not more than that of the exact values.
double below(double a, double b) { return a + b - kUlps * (std::abs(a) + std::abs(b)); }

}  // namespace

EnergyAccount::EnergyAccount(const DeviceProfile& profile, double v_skew_m_per_s,
                             double turning_per_m) noexcept
    : resolution_m_(profile.position_resolution_m),
      v_skew_m_per_s_(v_skew_m_per_s),
      turning_per_m_(turning_per_m),
      isotropic_coulomb_newton_(profile.per_axis ? 0.0 : profile.coulomb_newton),
      used_(profile.per_axis ? 3 : 1) {
  if (!profile.per_axis) {
    paths_[0] = {.viscous_newton_s_per_m = profile.viscous_newton_s_per_m,
                 .coulomb_newton = profile.coulomb_newton,
                 .w_m = std::sqrt(3.0) * resolution_m_};
    return;
  }
  for (int i = 0; i < 3; ++i) {
    paths_[static_cast<std::size_t>(i)] = {
        .first = i,
        .count = 1,
        .viscous_newton_s_per_m = profile.per_axis->viscous_newton_s_per_m[i],
        .coulomb_newton = profile.per_axis->coulomb_newton[i],
        .w_m = resolution_m_};
  }
}

void EnergyAccount::restart(const Vector3& position_m, double joule) noexcept {
  carried_joule_ = joule;
  work_joule_ = 0.0;
  has_worked_ = false;
  last_force_newton_.setZero();
  held_newton_.setZero();
  held_change_newton_ = 0.0;
  skewed_joule_ = 0.0;
  next_skew_s_ = std::max(skew_s_, next_skew_s_);
  next_turned_newton_.setZero();
  finish_reading();
  position_m_ = play_m_ = position_m;
  recent_path_m_.setZero();
  for (std::size_t i = 0; i < used_; ++i) {
    paths_[i].closed_viscous_joule = 0.0;
    begin_window(paths_[i]);
  }
}

void EnergyAccount::next_reading(double skew_s, double turning_joule,
                                 const Vector3& turned_newton) noexcept {
  next_skew_s_ = skew_s;
  turning_joule_ = turning_joule;
  next_turned_newton_ = turned_newton;
}

/// The next reading is the last one now.
void EnergyAccount::finish_reading() noexcept {
  skew_s_ = next_skew_s_;
  turned_newton_ = next_turned_newton_;
  next_skew_s_ = turning_joule_ = 0.0;
  next_turned_newton_.setZero();
}

void EnergyAccount::book(double duration_s, const Vector3& force_on_hand_newton,
                         const Vector3& position_at_end_m) noexcept {
  change_force(force_on_hand_newton);
  hold(position_at_end_m);
  count_work(position_at_end_m);
  follow(position_at_end_m, duration_s);
  if (turning_joule_ > 0.0) work_joule_ = below(work_joule_, -turning_joule_);
  finish_reading();
}

void EnergyAccount::book_release(const Release& release) noexcept {
  const double before = joule();
  const double least = below(before, -release.most_drawn_joule);
  if (std::isfinite(release.v_max_m_per_s) && std::isfinite(release.held_ratio)) {
    const double released = least_release_joule(release);
    change_force(release.force_on_hand_newton);
    hold(release.position_at_end_m);
    // no position was read where it ended, and its work is that of the release
    last_force_newton_.setZero();
    held_newton_ -= release.force_on_hand_newton;
    next_turned_newton_.setZero();
    count_work(release.position_at_end_m);
    follow(release.position_at_end_m, release.duration_s);
    carried_joule_ = below(carried_joule_, released);
    if (joule() >= least) return finish_reading();
  }
  restart(release.position_at_end_m, std::isfinite(least) ? least : std::min(before, 0.0));
}

/// Work of the force, which ended where nobody read the position. docs/theory.md §2.5: u, Δ, b, c.
double EnergyAccount::least_release_joule(const Release& release) const noexcept {
  const Vector3& F = release.force_on_hand_newton;
  const Vector3 moved = release.position_at_end_m - position_m_;
  // held currents draw τ·Δθ, whatever the way: at most r|F| times how far it got, in any direction
  const bool turns = release.held_ratio > 1.0;
  const double newton = release.held_ratio * F.norm();
  const double along = turns ? moved.norm() : F.dot(moved) / newton;
  // the end that costs most: further than v_max t the hand cannot have gone, nor have come back
  const double v_max = release.v_max_m_per_s;
  const double acted_s = std::clamp(0.5 * (along / v_max + release.duration_s), release.acted_s,
                                    std::max(release.acted_s, release.acted_at_most_s));
  const double reach = v_max * acted_s;
  const double way_back = v_max * (release.duration_s - acted_s);
  const double b = std::min(reach, along + way_back);
  // twice: of the readings, and of the time for which the force acted
  const double resolutions = turns ? std::sqrt(3.0) : F.lpNorm<1>() / newton;
  const double c =
      0.5 * resolution_m_ * resolutions + 2.0 * skew_m(std::max(skew_s_, next_skew_s_));
  double joule = -newton * (b + c);
  if (newton >= 2.0 * isotropic_coulomb_newton_) {
    // there and back again
    const double hidden = 2.0 * b - along - moved.norm() - std::sqrt(3.0) * resolution_m_;
    joule += isotropic_coulomb_newton_ * std::max(0.0, hidden);
  }
  return joule - std::max(0.0, turning_joule_) -
         kUlps * newton * (c + moved.norm() + reach + way_back);
}

double EnergyAccount::joule() const noexcept {
  double sum = carried_joule_;
  double magnitude = std::abs(carried_joule_);
  const auto add = [&](double term) {
    sum += term;
    magnitude += std::abs(term);
  };
  add(work_joule_);
  add(-0.5 * resolution_m_ * ((held_newton_ + turned_newton_).lpNorm<1>() + held_change_newton_));
  add(-(skewed_joule_ + skew_m(skew_s_) * (last_force_newton_ + turned_newton_).norm()));
  for (std::size_t i = 0; i < used_; ++i) {
    const Path& path = paths_[i];
    add(path.closed_viscous_joule + path.viscous_joule(window_moved_m()));
  }
  return sum - kUlps * magnitude;
}

void EnergyAccount::change_force(const Vector3& force_newton) noexcept {
  if (force_newton == last_force_newton_ && turned_newton_.isZero(0.0)) return;
  has_worked_ = true;
  skewed_joule_ += skew_m(skew_s_) * (force_newton - last_force_newton_ - turned_newton_).norm();
  skewed_joule_ *= 1.0 + kUlps;
  last_force_newton_ = force_newton;
}

/// Chooses G for the stretch that ends at this reading.
void EnergyAccount::hold(const Vector3& position_m) noexcept {
  const double half_width = 0.5 * resolution_m_;
  const double kept_m = kRecentResolutions * resolution_m_;
  const Vector3 moved = position_m - position_m_;
  const Vector3 toward = position_m - play_m_;
  const Vector3 held_before = held_newton_ + turned_newton_;
  turned_newton_.setZero();
  for (std::size_t p = 0; p < used_; ++p) {
    const Path& path = paths_[p];
    const int end = path.first + path.count;

    // the way that is sure is new in L
    Vector3 sure_m = Vector3::Zero();
    for (int i = path.first; i < end; ++i) {
      const double before = play_m_[i];
      play_m_[i] = std::clamp(before, position_m[i] - half_width, position_m[i] + half_width);
      sure_m[i] = std::abs(play_m_[i] - before);
    }
    const double new_m = sure_m.sum();
    double squares = 0.0;
    for (int i = path.first; i < end; ++i) {
      double& recent_m = recent_path_m_[i];
      if (new_m > 0.0) recent_m = recent_m * (kept_m / (kept_m + new_m)) + sure_m[i];
      squares += recent_m * recent_m;
    }
    const double norm_m = std::sqrt(squares);

    // against the hand where its reading goes on, else as before where friction can
    for (int i = path.first; i < end; ++i) {
      const double force = last_force_newton_[i];
      const double share = norm_m > 0.0 ? recent_path_m_[i] / norm_m : 0.0;
      const double most =
          std::max(0.0, below(path.coulomb_newton * share, -kUlps * std::abs(force)));
      const bool goes_on =
          toward[i] * moved[i] > 0.0 && std::abs(toward[i]) >= kAtTheEdge * half_width;
      held_newton_[i] = goes_on ? force - std::copysign(most, toward[i])
                                : std::clamp(held_before[i], force - most, force + most);
    }
  }
  if (held_newton_ != held_before) {
    held_change_newton_ += (held_newton_ - held_before).lpNorm<1>();
    held_change_newton_ *= 1.0 + kUlps;
  }
}

void EnergyAccount::count_work(const Vector3& position_m) noexcept {
  const Vector3 moved = position_m - position_m_;
  if (moved.isZero(0.0)) return;
  work_joule_ -= held_newton_.dot(moved);
  work_joule_ -= kUlps * (std::abs(work_joule_) + held_newton_.cwiseAbs().dot(moved.cwiseAbs()));
}

void EnergyAccount::follow(const Vector3& position_m, double duration_s) noexcept {
  position_m_ = position_m;
  for (std::size_t i = 0; i < used_; ++i) {
    Path& path = paths_[i];
    path.window_s = (path.window_s + duration_s) * (1.0 + kUlps);
    if (path.norm_m(window_moved_m()) < kWindowResolutions * resolution_m_) continue;
    path.closed_viscous_joule =
        (path.closed_viscous_joule + path.viscous_joule(window_moved_m())) * (1.0 - kUlps);
    begin_window(path);
  }
}

void EnergyAccount::begin_window(Path& path) noexcept {
  for (int i = path.first; i < path.first + path.count; ++i) window_start_m_[i] = position_m_[i];
  path.window_s = std::max(skew_s_, next_skew_s_);  // its first reading may be so much older
}

double EnergyAccount::Path::norm_m(const Vector3& moved_m) const noexcept {
  return count == 1 ? std::abs(moved_m[first]) : moved_m.norm();
}

double EnergyAccount::Path::viscous_joule(const Vector3& window_moved_m) const noexcept {
  if (!(window_s > 0.0)) return 0.0;
  const double moved = std::max(0.0, below(norm_m(window_moved_m), -w_m));
  return viscous_newton_s_per_m * moved * moved / window_s;
}

}  // namespace palpate::device
