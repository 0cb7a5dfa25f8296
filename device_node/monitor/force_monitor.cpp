// SPDX-License-Identifier: Apache-2.0
#include "device_node/monitor/force_monitor.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "device_node/monitor/assumption_watch.h"

namespace palpate::device {
namespace {

constexpr double kRoundingJoule = 1e-9;  // below 0, in all
constexpr double kUlps = 4.0 * std::numeric_limits<double>::epsilon();
/// Less than the rounding of a force that was scaled to f_co.
constexpr double kExact = 1.0 - kUlps;
constexpr double kLeaseRoundingS = 1e-9;  // leases travel in whole nanoseconds

}  // namespace

DeviceConfig wrist_as_axes(const DeviceConfig& config) noexcept {
  const WristProfile& wrist = *config.wrist;
  DeviceConfig axes = config;
  axes.wrist.reset();
  axes.profile = {.viscous_newton_s_per_m = wrist.viscous_newton_m_s_per_rad,
                  .coulomb_newton = wrist.coulomb_newton_m,
                  .position_resolution_m = wrist.angle_resolution_rad,
                  .per_axis = FrictionPerAxis{
                      .viscous_newton_s_per_m = Vector3::Constant(wrist.viscous_newton_m_s_per_rad),
                      .coulomb_newton = Vector3::Constant(wrist.coulomb_newton_m)}};
  axes.monitor.v_max_m_per_s = wrist.v_max_rad_per_s;
  axes.monitor.is_v_max_per_axis = true;
  axes.peak_force_newton = wrist.peak_torque_newton_m;
  return axes;
}

// --- the worst hand -------------------------------------------------------------------------

/// Maximum of e v − f_d v² over 0 ≤ v ≤ v_max.
double WorstHand::along_one_axis_watt(double excess_newton,
                                      double viscous_newton_s_per_m) const noexcept {
  if (!(excess_newton > 0.0)) return 0.0;
  const double fastest = std::min(fastest_.v_max_m_per_s,
                                  0.5 * excess_newton / viscous_newton_s_per_m);  // f_d = 0: v_max
  if (!std::isfinite(fastest)) return fastest;
  return (excess_newton - viscous_newton_s_per_m * fastest) * fastest;
}

double WorstHand::drain_watt(const Vector3& force_newton) const noexcept {
  if (!profile_.per_axis) {
    return along_one_axis_watt(kExact * force_newton.norm() - profile_.coulomb_newton,
                               profile_.viscous_newton_s_per_m);
  }
  const FrictionPerAxis& friction = *profile_.per_axis;
  const Vector3 excess = (kExact * force_newton.cwiseAbs() - friction.coulomb_newton).cwiseMax(0.0);
  double sum = 0.0;
  for (int i = 0; i < 3; ++i) {
    sum += along_one_axis_watt(excess[i], friction.viscous_newton_s_per_m[i]);
  }
  if (fastest_.is_v_max_per_axis) return sum;
  return std::min(sum,
                  along_one_axis_watt(excess.norm(), friction.viscous_newton_s_per_m.minCoeff()));
}

double WorstHand::largest_scale(const Vector3& force_newton, double watt) const noexcept {
  if (drain_watt(force_newton) <= watt) return 1.0;
  if (!profile_.per_axis) {
    // e²/(4 f_d) = watt, or (e − f_d v_max) v_max = watt
    const double viscous = profile_.viscous_newton_s_per_m;
    const bool is_at_v_max = watt > viscous * fastest_.v_max_m_per_s * fastest_.v_max_m_per_s;
    const double excess = is_at_v_max
                              ? viscous * fastest_.v_max_m_per_s + watt / fastest_.v_max_m_per_s
                              : 2.0 * std::sqrt(viscous * watt);
    return std::min(1.0, (profile_.coulomb_newton + excess) / force_newton.norm());
  }
  constexpr int kHalvings = 30;
  double covered = 0.0;
  double uncovered = 1.0;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (covered + uncovered);
    (drain_watt(middle * force_newton) <= watt ? covered : uncovered) = middle;
  }
  return covered;
}

// --- the monitor ----------------------------------------------------------------------------

void ForceMonitor::read(TimePoint at, const Vector3& position_m,
                        const ReadingDetails& details) noexcept {
  bound_.read(at, position_m, details.acting_newton);
  settle(at, position_m, details);
  if (details.acting_newton) acts(*details.acting_newton);
  covered_watt_ = kUncovered;
  // less all that the acting force can draw until it is replaced
  credit_joule_ = joule();
  reserved_newton_ = acting_newton_;
  reserved_ = std::min(reply_, first_end_ - at);
  const double rest_s = to_seconds(reserved_) + skew_s_;
  if (rest_s > 0.0) credit_joule_ -= most_joule(acting_newton_, rest_s);
}

