// SPDX-License-Identifier: Apache-2.0
// force_guard.h — limits a command, or its absence, to what the motors may do. It is given the
// time and the force that acts, has no side effects, and only ever reduces the force.
#pragma once

#include <algorithm>
#include <cstdint>

#include "common/core/messages.h"
#include "common/core/vector.h"
#include "common/session/device_config.h"
#include "common/telemetry/device_telemetry.h"

namespace palpate::device {

/// The force that the motors are to apply.
struct GuardedForce {
  Vector3 force_on_hand_newton = Vector3::Zero();  ///< D
  Duration lease{};                                ///< longest time it may act
  GuardState state = GuardState::kLimp;
  bool is_limited = false;  ///< reduced by the peak or the slew limit
  /// False: do not write to the motors; the earlier command and its lease continue.
  bool is_switch = true;
  Vector3 wrist_torque_newton_m = Vector3::Zero();  ///< per joint, likewise
};

/// @param deadline  of the tick
/// @return          an answer to the reading at `read_at` begins to act by then, or not at all
[[nodiscard]] inline TimePoint latest_beginning(const ForceCommand& answer, TimePoint read_at,
                                                TimePoint deadline) noexcept {
  return answer.begins_within > Duration::zero()
             ? std::min(deadline, read_at + answer.begins_within)
             : deadline;
}

/// docs/theory.md §3, in this order:
///
///   before the first answer          no force                                     kLimp
///   answered                         the command, for its lease                   kAnswered
///   no answer, lease runs to the     the earlier command                          kLeased
///   next reading
///   lease over, or before that                       at most f_co, direction kept: the device's
///                                    own friction absorbs that, always passive    kFallback
///   silent for limp_after            that, linearly down to zero over `fade`      kFading
///   silent for limp_after + fade     no force                                     kLimp
///
/// Three limits reduce an answer, in this order:
///
///   limp start   leaving kLimp, the force grows from zero over start_ramp; where the lease ended
///                more than a period ago, it grows from the acting force over the time since
///   peak         |F| ≤ peak
///   slew         beyond what already acts along its direction, the force grows by at most slew ·
///                the time since the last answer, one period at most; what acts may always drop
///
/// So are the torques of a wrist, each joint by itself: its f_co, its peak, and its slew, from zero
/// to the peak in 2 ms.
///
/// A non-finite command is treated as zero and increments non_finite_commands.
class ForceGuard {
 public:
  /// @param device_peak_newton  the hardware's own limit; the smaller one holds
  /// @param ends_by_itself      a force, with its lease. False: nobody ends it before the next
  ///                            message, so that no lease is shorter than T_hold
  ForceGuard(const DeviceConfig& config, double device_peak_newton, bool ends_by_itself = true)
      : lease_(config.lease),
        least_lease_(ends_by_itself ? Duration::zero() : config.lease),
        longest_lease_(std::max(config.lease, config.longest_lease)),
        limp_after_(config.limp_after),
        fade_(config.fade),
        start_ramp_(config.start_ramp),
        period_(from_seconds(1.0 / config.rate_hz)),
        peak_newton_(std::min(config.peak_force_newton, device_peak_newton)),
        slew_newton_per_s_(config.slew_newton_per_s),
        coulomb_newton_(config.profile.coulomb_newton),
        wrist_(config.wrist.value_or(kNoWrist)) {}

  /// The answer to this tick has arrived and is applied at `now`.
  /// @param acting_newton    acts on the hand until then, D
  /// @param acting_newton_m  likewise, per joint of the wrist
  [[nodiscard]] GuardedForce answered(const ForceCommand& command, TimePoint now,
                                      Vector3 acting_newton,
                                      Vector3 acting_newton_m = Vector3::Zero()) noexcept {
    if (!has_answer_) {  // the push of a check is no beginning
      acting_newton.setZero();
      acting_newton_m.setZero();
    }
    GuardedForce out{.lease = std::clamp(command.valid_for, Duration::zero(), longest_lease_),
                     .state = GuardState::kAnswered};
    Vector3 force = command.force_on_hand_newton;
    Vector3 torque = command.wrist_torque_newton_m;
    const bool is_finite = force.allFinite() && torque.allFinite();
    if (!is_finite || out.lease == Duration::zero()) {
      if (!is_finite) ++non_finite_commands_;
      force.setZero();
      torque.setZero();
    }
    out.lease = std::max(out.lease, least_lease_);

    // limp start
    const Duration silence = now - answered_at_;
    if (!has_answer_ || silence >= limp_after_ + fade_) {
      ramp_from_ = now;
      ramp_ = start_ramp_;
    } else if (now > std::max(answer_lease_end_, answered_at_ + lease_) + period_) {
      ramp_from_ = now;
      ramp_ = std::min(start_ramp_, now - answer_lease_end_);
    }
    if (now - ramp_from_ < ramp_) {
      const double share = to_seconds(now - ramp_from_) / to_seconds(ramp_);
      force = limited_to_norm(force, std::max(acting_newton.norm(), share * force.norm()));
      torque = limited_per_component(
          torque, acting_newton_m.cwiseAbs().cwiseMax(share * torque.cwiseAbs()));
    }

    // device limits
    const double limit_newton =
        std::min(peak_newton_, slew_limit_newton(force, now, acting_newton));
    out.is_limited = force.norm() > limit_newton;
    out.force_on_hand_newton = limited_to_norm(force, limit_newton);
    out.wrist_torque_newton_m =
        limited_per_component(torque, torque_limit_newton_m(torque, now, acting_newton_m));
    out.is_limited = out.is_limited || out.wrist_torque_newton_m != torque;

    has_answer_ = true;
    answered_at_ = now;
    answer_newton_ = out.force_on_hand_newton;
    answer_newton_m_ = out.wrist_torque_newton_m;
    answer_lease_end_ = now + out.lease;
    return out;
  }

