// SPDX-License-Identifier: Apache-2.0
// force_monitor.h — the last gate before the motors: an independent check that the energy which the
// hand has put in covers each command for its whole lease (docs/theory.md §3.1).
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/session/device_config.h"
#include "device_node/monitor/energy_account.h"
#include "device_node/monitor/work_bound.h"

namespace palpate::device {

/// Most power that a hand no faster than v_max draws while a force acts. Lemmas: drain,
/// drain_bounded_speed, drain_per_axis.
class WorstHand {
 public:
  /// @param fastest  v_max > 0, may be infinite; that of each axis by itself only with friction
  ///                 per axis
  WorstHand(const DeviceProfile& profile, const MonitorConfig& fastest) noexcept
      : profile_(profile), fastest_(fastest) {}
  WorstHand(const DeviceProfile& profile, double v_max_m_per_s) noexcept
      : WorstHand(profile, MonitorConfig{.v_max_m_per_s = v_max_m_per_s}) {}

  /// D(F), ≥ 0; 0 for a force of f_co up to rounding; infinite where neither viscous friction nor
  /// v_max bounds it. D(sF) grows with s.
  [[nodiscard]] double drain_watt(const Vector3& force_newton) const noexcept;
  /// Largest found s in 0 … 1 with D(sF) ≤ watt ≥ 0: exact for isotropic friction, else at most
  /// 1e-9 too small. Lemma: bound_bounded_speed.
  [[nodiscard]] double largest_scale(const Vector3& force_newton, double watt) const noexcept;
  /// All axes together.
  [[nodiscard]] double fastest_m_per_s() const noexcept { return fastest_.fastest_m_per_s(); }

  /// Every member, to be written to a file or read from one: state_text.h.
  template <class Archive>
  void list(Archive& archive) {
    archive(profile_.viscous_newton_s_per_m);
    archive(profile_.coulomb_newton);
    archive(profile_.position_resolution_m);
    bool has_axes = profile_.per_axis.has_value();
    archive(has_axes);
    FrictionPerAxis axes = profile_.per_axis.value_or(FrictionPerAxis{});
    archive(axes.viscous_newton_s_per_m);
    archive(axes.coulomb_newton);
    if constexpr (Archive::kIsReading) {
      profile_.per_axis = has_axes ? std::optional<FrictionPerAxis>(axes) : std::nullopt;
    }
    archive(fastest_.v_max_m_per_s);
    archive(fastest_.is_v_max_per_axis);
  }

 private:
  [[nodiscard]] double along_one_axis_watt(double excess_newton,
                                           double viscous_newton_s_per_m) const noexcept;

  DeviceProfile profile_;
  MonitorConfig fastest_;
};

/// The joints of a device's wrist as the axes of a device, rad for m and N·m for N: their monitor
/// is one of these, too.
/// @param config  has a wrist
[[nodiscard]] DeviceConfig wrist_as_axes(const DeviceConfig& config) noexcept;

/// What the motors do when nobody tells them anything.
struct MotorEnds {
  /// A force ends with its lease. False: it goes on until the next reading, switch or release, and
  /// may end at any time after its lease.
  bool are_by_themselves = true;
  /// No two places of the hand are further apart [m]: what a force that nobody ends can draw.
  double reach_m = std::numeric_limits<double>::infinity();
  /// DeviceSpecification::held_force_ratio: what a force is elsewhere, if its end is not seen.
  double held_ratio = 1.0;
  double turning_per_m = 0.0;  ///< DeviceSpecification::turning_per_m
};

/// What a reading says beside the position.
struct ReadingDetails {
  Duration skew{};                          ///< reading and switch may be apart by so much
  double turning_joule = 0.0;               ///< DeviceSample::turning_joule
  Vector3 turned_newton = Vector3::Zero();  ///< DeviceSample::turned_newton
  /// Of a reading, where forces do not end by themselves: what acts from it on.
  std::optional<Vector3> acting_newton = {};
};

/// Follows what acted and what was read on this device, and nothing else: neither the echo nor any
/// message of mofc_node. A command F with lease τ passes if
///
///   (τ + s) D(F) + (min(δ, r) + s) D(F_acting) ≤ M     at the reading of its tick
///
/// δ is the deadline that the answer names, or that of the device, r the rest of the lease of the
/// force that acts, s the skew of reading and switch. Otherwise the lease becomes shorter, not
/// below T_hold, and if that is not enough the force smaller, direction kept. So E(t) ≥ 0 whatever
/// commands arrive, as in §2.5, while no force outlives its lease; a force that did is booked for
/// as long as it can have acted. Lemmas: hold_and_delay, residual_lease, release_between, skew. Up
/// to 1 nJ and the drain of 1 ns, in which leases are counted, pass as rounding: once, since M
/// falls below 0 by what it cost. Lemma: rounding.
///
/// M is the largest of a floor and of two accounts. A force that acts for t costs at most t D(F)
/// and what its currents did more as the arm turned, so M falls by no more, whatever the readings'
/// resolution adds to an account (lemma: late_switch); a reading that only a hand faster than v_max
/// can have made has no floor. One account lasts; the other one, while no force acts and none can
/// have since the position was taken, begins anew at M if it has fallen below. WorkBound, which
/// counts in another way, judges M and the clamp's ledger. One thread, no allocation, no throw.
class ForceMonitor {
 public:
  explicit ForceMonitor(const DeviceConfig& config, const MotorEnds& ends = {}) noexcept
      : lasting_(config.profile, v_skew(config), ends.turning_per_m),
        recent_(config.profile, v_skew(config), ends.turning_per_m),
        bound_(config, ends.are_by_themselves),
        resolution_m_(config.profile.position_resolution_m),
        v_skew_m_per_s_(v_skew(config)),
        worst_hand_(config.profile, config.monitor),
        most_newton_(config.peak_force_newton),
        reply_(config.reply),
        hold_(config.lease),
        period_s_(1.0 / config.rate_hz),
        ends_(ends) {}

