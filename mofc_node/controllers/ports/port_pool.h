// SPDX-License-Identifier: Apache-2.0
/// @file
/// port_pool.h — one pool of energy for several ports: books what acted, grants efforts with the
/// time for which the pool covers them.
#pragma once

#include <span>

#include "energy_count.h"
#include "lease_rule.h"
#include "port_clamp.h"
#include "ports.h"

namespace palpate::controllers {

/// Lower bound E′ of E(t) = Σ ∫ (friction + rendered effort resisting the hand)·v dt over the
/// ports: a count for each, with its own friction and encoder (EnergyCount). Joules of different
/// ports add up, whatever their units. No allocation, no throw.
class PortLedger {
 public:
  /// @param ports  1 … kMostPorts
  explicit PortLedger(std::span<const Port> ports);

  /// Starts again with E′ = 0 at this measured position.
  void restart(const PortValues& position) noexcept;
  /// Books an interval during which one effort acted. Of a port with a doubt R, less what a
  /// displacement that is wrong by R can count too much: (|F| + f_co + f_d (2 v_max + R/T)) R; an
  /// interval of no duration that has one costs all credit. Lemma: port_doubt.
  void book(const PortStretch& stretch) noexcept;

  /// An effort that acted for `acted_s`, then none for the rest of `duration_s`.
  struct Release {
    PortValues effort_on_hand{};    ///< F, that acted
    double acted_s = 0.0;           ///< s ≥ 0
    double duration_s = 0.0;        ///< T ≥ s
    PortValues position_at_end{};   ///< measured, at the end of T
    double most_drawn_joule = 0.0;  ///< ≥ 0, upper bound of what the hand drew
  };
  /// EnergyLedger::book_release on every port by itself. Lemmas: release_reach, release_energy.
  void book_release(const Release& release) noexcept;
  /// EnergyLedger::book_unread.
  void book_unread(double most_drawn_joule, const PortValues& position_at_end) noexcept;
  /// Starts again after an interval of which nothing is known: E′ ← min(E′, 0).
  void forfeit(const PortValues& position) noexcept;
  /// E′ ← min(E′, joule). Lemma: cap.
  void limit(double joule) noexcept;

  /// E′ of all that is booked.
  [[nodiscard]] double energy_joule() const noexcept;
  /// Dissipated by friction since the last restart, on the paths that are sure.
  [[nodiscard]] double dissipated_joule() const noexcept;
  /// Measured, where the last booked interval ended.
  [[nodiscard]] const PortValues& position() const noexcept { return position_; }

 private:
  using Count = EnergyCount<1>;
  [[nodiscard]] double doubt_joule(const PortStretch& stretch) const noexcept;
  [[nodiscard]] double release_joule(std::size_t i, const Release& release) const noexcept;

  std::array<Port, kMostPorts> ports_{};
  std::array<Count, kMostPorts> counts_{};
  std::size_t count_ = 0;
  PortValues position_{};
  double carried_joule_ = 0.0;  // from before the last restart, with releases and what limit() took
};

/// The ledger and the rule that keeps E(t) ≥ 0: LeasedPool for ports. One that bridges holes.
class PortPool {
 public:
  /// Without credit. Does not check the parameters.
  PortPool(std::span<const Port> ports, const LeaseTimes& times)
      : clamp_(ports, times.hold_s), ledger_(ports), rule_(times), hold_s_(times.hold_s) {}
  /// Forgets everything; the next book() begins a ledger.
  void reset() noexcept {
    has_started_ = false;
    holes_ = {};
    has_ended_unread_ = false;
  }

  /// Books what acted since the previous step. After a gap no credit is left, a debt stays.
  Booked book(const PortInput& input) noexcept;

  /// E′ ← min(E′, joule).
  void limit(double joule) noexcept { ledger_.limit(joule); }
  /// PortLedger::dissipated_joule.
  [[nodiscard]] double dissipated_joule() const noexcept { return ledger_.dissipated_joule(); }
  /// That of the ports.
  [[nodiscard]] const PortClamp& clamp() const noexcept { return clamp_; }

  /// The efforts that the pool covers, with their lease.
  /// @param input  the step that was booked last
  /// @param requested  its request, all finite   @param gate  0 … 1
  [[nodiscard]] PortOutput grant(const PortInput& input, const PortValues& requested,
                                 double gate) const noexcept;

 private:
  std::size_t book_unread(const PortInput& input, std::size_t first) noexcept;

  PortClamp clamp_;
  PortLedger ledger_;
  LeaseRule rule_;
  HoleLengths holes_{};
  double hold_s_;
  bool has_ended_unread_ = false;
  bool has_started_ = false;
};

}  // namespace palpate::controllers