void ForceMonitor::begins_within(Duration within) noexcept {
  if (within >= reserved_) return;
  const double rest_s = to_seconds(within) + skew_s_;
  credit_joule_ += most_joule(reserved_newton_, to_seconds(reserved_) + skew_s_);
  if (rest_s > 0.0) credit_joule_ -= most_joule(reserved_newton_, rest_s);
  reserved_ = within;
}

void ForceMonitor::ended(const Vector3& position_m) noexcept {
  bound_.ended(position_m);
  settle(first_end_, position_m, {});
}

void ForceMonitor::switched(TimePoint at, const Vector3& position_m,
                            const Vector3& force_on_hand_newton, Duration lease,
                            const ReadingDetails& details) noexcept {
  bound_.switched(at, position_m, force_on_hand_newton, lease);
  const double expected_skew_s = skew_s_;
  settle(at, position_m, details);
  // more than was covered: motors that round up, a transfer that took longer than the one before
  const double drain = worst_hand_.drain_watt(force_on_hand_newton);
  if (drain > covered_watt_) credit_joule_ -= to_seconds(lease) * (drain - covered_watt_);
  if (skew_s_ > expected_skew_s) {
    const double lease_s = to_seconds(lease);
    credit_joule_ -= most_joule(force_on_hand_newton, lease_s + skew_s_) -
                     most_joule(force_on_hand_newton, lease_s + expected_skew_s);
  }
  acts(force_on_hand_newton);
  first_end_ = at + lease;
  last_end_ = ends_.are_by_themselves ? first_end_ : TimePoint::max();
}

/// Until the switch is complete, both forces may act within the skew: no floor without them.
void ForceMonitor::acts(const Vector3& force_on_hand_newton) noexcept {
  if (skew_s_ > 0.0 && force_on_hand_newton != acting_newton_) {
    floor_joule_ -= most_joule(acting_newton_, skew_s_) + most_joule(force_on_hand_newton, skew_s_);
  }
  acting_newton_ = force_on_hand_newton;
}

void ForceMonitor::failed(const Vector3& force_on_hand_newton) noexcept {
  failed_newton_ = force_on_hand_newton;
}

void ForceMonitor::released(TimePoint at) noexcept {
  bound_.released(at);
  first_end_ = std::min(first_end_, at);
  last_end_ = std::min(last_end_, at);
}

void ForceMonitor::lost() noexcept {
  bound_.lost();
  is_lost_ = true;
  if (ends_.are_by_themselves || last_end_ <= since_) return;
  // the lease of each command is paid; beyond that the force went on until its release. Lemma:
  // failed_release.
  for (const Vector3& force : {acting_newton_, failed_newton_.value_or(Vector3::Zero())}) {
    const double drain = drain_elsewhere_watt(force);
    if (drain == 0.0) continue;
    credit_joule_ -= std::min(to_seconds(last_end_ - since_) * drain,
                              ends_.held_ratio * force.norm() * ends_.reach_m);
  }
}

/// Less what forces draw beyond drain and time: the one that acts, until it is replaced, and the
/// largest for T_hold.
double ForceMonitor::coverable_joule() const noexcept {
  const double now_joule = joule();
  if (skew_s_ == 0.0 && ends_.turning_per_m == 0.0) return now_joule;
  const auto beyond_joule = [&](const Vector3& force_newton, double acting_s) {
    const double drain = worst_hand_.drain_watt(force_newton);
    return drain == 0.0 ? 0.0 : most_joule(force_newton, acting_s + skew_s_) - acting_s * drain;
  };
  return now_joule - beyond_joule(acting_newton_, std::max(0.0, to_seconds(reserved_))) -
         beyond_joule(Vector3(most_newton_, 0.0, 0.0), to_seconds(hold_));
}

/// The longest time up to `most_s` in which this force draws no more than that: t D + κ|F| v² t (t
/// + T).
double ForceMonitor::paid_s(const Vector3& force_newton, double joule,
                            double most_s) const noexcept {
  const double drain = worst_hand_.drain_watt(force_newton);
  const double square =
      ends_.turning_per_m * force_newton.norm() * v_skew_m_per_s_ * v_skew_m_per_s_;
  const double linear = drain + square * period_s_;
  if (!(joule > 0.0)) return 0.0;
  if (most_s * (linear + square * most_s) <= joule) return most_s;
  // t = 2 C/(b + √(b² + 4 a C)), without cancellation
  return 2.0 * joule / (linear + std::sqrt(linear * linear + 4.0 * square * joule));
}

