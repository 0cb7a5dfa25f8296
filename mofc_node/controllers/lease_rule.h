// SPDX-License-Identifier: Apache-2.0
/// @file
/// lease_rule.h — for how long, and from when, what a pool has left covers a force.
#pragma once

#include <algorithm>
#include <array>

namespace palpate::controllers {

/// How long the device goes without a reading, again and again. A hole is a time between two
/// readings that is longer than T_hold; there are none until three have come within the last 1 … 2
/// s. No allocation, no throw.
class HoleLengths {
 public:
  /// @param duration_s  ≥ 0, between two readings   @param hold_s  T_hold
  void note(double duration_s, double hold_s) noexcept;
  /// The longest of them; 0 where they are too few.
  [[nodiscard]] double longest_s() const noexcept;

 private:
  struct Span {
    double longest_s = 0.0;
    int count = 0;
  };
  std::array<Span, 2> spans_{};  // the present one, the one before
  double span_s_ = 0.0;          // of the present one
};

/// What one step of a pool has booked.
struct Booked {
  double elapsed_s = 0.0;   ///< 0 where it is not known what acted
  double work_joule = 0.0;  ///< −Σ F·Δx: done by the hand against F, where the ends were read
};

/// Times that a pool relies on.
struct LeaseTimes {
  double hold_s = 0.001;         ///< T_hold > 0: the time for which every command may act
  double delta_max_s = 0.0;      ///< δ_max ≥ 0: longest time from the reading to the switch
  double prompt_s = 0.0;         ///< δ_p: for answers within it first; 0: δ_max
  double longest_lease_s = 0.0;  ///< T_lease,max: no command acts longer; below T_hold it counts so
};

/// (★) of docs/theory.md §2.5, in energies and powers alone, so for any number of axes: first
/// reserve() what the force that acts may still take, then choose a force F with covered_s
/// drain(F) ≤ E′ − spent, then lease() it. Lemmas: hold_and_delay, residual_lease. No allocation,
/// no throw.
class LeaseRule {
 public:
  /// Does not check the times.
  explicit LeaseRule(const LeaseTimes& times) : p_(times) {}

  /// What is set aside for the force that acts at t_k, and how long the answer has to last.
  struct Reserve {
    double energy_joule;  ///< E′
    double acting_s;      ///< rest of the lease of F_acting
    double acting_watt;   ///< drain(F_acting)
    double delta_s;       ///< δ
    double spent_joule;   ///< δ drain(F_acting), or what its lease leaves of that
    double covered_s;     ///< for how long the answer must be covered, ≥ T_hold
  };
  /// Sets aside what the force that acts may still take.
  /// @param energy_joule  E′   @param acting_lease_s  ≥ 0, rest of the lease of F_acting
  /// @param acting_watt  drain(F_acting)
  /// @param hole_s  of holes that keep coming, which the answer is to last through; 0: none
  [[nodiscard]] Reserve reserve(double energy_joule, double acting_lease_s, double acting_watt,
                                double hole_s) const noexcept {
    const double acting_s = std::max(0.0, acting_lease_s);
    const double delta_s =
        p_.prompt_s > 0.0 ? std::min(p_.prompt_s, p_.delta_max_s) : p_.delta_max_s;
    return {.energy_joule = energy_joule,
            .acting_s = acting_s,
            .acting_watt = acting_watt,
            .delta_s = delta_s,
            .spent_joule = spent(delta_s, acting_s, acting_watt),
            // in holes that keep coming no force is worth more than one that lasts to their end
            .covered_s = hole_s <= longest_s() ? std::max(p_.hold_s, hole_s) : p_.hold_s};
  }

  /// What T_hold drain(F) may be at most.
  [[nodiscard]] double credit_joule(const Reserve& r) const noexcept {
    return (r.energy_joule - r.spent_joule) * (p_.hold_s / r.covered_s);
  }

  /// How long the answer may act, and by when it must have begun.
  struct Lease {
    double lease_s;          ///< T_hold … T_lease,max
    double begins_within_s;  ///< δ
  };
  /// Grants F its times.
  /// @param r  of this step   @param drain_watt  drain(F), covered_s drain(F) being covered
  [[nodiscard]] Lease lease(const Reserve& r, double drain_watt) const noexcept {
    // for as long as it is paid, and as late
    const double kept_s = std::max(r.covered_s, std::min(longest_s(), kKeptLease_s));
    const double spare = r.energy_joule - r.spent_joule - kept_s * drain_watt;
    double delta_s = r.delta_s;
    if (r.acting_watt > 0.0) delta_s += std::max(0.0, spare) / r.acting_watt;
    // beyond the rest of its lease the acting force costs no more
    if (r.acting_watt == 0.0 || delta_s >= std::min(r.acting_s, p_.delta_max_s))
      delta_s = p_.delta_max_s;
    const double left = r.energy_joule - spent(delta_s, r.acting_s, r.acting_watt);
    const double paid_s = drain_watt > 0.0 ? std::max(0.0, left) / drain_watt : longest_s();
    // what was kept is paid, but for rounding
    const double least_s = spare > 0.0 ? kept_s : p_.hold_s;
    return {.lease_s = paid_s > least_s ? std::min(paid_s, longest_s()) : least_s,
            .begins_within_s = delta_s};
  }

 private:
  /// Most pauses of a machine are shorter: to last through them is worth more than to begin late.
  static constexpr double kKeptLease_s = 8e-3;

  [[nodiscard]] static double spent(double within_s, double acting_s, double acting_watt) noexcept {
    const double left_s = std::min(acting_s, within_s);
    return left_s > 0.0 ? left_s * acting_watt : 0.0;
  }
  [[nodiscard]] double longest_s() const noexcept {
    return std::max(p_.hold_s, p_.longest_lease_s);
  }

  LeaseTimes p_;
};

}  // namespace palpate::controllers
