// SPDX-License-Identifier: Apache-2.0
/// @file
/// leased_pool.h — one pool of energy: books what acted, grants forces with the time for which the
/// pool covers them.
#pragma once

#include <limits>
#include <optional>

#include "energy_ledger.h"
#include "force_controller.h"
#include "lease_rule.h"
#include "one_pool_clamp.h"

namespace palpate::controllers {

/// Friction, resolution and times that a pool relies on.
struct LeasedPoolParameters {
  MofcParameters mofc;  ///< T: the time for which every command may act, T_hold
  std::optional<AxisFriction> per_axis = {};  ///< the friction, instead of mofc.f_d and mofc.f_co
  double resolution_m = 0.0;                  ///< q ≥ 0, of the position, per axis
  double delta_max_s = 0.0;      ///< δ_max ≥ 0: longest time from the reading to the switch
  double prompt_s = 0.0;         ///< δ_p: for answers within it first; 0: δ_max
  double longest_lease_s = 0.0;  ///< T_lease,max: no command acts longer; below T it counts as T
  double v_max_m_per_s = std::numeric_limits<double>::infinity();  ///< > 0, of the hand
  bool bridges_holes = false;  ///< while holes keep coming: only forces that last through them
};

/// The ledger and the rule that keeps E(t) ≥ 0 (docs/theory.md §2.5). With δ the longest time from
/// the reading until the answer replaces the force that acts, or the rest of its lease if that is
/// shorter:
///
///     F          the largest force along F_e with T drain(F) + δ drain(F_acting) ≤ E′, at δ = δ_p
///     δ          what E′ has left then, if F may act for 8 ms, within δ_p … δ_max: F begins by
///     then valid_for  (E′ − δ drain(F_acting)) / drain(F), within T … T_lease,max
///
/// A force that ends unread in a hole costs all of its lease. So a pool that bridges holes takes,
/// once that has happened, the length of recent ones for T in the first line, where T_lease,max
/// covers it.
/// Lemmas: hold_and_delay, residual_lease. No allocation, no throw.
class LeasedPool {
 public:
  /// Without credit. Does not check the parameters.
  explicit LeasedPool(const LeasedPoolParameters& parameters)
      : p_(parameters),
        clamp_(parameters.mofc, parameters.per_axis, parameters.v_max_m_per_s),
        ledger_(parameters.mofc, parameters.per_axis, parameters.resolution_m),
        rule_({.hold_s = parameters.mofc.T,
               .delta_max_s = parameters.delta_max_s,
               .prompt_s = parameters.prompt_s,
               .longest_lease_s = parameters.longest_lease_s}) {}

  /// Forgets everything; the next book() begins a ledger.
  void reset() noexcept {
    has_started_ = false;
    holes_ = {};
    has_ended_unread_ = false;
  }

  /// Books what acted since the previous step. After a gap no credit is left, a debt stays.
  Booked book(const ControlInput& input) noexcept;

  /// E′ ← min(E′, joule).
  void limit(double joule) noexcept { ledger_.limit(joule); }
  /// EnergyLedger::dissipated_joule.
  [[nodiscard]] double dissipated_joule() const noexcept { return ledger_.dissipated_joule(); }

  /// The force that the pool covers, with its lease; see above.
  /// @param input  the step that was booked last
  /// @param gate  0 … 1: granted share of the force beyond what friction alone absorbs
  [[nodiscard]] ControlOutput grant(const ControlInput& input, double gate = 1.0) const noexcept;

 private:
  std::size_t book_unread(const ControlInput& input, std::size_t first) noexcept;

  LeasedPoolParameters p_;
  OnePoolClamp clamp_;
  EnergyLedger ledger_;
  LeaseRule rule_;
  HoleLengths holes_{};
  bool has_ended_unread_ = false;  // a force, in this session: the device has no latch
  bool has_started_ = false;
};

}  // namespace palpate::controllers