ForceMonitor::Covered ForceMonitor::cover(const Vector3& force_on_hand_newton,
                                          Duration lease) noexcept {
  Covered covered{.force_on_hand_newton = force_on_hand_newton, .lease = lease};
  const double drain = covered_watt_ = worst_hand_.drain_watt(force_on_hand_newton);
  const double lease_s = to_seconds(lease);
  const double drained_joule = (lease_s + skew_s_ - kLeaseRoundingS) * drain;
  if (drain == 0.0 || drained_joule + turning_joule(force_on_hand_newton, lease_s + skew_s_) <=
                          credit_joule_ + kRoundingJoule) {
    credit_joule_ -= most_joule(force_on_hand_newton, lease_s + skew_s_);
    return covered;
  }
  covered.is_reduced = drained_joule > credit_joule_ + kRoundingJoule;
  const double paid = paid_s(force_on_hand_newton, credit_joule_, lease_s + skew_s_) - skew_s_;
  covered.lease = std::max(std::min(lease, hold_),
                           Duration(static_cast<std::int64_t>(1e9 * std::max(0.0, paid))));
  const double acting_s = to_seconds(covered.lease) + skew_s_;
  const double left = std::max(0.0, credit_joule_ - turning_joule(force_on_hand_newton, acting_s));
  const double scale = worst_hand_.largest_scale(force_on_hand_newton, left / acting_s);
  covered.is_reduced = covered.is_reduced || scale < kExact;
  covered.force_on_hand_newton *= scale;
  covered_watt_ = worst_hand_.drain_watt(covered.force_on_hand_newton);
  credit_joule_ = std::min(credit_joule_, 0.0);  // all of it is spent; a debt stays
  return covered;
}

/// Books what acted up to this reading.
void ForceMonitor::settle(TimePoint at, const Vector3& position_m,
                          const ReadingDetails& details) noexcept {
  const double skew_s = to_seconds(details.skew);
  for (EnergyAccount* const account : {&lasting_, &recent_}) {
    account->next_reading(skew_s, details.turning_joule, details.turned_newton);
  }
  if (is_lost_) {
    is_lost_ = false;
    floor_joule_ = std::min(0.0, std::isfinite(credit_joule_) ? credit_joule_ : joule());
    lasting_.restart(position_m, floor_joule_);
    recent_.restart(position_m, floor_joule_);
    acting_newton_.setZero();
    failed_newton_.reset();
    since_ = at;
    skew_s_ = skew_s;
    return;
  }
  if (at <= since_) return;
  if (last_end_ <= since_) acting_newton_.setZero();
  const bool is_idle = acting_newton_.isZero(0.0);
  const double duration_s = to_seconds(at - since_);
  const double acted_s = std::max(0.0, to_seconds(std::min(at, first_end_) - since_));
  const double acted_at_most_s = to_seconds(std::min(at, last_end_) - since_);
  const double worst_skew_s = std::max(skew_s_, skew_s);
  const bool is_end_unseen = first_end_ < at && !is_idle;
  double most_drawn_joule = 0.0;
  if (!is_idle) {
    const double most_s = acted_at_most_s + worst_skew_s;
    most_drawn_joule = std::max(0.0, details.turning_joule) +
                       (is_end_unseen ? most_s * drain_elsewhere_watt(acting_newton_)
                                      : most_joule(acting_newton_, most_s));
  }
  floor_joule_ = joule();
  if (most_drawn_joule > 0.0) {
    floor_joule_ -= most_drawn_joule + kUlps * (std::abs(floor_joule_) + most_drawn_joule);
  }
  if (is_too_fast(position_m - lasting_.position_m(), duration_s + worst_skew_s,
                  worst_hand_.fastest_m_per_s(), resolution_m_)) {
    floor_joule_ = -std::numeric_limits<double>::infinity();
  }
  for (EnergyAccount* const account : {&lasting_, &recent_}) {
    if (is_end_unseen) {
      account->book_release({.force_on_hand_newton = acting_newton_,
                             .acted_s = acted_s,
                             .acted_at_most_s = acted_at_most_s,
                             .duration_s = duration_s,
                             .position_at_end_m = position_m,
                             .v_max_m_per_s = worst_hand_.fastest_m_per_s(),
                             .held_ratio = ends_.held_ratio,
                             .most_drawn_joule = most_drawn_joule});
    } else {
      account->book(duration_s, acting_newton_, position_m);
    }
  }
  if (!is_idle) acted_until_ = at;
  // a position that may be older than the end of the last force is no beginning. Lemma: begin_anew.
  const bool is_quiet = is_idle && to_seconds(at - acted_until_) >= worst_skew_s;
  if (is_quiet && recent_.has_worked() && recent_.joule() < joule()) {
    recent_.restart(position_m, joule());
  }
  since_ = at;
  skew_s_ = skew_s;
}

}  // namespace palpate::device
