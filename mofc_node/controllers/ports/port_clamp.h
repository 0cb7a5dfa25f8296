// SPDX-License-Identifier: Apache-2.0
/// @file
/// port_clamp.h — the largest efforts on several ports that one pool of energy covers.
#pragma once

#include <span>

#include "ports.h"

namespace palpate::controllers {

/// The requested efforts, scaled: F_i = s_c F_e,i with one s in 0 … 1 for all ports of a priority
/// c. With e_i = (|F_i| − f_co,i)₊ a hand within v_max draws at most
///
///     drain(F) = Σ max_{v ≤ v_max,i} (e_i v − f_d,i v²)
///
/// in watts, whatever the units of the ports: no norm of N and N·m occurs. A hand that is at its
/// worst on every port at once draws just that. The lowest priority is reduced first, at most to
/// where its friction absorbs it, then the next; with one priority the effort is scaled as one
/// vector. Lemmas: port_drain, drain, drain_bounded_speed, gate, reduction. No allocation, no
/// throw.
class PortClamp {
 public:
  /// @param ports  1 … kMostPorts   @param hold_s  T_hold > 0
  PortClamp(std::span<const Port> ports, double hold_s);

  /// drain(F), ≥ 0, finite.
  [[nodiscard]] double drain_watt(const PortValues& effort_on_hand) const noexcept;
  /// Σ |F_i| v_max,i: no hand gets more power, whatever the friction. It compares efforts of
  /// different units.
  [[nodiscard]] double most_watt(const PortValues& effort_on_hand) const noexcept;

  /// The largest efforts along the requested ones with T_hold · drain(F) ≤ E′, to within 1e-9 of
  /// them, from below.
  /// @param requested_effort_on_hand  F_e, all finite
  /// @param energy_joule  E′; below 0 counts as 0
  /// @param gate  0 … 1: granted share of the efforts beyond what friction alone absorbs
  [[nodiscard]] PortValues clamp(const PortValues& requested_effort_on_hand, double energy_joule,
                                 double gate) const noexcept;

  /// PortOutput::most_effort.
  [[nodiscard]] PortValues most_effort(double energy_joule, double gate) const noexcept;

  /// How many ports there are.
  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  /// @param i  below count()
  [[nodiscard]] const Port& port(std::size_t i) const noexcept { return ports_[i]; }

 private:
  /// Of the ports of one priority, all scaled by s.
  struct Drain {
    double watt = 0.0;
    double watt_per_scale = 0.0;  // the slope there
  };
  [[nodiscard]] Drain drain_of(std::size_t rank, const PortValues& effort, double s) const noexcept;
  [[nodiscard]] double absorbed_scale(std::size_t rank, const PortValues& effort) const noexcept;
  [[nodiscard]] double paid_scale(std::size_t rank, const PortValues& effort, double absorbed,
                                  double rest_watt, double energy_joule) const noexcept;

  std::array<Port, kMostPorts> ports_{};
  std::array<std::size_t, kMostPorts> rank_{};  // 0: reduced first
  std::size_t count_ = 0;
  std::size_t ranks_ = 0;
  double hold_s_;
};

}  // namespace palpate::controllers
