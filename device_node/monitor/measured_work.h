// SPDX-License-Identifier: Apache-2.0
// measured_work.h — whether motors that measure what they do did what the accounts count
// (docs/theory.md §3.1): measured force × displacement, beside commanded force × displacement.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "common/core/vector.h"
#include "common/session/device_config.h"

namespace palpate::device {

/// Of a stretch between two messages, F the force that the accounts count, m₀ and m₁ the forces
/// that the device measured at its ends, Δx the way of the hand:
///
///   e = Σᵢ min((m₀ᵢ − Fᵢ) Δxᵢ, (m₁ᵢ − Fᵢ) Δxᵢ)      what the accounts count too much
///   c = max(0, c + e − (¼ |F| + f_co) |Δx|)
///
/// c above 2 mJ: motors without supply, reversed, or stronger than they say, also those that become
/// so in the run. A measurement that is wrong by a quarter and by f_co besides is no finding, and
/// the friction absorbs what is within f_co. No windows; counts in whole nanometres, micronewtons
/// and femtojoules. A device that never measured more than f_co is taken for one that measures
/// nothing. No allocation, no throw.
class MeasuredWork {
 public:
  explicit MeasuredWork(const DeviceConfig& config) noexcept
      : coulomb_un_(static_cast<std::int64_t>(
            kMicronewtons * (config.profile.per_axis
                                 ? config.profile.per_axis->coulomb_newton.maxCoeff()
                                 : config.profile.coulomb_newton))) {}

  /// The next message has none before it.
  void begin() noexcept {
    has_before_ = false;
    excess_fj_ = 0;
  }

  /// @param counted_newton   acts from this message on, by the accounts
  /// @param measured_newton  now; none: the device measures nothing
  /// @return                 false: the motors do not do what the accounts count
  [[nodiscard]] bool message(const Vector3& position_m, const Vector3& counted_newton,
                             const std::optional<Vector3>& measured_newton) noexcept {
    if (!measured_newton) return true;
    Stretch now;
    if (!to_whole(position_m, kNanometres, kMost_nm, now.position_nm) ||
        !to_whole(counted_newton, kMicronewtons, kMost_un, now.counted_un) ||
        !to_whole(*measured_newton, kMicronewtons, kMost_un, now.measured_un)) {
      has_before_ = false;
      return true;  // judged elsewhere
    }
    does_measure_ = does_measure_ || length(now.measured_un) > static_cast<double>(coulomb_un_);
    if (has_before_ && does_measure_) count(now);
    before_ = now;
    has_before_ = true;
    return excess_fj_ <= kMost_fj;
  }

 private:
  using Whole = std::array<std::int64_t, 3>;
  struct Stretch {
    Whole position_nm{};
    Whole counted_un{};
    Whole measured_un{};
  };
  static constexpr double kNanometres = 1e9;
  static constexpr double kMicronewtons = 1e6;
  static constexpr double kMost_nm = 4e9;
  static constexpr double kMost_un = 1e8;
  static constexpr std::int64_t kMost_fj = 2'000'000'000'000;

  static bool to_whole(const Vector3& vector, double per_unit, double most, Whole& whole) noexcept {
    for (std::size_t i = 0; i < 3; ++i) {
      const double scaled = per_unit * vector[static_cast<Eigen::Index>(i)];
      if (!(std::abs(scaled) <= most)) return false;
      whole[i] = std::llround(scaled);
    }
    return true;
  }
  static double length(const Whole& vector) noexcept {
    return Vector3(static_cast<double>(vector[0]), static_cast<double>(vector[1]),
                   static_cast<double>(vector[2]))
        .norm();
  }
  void count(const Stretch& now) noexcept {
    Whole moved_nm{};
    std::int64_t excess_fj = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      moved_nm[i] = now.position_nm[i] - before_.position_nm[i];
      excess_fj += std::min((before_.measured_un[i] - before_.counted_un[i]) * moved_nm[i],
                            (now.measured_un[i] - before_.counted_un[i]) * moved_nm[i]);
    }
    const double allowed_un = 0.25 * length(before_.counted_un) + static_cast<double>(coulomb_un_);
    excess_fj -= static_cast<std::int64_t>(allowed_un * length(moved_nm));
    excess_fj_ = std::clamp<std::int64_t>(excess_fj_ + excess_fj, 0, 2 * kMost_fj);
  }

  std::int64_t coulomb_un_;
  bool does_measure_ = false;
  bool has_before_ = false;
  Stretch before_;
  std::int64_t excess_fj_ = 0;
};

}  // namespace palpate::device