  /// The reading of a tick. What follows in the tick is paid from the credit at this reading.
  void read(TimePoint at, const Vector3& position_m, const ReadingDetails& details = {}) noexcept;
  /// The force that acted ended by itself and the device latched this position.
  void ended(const Vector3& position_m) noexcept;
  /// A force begins to act, with the reading at that instant.
  void switched(TimePoint at, const Vector3& position_m, const Vector3& force_on_hand_newton,
                Duration lease, const ReadingDetails& details = {}) noexcept;
  /// A switch to this force failed: it may act, or the one before.
  void failed(const Vector3& force_on_hand_newton) noexcept;
  /// The motors were released by `at`, as the device confirmed, without a reading.
  void released(TimePoint at) noexcept;
  /// The last reading was so much longer ago than the clock says.
  void slept(Duration duration) noexcept { since_ -= duration; }
  /// After released(): what happens from now until the next read() is not known: no credit is left,
  /// a debt stays, with what the commands since the last read() can have drawn beyond M.
  void lost() noexcept;

  /// The command that cover() gets next has begun to act by then after the reading of its tick, or
  /// never will; the other forces of this tick draw nothing.
  void begins_within(Duration within) noexcept;
  /// What is left in this tick for cover(); below 0 a debt. Of two monitors whose ports pay for
  /// each other the sum counts: one gives the other what it has.
  [[nodiscard]] double credit_joule() const noexcept { return credit_joule_; }
  void set_credit(double joule) noexcept { credit_joule_ = joule; }
  struct Covered {
    Vector3 force_on_hand_newton = Vector3::Zero();
    Duration lease{};
    bool is_reduced =
        false;  ///< more than the turning of held currents, which no clamp knows, asks
  };
  /// The part of a command that the credit covers this tick.
  [[nodiscard]] Covered cover(const Vector3& force_on_hand_newton, Duration lease) noexcept;

  /// M at the last reading [J].
  [[nodiscard]] double joule() const noexcept {
    return std::max({lasting_.joule(), recent_.joule(), floor_joule_});
  }
  /// What of it a clamp may count on, which knows neither skew nor turning [J].
  [[nodiscard]] double coverable_joule() const noexcept;

  /// M is at most what the hand can have put in. False: the account, or the memory that holds it,
  /// is wrong.
  [[nodiscard]] bool is_account_plausible() const noexcept {
    return joule() <= bound_.joule() + kToleranceJoule;
  }
  /// Whether a clamp may count on so much at the last read(), with what the hand can have put into
  /// other ports. NaN: it counts on nothing.
  [[nodiscard]] bool is_ledger_plausible(double ledger_joule,
                                         double others_joule = 0.0) const noexcept {
    return !(ledger_joule > account_at_most_joule() + others_joule + kToleranceJoule);
  }
  [[nodiscard]] double account_at_most_joule() const noexcept {
    return bound_.account_at_most_joule();
  }

