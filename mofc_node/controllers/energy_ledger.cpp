#include "mofc_node/controllers/energy_ledger.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::controllers {
namespace {

// Moved this many resolutions, a window loses at most 1 − (1 − √3/16)² = 20 % to the quantisation.
constexpr double kWindowResolutions = 16.0;

// A span this many resolutions long loses at most √3/2 / 256 = 0.4 % to the play operators' start.
constexpr double kSpanResolutions = 256.0;

}  // namespace

void EnergyLedger::Play::follow(double x, double half_width) noexcept {
  const double before = position_m;
  if (x > position_m + half_width) {
    position_m = x - half_width;
  } else if (x < position_m - half_width) {
    position_m = x + half_width;
  }
  path_m += std::abs(position_m - before);
}

void EnergyLedger::restart(const Vector3& hand_position_m) noexcept {
  position_m_ = hand_position_m;
  carried_joule_ = 0.0;
  work_joule_ = 0.0;
  last_force_newton_.setZero();
  force_variation_newton_ = 0.0;
  has_force_ = false;
  closed_spans_path_m_ = 0.0;
  closed_windows_viscous_joule_ = 0.0;
  begin_span();
  begin_window();
}

void EnergyLedger::begin_span() noexcept {
  for (std::size_t i = 0; i < 3; ++i) play_[i] = {position_m_[static_cast<int>(i)], 0.0};
  closed_windows_path_m_ = 0.0;
}

void EnergyLedger::begin_window() noexcept {
  window_start_m_ = position_m_;
  window_s_ = 0.0;
}

void EnergyLedger::book(double duration_s, const Vector3& force_on_hand_newton,
                        const Vector3& hand_position_at_end_m) noexcept {
  const Vector3 f = -force_on_hand_newton;
  work_joule_ += f.dot(hand_position_at_end_m - position_m_);
  force_variation_newton_ += has_force_ ? (f - last_force_newton_).norm() : f.norm();
  last_force_newton_ = f;
  has_force_ = true;

  for (std::size_t i = 0; i < 3; ++i) {
    play_[i].follow(hand_position_at_end_m[static_cast<int>(i)], 0.5 * q_);
  }

  position_m_ = hand_position_at_end_m;
  window_s_ += duration_s;
  const double span_m = span_path_m();
  const bool ends_span = span_m >= kSpanResolutions * q_ && window_s_ > 0.0;
  if (ends_span ||
      ((position_m_ - window_start_m_).norm() >= kWindowResolutions * q_ && window_s_ > 0.0)) {
    closed_windows_path_m_ += window_path_m();
    closed_windows_viscous_joule_ += window_viscous_joule();
    begin_window();
  }
  if (ends_span) {
    closed_spans_path_m_ += span_m;
    begin_span();
  }
}

double EnergyLedger::window_path_m() const noexcept {
  return std::max(0.0, (position_m_ - window_start_m_).norm() - std::numbers::sqrt3 * q_);
}

double EnergyLedger::window_viscous_joule() const noexcept {
  if (!(window_s_ > 0.0)) return 0.0;
  const double moved = window_path_m();
  return f_d_ * moved * moved / window_s_;
}

void EnergyLedger::book_unread(double most_drawn_joule,
                               const Vector3& hand_position_at_end_m) noexcept {
  const double before = energy_joule();
  restart(hand_position_at_end_m);
  carried_joule_ = std::max(before - most_drawn_joule, std::min(before, 0.0));
}

void EnergyLedger::limit(double joule) noexcept {
  carried_joule_ -= std::max(0.0, energy_joule() - joule);
}

double EnergyLedger::span_path_m() const noexcept {
  double play_path2 = 0.0;
  for (const Play& play : play_) {
    const double path = std::max(0.0, play.path_m - 0.5 * q_);
    play_path2 += path * path;
  }
  return std::max(closed_windows_path_m_ + window_path_m(), std::sqrt(play_path2));
}

double EnergyLedger::dissipated_joule() const noexcept {
  return f_co_ * (closed_spans_path_m_ + span_path_m()) + closed_windows_viscous_joule_ +
         window_viscous_joule();
}

double EnergyLedger::energy_joule() const noexcept {
  const double quantisation =
      0.5 * std::numbers::sqrt3 * q_ * (last_force_newton_.norm() + force_variation_newton_);
  return carried_joule_ + work_joule_ - quantisation + dissipated_joule();
}

}  // namespace palpate::controllers
