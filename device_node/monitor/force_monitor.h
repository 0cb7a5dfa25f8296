// SPDX-License-Identifier: Apache-2.0
// force_monitor.h — the last gate before the motors: an independent check that the energy which the
// hand has put in covers each command for its whole lease (docs/theory.md §3.1).
#pragma once

#include <algorithm>

#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/session/device_config.h"
#include "device_node/monitor/energy_account.h"

namespace palpate::device {

/// Most power that a hand no faster than v_max draws while a force acts. Lemmas: drain,
/// drain_bounded_speed, drain_per_axis.
class WorstHand {
 public:
  /// @param v_max_m_per_s  > 0, may be infinite
  WorstHand(const DeviceProfile& profile, double v_max_m_per_s) noexcept
      : profile_(profile), v_max_m_per_s_(v_max_m_per_s) {}

  /// D(F), ≥ 0; 0 for a force of f_co up to rounding; infinite where neither viscous friction nor
  /// v_max bounds it. D(sF) grows with s.
  [[nodiscard]] double drain_watt(const Vector3& force_newton) const noexcept;
  /// Largest found s in 0 … 1 with D(sF) ≤ watt ≥ 0: exact for isotropic friction, else at most
  /// 1e-9 too small. Lemma: bound_bounded_speed.
  [[nodiscard]] double largest_scale(const Vector3& force_newton, double watt) const noexcept;
  [[nodiscard]] double v_max_m_per_s() const noexcept { return v_max_m_per_s_; }

 private:
  [[nodiscard]] double along_one_axis_watt(double excess_newton,
                                           double viscous_newton_s_per_m) const noexcept;

  DeviceProfile profile_;
  double v_max_m_per_s_;
};

/// Follows what acted and what was read on this device, and nothing else: neither the echo nor any
/// message of mofc_node. A command F with lease τ passes if
///
///   τ D(F) + min(δ, r) D(F_acting) ≤ M     at the reading of its tick
///
/// δ is the deadline of the answer, r the rest of the lease of the force that acts. Otherwise the
/// lease becomes shorter, not below T_hold, and if that is not enough the force smaller, direction
/// kept. So E(t) ≥ 0 whatever commands arrive, as in §2.5. Lemmas: hold_and_delay, residual_lease.
/// Up to 1 nJ and the drain of 1 ns, in which leases are counted, pass as rounding: once, since M
/// falls below 0 by what it cost. Lemma: rounding.
///
/// M is the largest of a floor and of two accounts. A force that acts for t costs at most t D(F),
/// so M falls by no more, whatever the readings' resolution adds to an account (lemma:
/// late_switch); a reading that only a hand faster than v_max can have made has no floor. One
/// account lasts; the other one, while no force acts, begins anew at M if it has fallen below. One
/// thread, no allocation, no throw.
class ForceMonitor {
 public:
  explicit ForceMonitor(const DeviceConfig& config) noexcept
      : lasting_(config.profile),
        recent_(config.profile),
        resolution_m_(config.profile.position_resolution_m),
        worst_hand_(config.profile, config.monitor.v_max_m_per_s),
        reply_(config.reply),
        hold_(config.lease) {}

  /// The reading of a tick. What follows in the tick is paid from the credit at this reading.
  void read(TimePoint at, const Vector3& position_m) noexcept;
  /// The force that acted ended by itself and the device latched this position.
  void ended(const Vector3& position_m) noexcept;
  /// A force begins to act, with the reading at that instant.
  void switched(TimePoint at, const Vector3& position_m, const Vector3& force_on_hand_newton,
                Duration lease) noexcept;
  /// The motors were released without a reading.
  void released(TimePoint at) noexcept;
  /// What happens from now until the next read() is not known: no credit is left, a debt stays,
  /// with what the commands since the last read() can still draw beyond M.
  void lost() noexcept { is_lost_ = true; }

  struct Covered {
    Vector3 force_on_hand_newton = Vector3::Zero();
    Duration lease{};
    bool is_reduced = false;
  };
  /// What is covered of a command that would begin to act in this tick.
  [[nodiscard]] Covered cover(const Vector3& force_on_hand_newton, Duration lease) noexcept;

  /// M at the last reading [J].
  [[nodiscard]] double joule() const noexcept {
    return std::max({lasting_.joule(), recent_.joule(), floor_joule_});
  }

 private:
  void settle(TimePoint at, const Vector3& position_m) noexcept;

  EnergyAccount lasting_;
  EnergyAccount recent_;
  double floor_joule_ = 0.0;
  double resolution_m_;
  WorstHand worst_hand_;
  Duration reply_;
  Duration hold_;

  bool is_lost_ = true;
  TimePoint since_{};                        ///< of the last reading
  Vector3 acting_newton_ = Vector3::Zero();  ///< since then,
  TimePoint lease_end_{};                    ///< until then
  double credit_joule_ = 0.0;                ///< left in this tick; below 0 a debt
};

}  // namespace palpate::device
