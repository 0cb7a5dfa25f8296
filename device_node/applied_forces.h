// SPDX-License-Identifier: Apache-2.0
// applied_forces.h — which force acts, and which acted from when to when: the echo that DeviceState
// reports. The only place where the tick keeps it; the monitor keeps its own on purpose.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>

#include "common/core/messages.h"
#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/telemetry/device_telemetry.h"

namespace palpate::device {

/// Collects the segments since the newest reading that mofc_node has answered: in time order,
/// without gaps or overlaps, none empty. A force whose lease ends by itself is followed by a
/// segment of zero force; unless the device has latched the position, the encoder was not read at
/// that instant, and the first of the two has no position at its end.
///
/// Keeps the newest kMaxAppliedForces: a receiver that missed older segments sees a gap.
class AppliedForces {
 public:
  /// @param ends_by_itself  whether a force ends with its lease, whatever this process does
  explicit AppliedForces(bool ends_by_itself = true) noexcept : ends_by_itself_(ends_by_itself) {}

  /// The first reading of a session: the echo begins here.
  void begin(TimePoint at) noexcept {
    has_begun_ = true;
    since_ = at;
  }
  [[nodiscard]] bool has_begun() const noexcept { return has_begun_; }

  /// The force changes to `force` for at most `lease`; the position was read at that instant.
  /// @param wrist  its angles, and what acts there from then on; none: no wrist
  void switched(TimePoint at, const Vector3& position_m, const Vector3& force, Duration lease,
                const std::optional<WristState>& wrist = {}) noexcept {
    read(at, position_m, wrist);
    force_ = force;
    if (wrist) torque_newton_m_ = wrist->acting_torque_newton_m;
    lease_end_ = at + lease;
  }

  /// Whether the force ended by itself before `at`, and that is not yet recorded.
  [[nodiscard]] bool has_run_out(TimePoint at) const noexcept {
    return ends_by_itself_ && lease_end_ < at && is_acting();
  }
  /// The force ended by itself, and the device latched the position.
  void ran_out(const Vector3& position_m, const std::optional<WristState>& wrist = {}) noexcept {
    read(lease_end_, position_m, wrist);
    clear();
  }

  /// A position was read at `at`: the segment that ends there is finished.
  void read(TimePoint at, const Vector3& position_m,
            const std::optional<WristState>& wrist = {}) noexcept {
    run_out(at);
    if (has_outlived_its_lease(at)) return lose(at);
    end_segment(at);
    if (count_ == 0) return;
    AppliedForce& last = segments_[count_ - 1];
    if (last.until == at) {
      last.hand_position_at_end_m = position_m;
      if (wrist) last.wrist_angle_at_end_rad = wrist->pose.angle_rad;
      last.has_position_at_end = true;
    }
  }

  /// Of motors without a watchdog: what acts from the position just read on.
  void acts_on(const Vector3& force) noexcept { force_ = force; }

  /// The device confirmed that it released the motors by `at`; no position read.
  void released(TimePoint at) noexcept {
    run_out(at);
    if (has_outlived_its_lease(at)) {
      lose(at);
      clear();
    } else if (is_acting()) {
      end_force(at);
    }
  }

  /// mofc_node knows what acted until `at`.
  void acknowledged(TimePoint at) noexcept {
    const auto first = std::find_if(segments_.begin(), segments_.begin() + count_,
                                    [&](const AppliedForce& s) { return s.until > at; });
    std::move(first, segments_.begin() + count_, segments_.begin());
    count_ -= static_cast<std::uint32_t>(first - segments_.begin());
  }

  /// Copies what is not yet acknowledged into `state`, and the force that acts at its reading.
  void report_in(DeviceState& state) const noexcept {
    std::copy_n(segments_.begin(), count_, state.applied.begin());
    state.applied_count = count_;
    state.acting_force_on_hand_newton = force_;
    if (state.wrist) state.wrist->acting_torque_newton_m = torque_newton_m_;
    state.acting_until = std::max(state.header.sampled_at, lease_end_);
  }

  /// What acted in (since, until], for telemetry: the newest kMaxActedForces of it. `until` is the
  /// last reading, or a later instant, at which no position was read.
  void report_in(DeviceTick& tick, TimePoint since, TimePoint until) noexcept {
    run_out(until);
    end_segment(until);
    const auto end = segments_.begin() + count_;
    auto first = std::find_if(segments_.begin(), end,
                              [&](const AppliedForce& s) { return s.until > since; });
    first = std::max(first, end - std::min(end - first, std::ptrdiff_t{kMaxActedForces}));
    tick.acted_count =
        static_cast<std::uint32_t>(std::copy(first, end, tick.acted.begin()) - tick.acted.begin());
  }

  /// What acts at `at`, which is not before the last switch; none after its lease.
  [[nodiscard]] Vector3 acting_newton(TimePoint at) const noexcept {
    return at < lease_end_ ? force_ : Vector3(Vector3::Zero());
  }
  /// Likewise, per joint of the wrist.
  [[nodiscard]] Vector3 acting_newton_m(TimePoint at) const noexcept {
    return at < lease_end_ ? torque_newton_m_ : Vector3(Vector3::Zero());
  }
  /// When the acting force ends by itself; TimePoint::max() while none acts.
  [[nodiscard]] TimePoint lease_end() const noexcept {
    return is_acting() ? lease_end_ : TimePoint::max();
  }

 private:
  /// Splits at the end of the lease if that has passed by `at`.
  void run_out(TimePoint at) noexcept {
    if (has_run_out(at)) end_force(lease_end_);
  }
  [[nodiscard]] bool has_outlived_its_lease(TimePoint at) const noexcept {
    return !ends_by_itself_ && lease_end_ < at && since_ < at && is_acting();
  }
  [[nodiscard]] bool is_acting() const noexcept {
    return !force_.isZero(0.0) || !torque_newton_m_.isZero(0.0);
  }
  void clear() noexcept {
    force_.setZero();
    torque_newton_m_.setZero();
  }
  /// It is not known what acted until `at`.
  void lose(TimePoint at) noexcept {
    count_ = 0;
    since_ = at;
  }
  void end_force(TimePoint at) noexcept {
    end_segment(at);
    clear();
  }
  void end_segment(TimePoint at) noexcept {
    if (at <= since_) return;
    if (count_ == kMaxAppliedForces) acknowledged(segments_[0].until);
    segments_[count_++] = {.force_on_hand_newton = force_,
                           .from = since_,
                           .until = at,
                           .has_position_at_end = false,
                           .wrist_torque_newton_m = torque_newton_m_};
    since_ = at;
  }

  std::array<AppliedForce, kMaxAppliedForces> segments_{};
  bool ends_by_itself_;
  std::uint32_t count_ = 0;
  bool has_begun_ = false;
  TimePoint since_{};
  Vector3 force_ = Vector3::Zero();
  Vector3 torque_newton_m_ = Vector3::Zero();  // per joint of the wrist
  TimePoint lease_end_{};
};

}  // namespace palpate::device
