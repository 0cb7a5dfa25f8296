// SPDX-License-Identifier: Apache-2.0
/// @file
/// port_guard.h — mode guard for joints, grips and axes: one pool, a hand of bounded speed, bounded
/// credit.
#pragma once

#include <array>

#include "leak_gate.h"
#include "lease_rule.h"
#include "port_pool.h"
#include "ports.h"

namespace palpate::controllers {

/// The ports and the settings of their guard. Symbols as in docs/theory.md §2.7.
struct PortGuardParameters {
  std::array<Port, kMostPorts> ports{};  ///< the first `count` of them
  std::size_t count = 0;                 ///< 1 … kMostPorts, of ports
  LeaseTimes times{};                    ///< T_hold, δ_max, δ_p, T_lease,max
  double credit_cap_joule = 5e-3;        ///< S_cap > 0: credit beyond what the environment stores
  double contact_credit_joule = 0.0;     ///< S_c ≥ 0: work of this contact that counts as stored
  double gate_joule = 10e-3;             ///< S_g > 0: leak that closes the gate
  double gate_recovery_s = 0.5;          ///< t_rec > 0: time constant with which it opens

  /// The ports that are used.
  [[nodiscard]] std::span<const Port> used() const noexcept {
    return {ports.data(), count < kMostPorts ? count : kMostPorts};
  }
};

/// Raises cap, gate and contact credit to what one hold of the largest efforts can leak, as a
/// session does for three axes: at low rates an effort that is held between two readings leaks more
/// than the cap, and would be cut off.
/// @param parameters  to raise   @param peak_effort  ≥ 0, of the motors, per port
[[nodiscard]] PortGuardParameters raised_for_one_hold(PortGuardParameters parameters,
                                                      const PortValues& peak_effort);

/// Mode `guard` (GuardMofc) for up to eight ports of any units: E(t) ≥ 0 for all t, any hand within
/// v_max on every port, any request. What is requested may come from anywhere: a wrench through the
/// transposed Jacobian of the measured pose, the follower arm, a number that is wrong. An effort
/// that is not plausible counts as no effort on any port.
///
/// A reading that no hand of twice v_max explains (an angle that wraps, a joint that reports
/// another one's, a position unlike the end of the last stretch, one that changes in no time) is a
/// gap: it costs the credit.
///
/// The rest is as in GuardMofc, with the power Σ |F_i| v_max,i in place of |F| where the gate
/// compares efforts. step() once per reading: no allocation, no lock, no throw. One thread.
class PortGuard {
 public:
  /// Without credit, the gate open. Does not check the parameters.
  explicit PortGuard(const PortGuardParameters& parameters);
  /// Returns to the initial state, for a new device session.
  void reset() noexcept;
  /// Books what acted, limits the credit, and grants efforts with their lease. Every number of the
  /// input but the requested efforts, acting_lease_s and energy_limit_joule must be plausible.
  [[nodiscard]] PortOutput step(const PortInput& reported) noexcept;

 private:
  /// What the readings say of the hand.
  struct Motion {
    bool is_too_fast = false;    // surely faster than v_max on some port
    bool is_impossible = false;  // surely faster than any hand
  };
  [[nodiscard]] Motion follow(const PortInput& input) const noexcept;
  void note_motion(const PortInput& input, const Motion& motion, double elapsed_s) noexcept;
  void update_gate(const PortInput& input, const PortValues& requested, double elapsed_s) noexcept;

  double credit_cap_joule_;
  double contact_credit_joule_;
  PortPool pool_;
  LeakGate gate_;
  bool has_begun_ = false;
  double contact_work_joule_ = 0.0;  // W_c
  PortValues position_{};            // x of the step before
  PortValues moved_since_fresh_{};   // Δx since F_e was last evaluated
  PortValues requested_{};           // that F_e
};

}  // namespace palpate::controllers