  /// No answer to this tick by its deadline, or none by the end of the lease. Lemma: fallback.
  /// @param next_reading  a lease that ends before it is given up at once, so that the position is
  ///                      read where the force ends
  [[nodiscard]] GuardedForce missed(TimePoint now, TimePoint next_reading) noexcept {
    GuardedForce out{.lease = 2 * period_};
    const Duration silence = now - answered_at_;
    if (has_answer_ && now < answer_lease_end_ && next_reading <= answer_lease_end_) {
      out.state = GuardState::kLeased;
      out.force_on_hand_newton = answer_newton_;
      out.wrist_torque_newton_m = answer_newton_m_;
      out.is_switch = false;
      return out;
    }
    answer_lease_end_ = std::min(answer_lease_end_, now);
    if (has_answer_ && silence < limp_after_ + fade_) {
      out.state = GuardState::kFallback;
      out.force_on_hand_newton = limited_to_norm(answer_newton_, coulomb_newton_);
      out.wrist_torque_newton_m =
          limited_per_component(answer_newton_m_, Vector3::Constant(wrist_.coulomb_newton_m));
      if (silence >= limp_after_) {
        out.state = GuardState::kFading;
        const double left = 1.0 - to_seconds(silence - limp_after_) / to_seconds(fade_);
        out.force_on_hand_newton *= left;
        out.wrist_torque_newton_m *= left;
      }
    }
    return out;
  }

  /// The monitor reduced the force or the lease just given, at the same instant.
  void reduced(const GuardedForce& less) noexcept {
    if (less.state != GuardState::kAnswered) return;
    answer_newton_ = less.force_on_hand_newton;
    answer_newton_m_ = less.wrist_torque_newton_m;
    answer_lease_end_ = answered_at_ + less.lease;
  }

  /// The answer just given began to act too late and the motors were released: nothing acts until
  /// the next answer. No limp start, since answers keep coming. Lemma: late_switch.
  void withdraw_answer() noexcept {
    answer_newton_.setZero();
    answer_newton_m_.setZero();
    answer_lease_end_ = answered_at_;
  }

  /// Motors were released: nothing acts until the next answer, which makes a limp start.
  void reset() noexcept { has_answer_ = false; }

  [[nodiscard]] std::uint64_t non_finite_commands() const noexcept { return non_finite_commands_; }

 private:
  /// Lemma: slew.
  [[nodiscard]] double slew_limit_newton(const Vector3& force, TimePoint now,
                                         const Vector3& acting_newton) const noexcept {
    const double norm = force.norm();
    if (slew_newton_per_s_ <= 0.0 || norm == 0.0) return peak_newton_;
    const double along_newton = acting_newton.dot(force) / norm;
    const double growth_s = to_seconds(std::min(now - answered_at_, period_));
    return std::max(0.0, along_newton) + slew_newton_per_s_ * growth_s;
  }

  /// Per joint, the smaller one of peak and slew. Lemma: slew.
  [[nodiscard]] Vector3 torque_limit_newton_m(const Vector3& torque, TimePoint now,
                                              const Vector3& acting_newton_m) const noexcept {
    const double growth_s = to_seconds(std::min(now - answered_at_, period_));
    const double growth_newton_m = wrist_.peak_torque_newton_m / kWristRise_s * growth_s;
    Vector3 limit;
    for (int i = 0; i < 3; ++i) {
      const double along = torque[i] < 0.0 ? -acting_newton_m[i] : acting_newton_m[i];
      limit[i] = std::min(wrist_.peak_torque_newton_m, std::max(0.0, along) + growth_newton_m);
    }
    return limit;
  }

  static constexpr double kWristRise_s = 2e-3;
  static constexpr WristProfile kNoWrist{.coulomb_newton_m = 0.0, .peak_torque_newton_m = 0.0};

  Duration lease_;
  Duration least_lease_;
  Duration longest_lease_;
  Duration limp_after_;
  Duration fade_;
  Duration start_ramp_;
  Duration period_;
  double peak_newton_;
  double slew_newton_per_s_;
  double coulomb_newton_;
  WristProfile wrist_;

  bool has_answer_ = false;
  TimePoint answered_at_{};
  TimePoint answer_lease_end_{};
  TimePoint ramp_from_{};
  Duration ramp_{};
  Vector3 answer_newton_ = Vector3::Zero();    ///< the last answer, after the limits
  Vector3 answer_newton_m_ = Vector3::Zero();  ///< likewise
  std::uint64_t non_finite_commands_ = 0;
};

}  // namespace palpate::device
