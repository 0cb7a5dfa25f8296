// SPDX-License-Identifier: Apache-2.0
#include "device_node/monitor/work_bound.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::device {
namespace {

constexpr double kNanometres = 1e9;
constexpr double kMicronewtons = 1e6;
constexpr double kMost_nm = 4e9;
constexpr double kMost_un = 1e9;
constexpr double kMost_fj = 8e18;  // of one stretch: no sum overflows
constexpr std::int64_t kFemtojoulesPerJoule = 1'000'000'000'000'000;
constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;

/// Upwards, of what is not negative.
std::int64_t whole_above(double value, double most) {
  return static_cast<std::int64_t>(std::ceil(std::clamp(value, 0.0, most)));
}

double length(const std::array<std::int64_t, 3>& vector) {
  return Vector3(static_cast<double>(vector[0]), static_cast<double>(vector[1]),
                 static_cast<double>(vector[2]))
      .norm();
}

}  // namespace

WorkBound::WorkBound(const DeviceConfig& config, bool ends_by_themselves) noexcept
    : ends_by_themselves_(ends_by_themselves),
      half_width_nm_(static_cast<std::int64_t>(
          std::clamp(0.5 * kNanometres * config.profile.position_resolution_m, 0.0, kMost_nm))),
      v_max_m_per_s_(config.monitor.fastest_m_per_s()),
      is_per_axis_(config.profile.per_axis.has_value()) {
  const DeviceProfile& profile = config.profile;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    coulomb_un_[i] =
        whole_above(kMicronewtons * (profile.per_axis ? profile.per_axis->coulomb_newton[axis]
                                                      : profile.coulomb_newton),
                    kMost_un);
    viscous_uns_per_m_[i] = whole_above(
        kMicronewtons * (profile.per_axis ? profile.per_axis->viscous_newton_s_per_m[axis]
                                          : profile.viscous_newton_s_per_m),
        kMost_un);
  }
}

void WorkBound::read(TimePoint at, const Vector3& position_m,
                     const std::optional<Vector3>& acting_newton) noexcept {
  settle(at, position_m);
  if (acting_newton) acts(*acting_newton);
  const double now_joule = joule();
  least_joule_ = std::min(least_joule_, now_joule);
  at_most_joule_ = now_joule - least_joule_;
}

void WorkBound::ended(const Vector3& position_m) noexcept { settle(end_, position_m); }

void WorkBound::switched(TimePoint at, const Vector3& position_m,
                         const Vector3& force_on_hand_newton, Duration lease) noexcept {
  settle(at, position_m);
  acts(force_on_hand_newton);
  lease_end_ = at + lease;
  end_ = ends_by_themselves_ ? lease_end_ : TimePoint::max();
}

void WorkBound::released(TimePoint at) noexcept {
  lease_end_ = std::min(lease_end_, at);
  end_ = std::min(end_, at);
}

void WorkBound::lost() noexcept { has_begun_ = false; }

double WorkBound::joule() const noexcept {
  if (is_unknown_) return std::numeric_limits<double>::infinity();
  return energy_.joule();
}

void WorkBound::settle(TimePoint at, const Vector3& position_m) noexcept {
  Whole position_nm{};
  if (!to_whole(position_m, kNanometres, kMost_nm, position_nm)) return;
  if (!has_begun_) {
    has_begun_ = true;
    witness_nm_ = position_nm;
    force_un_ = {};
    since_ = at;
    energy_ = {};
    least_joule_ = 0.0;
    return;
  }
  if (at <= since_) return;
  if (end_ <= since_) force_un_ = {};
  const WholeEnergy before = energy_;
  const double duration_s = to_seconds(at - since_);
  const bool is_whole = at <= end_;
  const double share = is_whole ? 1.0 : to_seconds(end_ - since_) / duration_s;
  const Whole moved_nm = follow(position_nm);
  for (std::size_t i = 0; i < 3; ++i) {
    if (force_un_[i] == 0) continue;
    // while the force acted; rounded by at most 1 nm, and the force by at most 1 µN
    const std::int64_t under_force_nm =
        is_whole ? moved_nm[i] : std::llround(share * static_cast<double>(moved_nm[i]));
    energy_.add(std::abs(moved_nm[i]) - force_un_[i] * under_force_nm);
    if (!is_whole) energy_.add(std::abs(force_un_[i]));
  }
  energy_.add(friction_fj(moved_nm, duration_s));
  since_ = at;
  // what a hand of any speed did after the lease is not known: the accounts go on without it
  if (lease_end_ >= at || std::isfinite(v_max_m_per_s_)) return;
  const WholeEnergy kept = before.joule() < 0.0 ? before : WholeEnergy{};
  if (energy_.joule() < kept.joule()) energy_ = kept;
}

/// Rounding of the witness's positions costs at most 1 nm times each change.
void WorkBound::acts(const Vector3& force_newton) noexcept {
  Whole force_un{};
  if (!to_whole(force_newton, kMicronewtons, kMost_un, force_un)) return;
  for (std::size_t i = 0; i < 3; ++i) energy_.add(std::abs(force_un[i] - force_un_[i]));
  force_un_ = force_un;
}

bool WorkBound::to_whole(const Vector3& vector, double per_unit, double most,
                         Whole& whole) noexcept {
  for (std::size_t i = 0; i < 3; ++i) {
    const double scaled = per_unit * vector[static_cast<Eigen::Index>(i)];
    if (!(std::abs(scaled) <= most)) {
      is_unknown_ = true;
      return false;
    }
    whole[i] = std::llround(scaled);
  }
  return true;
}

/// Moves the witness as little as this reading allows. @return how far
WorkBound::Whole WorkBound::follow(const Whole& position_nm) noexcept {
  Whole moved_nm{};
  for (std::size_t i = 0; i < 3; ++i) {
    const std::int64_t held = std::clamp(witness_nm_[i], position_nm[i] - half_width_nm_,
                                         position_nm[i] + half_width_nm_);
    moved_nm[i] = held - witness_nm_[i];
    witness_nm_[i] = held;
  }
  return moved_nm;
}

std::int64_t WorkBound::friction_fj(const Whole& moved_nm, double duration_s) const noexcept {
  const auto along = [&](double length_nm, std::size_t i) {
    const double viscous_un =
        1e-9 * static_cast<double>(viscous_uns_per_m_[i]) * length_nm / duration_s;
    return length_nm * (static_cast<double>(coulomb_un_[i]) + viscous_un);
  };
  const double length_nm = length(moved_nm);
  double sum = 0.0;
  if (is_per_axis_) {
    for (std::size_t i = 0; i < 3; ++i) sum += along(std::abs(static_cast<double>(moved_nm[i])), i);
  } else {
    sum = along(length_nm, 0);
  }
  // a hand that the accounts rule out
  const double too_far_nm = length_nm - kNanometres * v_max_m_per_s_ * duration_s;
  if (too_far_nm > 0.0) sum += too_far_nm * length(force_un_);
  return whole_above(sum, kMost_fj);
}

void WorkBound::WholeEnergy::add(std::int64_t femtojoule) noexcept {
  femtojoules += femtojoule;
  joules += femtojoules / kFemtojoulesPerJoule;
  femtojoules %= kFemtojoulesPerJoule;
}

}  // namespace palpate::device
