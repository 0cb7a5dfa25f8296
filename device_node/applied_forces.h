// applied_forces.h — the echo: which force acted from when to when, as DeviceState reports it.
#pragma once

#include <array>
#include <cstdint>

#include "common/core/check.h"
#include "common/core/messages.h"
#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate::device {

/// Collects the segments between two readings: in time order, without gaps or overlaps, none empty.
/// A force whose lease ends by itself is followed by a segment of zero force; the encoder is not
/// read at that instant, so the first of the two has no position at its end.
///
/// At most kMaxAppliedForces: one switch per tick, and each of the two forces may run out or be
/// released.
class AppliedForces {
 public:
  /// The first reading of a session: the echo begins here.
  void begin(TimePoint at) noexcept {
    PALPATE_ASSERT(!has_begun_);
    has_begun_ = true;
    since_ = at;
  }
  [[nodiscard]] bool has_begun() const noexcept { return has_begun_; }

  /// The force changes to `force` for at most `lease`; the position was read at that instant.
  void switched(TimePoint at, const Vector3& position_m, const Vector3& force,
                Duration lease) noexcept {
    read(at, position_m);
    force_ = force;
    lease_end_ = at + lease;
  }

  /// A position was read at `at`: the segment that ends there is finished.
  void read(TimePoint at, const Vector3& position_m) noexcept {
    run_out(at);
    end_segment(at);
    if (count_ == 0) return;
    AppliedForce& last = segments_[count_ - 1];
    if (last.until == at) {
      last.hand_position_at_end_m = position_m;
      last.has_position_at_end = true;
    }
  }

  /// Motors released at `at`, no position read.
  void released(TimePoint at) noexcept {
    run_out(at);
    if (!force_.isZero(0.0)) end_force(at);
  }

  /// Moves the finished segments into `state`.
  void move_to(DeviceState& state) noexcept {
    state.applied = segments_;
    state.applied_count = count_;
    count_ = 0;
  }

 private:
  /// Splits at the end of the lease if that has passed by `at`.
  void run_out(TimePoint at) noexcept {
    if (lease_end_ < at && !force_.isZero(0.0)) end_force(lease_end_);
  }
  void end_force(TimePoint at) noexcept {
    end_segment(at);
    force_.setZero();
  }
  void end_segment(TimePoint at) noexcept {
    if (at <= since_) return;
    PALPATE_ASSERT(count_ < kMaxAppliedForces);
    segments_[count_++] = {
        .force_on_hand_newton = force_, .from = since_, .until = at, .has_position_at_end = false};
    since_ = at;
  }

  std::array<AppliedForce, kMaxAppliedForces> segments_{};
  std::uint32_t count_ = 0;
  bool has_begun_ = false;
  TimePoint since_{};
  Vector3 force_ = Vector3::Zero();
  TimePoint lease_end_{};
};

}  // namespace palpate::device
