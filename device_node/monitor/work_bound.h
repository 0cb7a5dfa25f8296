// SPDX-License-Identifier: Apache-2.0
// work_bound.h — an upper bound of what any account of the hand's energy may say, by another way
// than the accounts (docs/theory.md §3.1): the energy of one hand that made all these readings.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/session/device_config.h"

namespace palpate::device {

/// An account is a lower bound for every hand that can have made the readings. So it may not exceed
/// the energy U of any one of them. Here it is the hand that moved least: on each axis the output p
/// of a play operator of half-width q/2, which is always within q/2 of the reading, and straight
/// from one to the next, with the friction of the profile and nothing more:
///
///   U = Σ −F·Δp + friction along Δp
///
/// F is what the motors said that they gave, for as long as it acted. U has no windows, no error
/// terms and no restarts but those of the device, and counts in whole nanometres, micronewtons and
/// femtojoules, rounded up. Where Δp is faster than v_max, which the accounts rule out, U grows by
/// what that can make them differ. No allocation, no throw.
class WorkBound {
 public:
  /// @param ends_by_themselves  forces end with their lease, or else with the next reading
  WorkBound(const DeviceConfig& config, bool ends_by_themselves) noexcept;

  /// A reading. @param acting_newton  what acts from it on, where the device says so
  void read(TimePoint at, const Vector3& position_m,
            const std::optional<Vector3>& acting_newton = {}) noexcept;
  /// The force ended with its lease, and this position was read there.
  void ended(const Vector3& position_m) noexcept;
  /// A reading, from which on this force acts.
  void switched(TimePoint at, const Vector3& position_m, const Vector3& force_on_hand_newton,
                Duration lease) noexcept;
  /// No force acts from `at` on.
  void released(TimePoint at) noexcept;
  /// What happens until the next reading is not known: U begins anew there, at 0.
  void lost() noexcept;

  /// U at the last reading [J]; infinite if a reading or a force was absurd (4 m, 1 kN).
  [[nodiscard]] double joule() const noexcept;
  /// U at the last read(), above the least that it was by then: the most that an account can say
  /// that began at any reading, with nothing [J].
  [[nodiscard]] double account_at_most_joule() const noexcept { return at_most_joule_; }

  /// Every member, to be written to a file or read from one: state_text.h.
  template <class Archive>
  void list(Archive& archive) {
    archive(ends_by_themselves_);
    archive(half_width_nm_);
    archive(v_max_m_per_s_);
    archive(is_per_axis_);
    for (Whole* const whole : {&coulomb_un_, &viscous_uns_per_m_, &force_un_, &witness_nm_}) {
      for (std::int64_t& x : *whole) archive(x);
    }
    archive(has_begun_);
    archive(is_unknown_);
    archive(since_);
    archive(lease_end_);
    archive(end_);
    archive(energy_.joules);
    archive(energy_.femtojoules);
    archive(least_joule_);
    archive(at_most_joule_);
  }

 private:
  using Whole = std::array<std::int64_t, 3>;

  struct WholeEnergy {
    std::int64_t joules = 0;
    std::int64_t femtojoules = 0;  ///< what is left, either sign

    void add(std::int64_t femtojoule) noexcept;
    [[nodiscard]] double joule() const noexcept {
      return static_cast<double>(joules) + 1e-15 * static_cast<double>(femtojoules);
    }
  };

  void settle(TimePoint at, const Vector3& position_m) noexcept;
  void acts(const Vector3& force_newton) noexcept;
  [[nodiscard]] bool to_whole(const Vector3& vector, double per_unit, double most,
                              Whole& whole) noexcept;
  [[nodiscard]] Whole follow(const Whole& position_nm) noexcept;
  [[nodiscard]] std::int64_t friction_fj(const Whole& moved_nm, double duration_s) const noexcept;

  bool ends_by_themselves_;
  std::int64_t half_width_nm_;
  double v_max_m_per_s_;  // may be infinite
  bool is_per_axis_;
  Whole coulomb_un_{};  // isotropic: the first
  Whole viscous_uns_per_m_{};

  bool has_begun_ = false;
  bool is_unknown_ = false;
  TimePoint since_{};
  TimePoint lease_end_{};
  TimePoint end_{};  // of the force
  Whole force_un_{};
  Whole witness_nm_{};
  WholeEnergy energy_;
  double least_joule_ = 0.0;
  double at_most_joule_ = 0.0;
};

}  // namespace palpate::device