  /// Every member, to be written to a file or read from one: state_text.h.
  template <class Archive>
  void list(Archive& archive) {
    lasting_.list(archive);
    recent_.list(archive);
    bound_.list(archive);
    archive(floor_joule_);
    archive(resolution_m_);
    archive(v_skew_m_per_s_);
    worst_hand_.list(archive);
    archive(most_newton_);
    archive(reply_);
    archive(hold_);
    archive(period_s_);
    archive(ends_.are_by_themselves);
    archive(ends_.reach_m);
    archive(ends_.held_ratio);
    archive(ends_.turning_per_m);
    archive(is_lost_);
    archive(since_);
    archive(acting_newton_);
    archive(first_end_);
    archive(last_end_);
    archive(acted_until_);
    archive(skew_s_);
    archive(covered_watt_);
    archive(credit_joule_);
    archive(reserved_newton_);
    archive(reserved_);
    archive(failed_newton_);
  }

 private:
  static constexpr double kUncovered = std::numeric_limits<double>::infinity();
  static constexpr double kToleranceJoule = 1e-6;

  /// Of a mode without v_max a hand that device_node takes for a fault.
  [[nodiscard]] static double v_skew(const DeviceConfig& config) noexcept {
    const double v_max = config.monitor.fastest_m_per_s();
    return v_max < config.v_fault_m_per_s ? v_max : config.v_fault_m_per_s;
  }
  void settle(TimePoint at, const Vector3& position_m, const ReadingDetails& details) noexcept;
  void acts(const Vector3& force_on_hand_newton) noexcept;
  /// What this force can draw within that time: t D(F), and of held currents κ |F| v² t (t + T)
  /// more, as the arm turns from where it was a period T before [J].
  [[nodiscard]] double most_joule(const Vector3& force_newton, double duration_s) const noexcept {
    const double drain = worst_hand_.drain_watt(force_newton);
    return drain == 0.0 ? 0.0 : duration_s * drain + turning_joule(force_newton, duration_s);
  }
  [[nodiscard]] double paid_s(const Vector3& force_newton, double joule,
                              double most_s) const noexcept;
  [[nodiscard]] double turning_joule(const Vector3& force_newton,
                                     double duration_s) const noexcept {
    const double way_m = v_skew_m_per_s_ * duration_s;
    return ends_.turning_per_m * force_newton.norm() * way_m *
           (way_m + v_skew_m_per_s_ * period_s_);
  }
  /// D of a force that may have ended anywhere, or become another one there [W].
  [[nodiscard]] double drain_elsewhere_watt(const Vector3& force_newton) const noexcept {
    if (force_newton.isZero(0.0)) return 0.0;
    if (!std::isfinite(ends_.held_ratio)) return std::numeric_limits<double>::infinity();
    return worst_hand_.drain_watt(ends_.held_ratio * force_newton);
  }

  EnergyAccount lasting_;
  EnergyAccount recent_;
  WorkBound bound_;
  double floor_joule_ = 0.0;
  double resolution_m_;
  double v_skew_m_per_s_;
  WorstHand worst_hand_;
  double most_newton_;
  Duration reply_;
  Duration hold_;
  double period_s_;
  MotorEnds ends_;

  bool is_lost_ = true;
  TimePoint since_{};                          ///< of the last reading
  Vector3 acting_newton_ = Vector3::Zero();    ///< since then,
  TimePoint first_end_{};                      ///< until then at least
  TimePoint last_end_{};                       ///< and then at most
  TimePoint acted_until_{};                    ///< the last force, by the commands
  double skew_s_ = 0.0;                        ///< of the last reading
  double covered_watt_ = kUncovered;           ///< D of what cover() let pass last in this tick
  double credit_joule_ = 0.0;                  ///< left in this tick; below 0 a debt
  Vector3 reserved_newton_ = Vector3::Zero();  ///< of it is reserved what this draws,
  Duration reserved_{};                        ///< acting for so long after the last read()
  std::optional<Vector3> failed_newton_;       ///< may act
};

}  // namespace palpate::device
