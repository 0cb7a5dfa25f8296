// SPDX-License-Identifier: Apache-2.0
// frozen_watch.h — positions that repeat exactly although a force acts that a hand would give way
// to: an encoder or a service that stands still.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>

#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/session/device_config.h"

namespace palpate::device {

/// Readings stand still if all of them are the same to the nanometre
///
///   while a force above f_co acts without a pause, for 250 ms: a hand that pushes trembles; or
///   for 30 ms after the force changed by more than 0.5 N and more than 2 f_co + 4 q · 3000 N/m
///   since the first of them: a hand has no more stiffness than that.
///
/// False alarm: an arm that lies at its end stop, leans on something, or is held by more friction
/// than the profile knows. Unseen: readings that stand still while no such force acts, or on some
/// axes only. No allocation, no throw.
class FrozenWatch {
 public:
  explicit FrozenWatch(const DeviceConfig& config) noexcept
      : coulomb_newton_(config.profile.coulomb_newton),
        change_newton_(
            std::max(0.5, 2.0 * coulomb_newton_ + 4.0 * config.profile.position_resolution_m *
                                                      kStiffestHand_newton_per_m)),
        v_max_m_per_s_(std::min(config.monitor.v_max_m_per_s, config.v_fault_m_per_s)),
        rounding_m_(std::sqrt(3.0) * config.profile.position_resolution_m) {}

  /// What was before no longer counts.
  void begin() noexcept { has_reading_ = is_frozen_ = false; }

  /// A reading, and the force that acted since the one before.
  /// @return  false: this reading shows that the hand moved while the readings stood still
  [[nodiscard]] bool read(TimePoint at, const Vector3& position_m,
                          const Vector3& acted_newton) noexcept {
    const Vector3 moved_m = position_m - position_m_;
    const bool is_same = has_reading_ && moved_m.cwiseAbs().maxCoeff() <= kSame_m;
    bool is_plausible = true;
    if (!is_same) {
      is_plausible =
          !is_frozen_ || moved_m.norm() <= v_max_m_per_s_ * to_seconds(at - read_at_) + rounding_m_;
      is_frozen_ = has_changed_ = false;
      has_reading_ = true;
      position_m_ = position_m;
      pushed_since_ = at;
      least_newton_ = most_newton_ = acted_newton;
    } else {
      if (acted_newton.norm() <= kExact * coulomb_newton_) pushed_since_ = at;
      least_newton_ = least_newton_.cwiseMin(acted_newton);
      most_newton_ = most_newton_.cwiseMax(acted_newton);
      if (!has_changed_ && (most_newton_ - least_newton_).norm() > change_newton_) {
        has_changed_ = true;
        changed_at_ = at;
      }
      is_frozen_ = is_frozen_ || at - pushed_since_ >= kPushed ||
                   (has_changed_ && at - changed_at_ >= kChanged);
    }
    read_at_ = at;
    return is_plausible;
  }

  /// No force above f_co until a reading differs.
  [[nodiscard]] bool is_frozen() const noexcept { return is_frozen_; }

  /// Every member, to be written to a file or read from one: state_text.h.
  template <class Archive>
  void list(Archive& archive) {
    archive(coulomb_newton_);
    archive(change_newton_);
    archive(v_max_m_per_s_);
    archive(rounding_m_);
    archive(has_reading_);
    archive(is_frozen_);
    archive(position_m_);
    archive(read_at_);
    archive(pushed_since_);
    archive(has_changed_);
    archive(changed_at_);
    archive(least_newton_);
    archive(most_newton_);
  }

 private:
  static constexpr double kStiffestHand_newton_per_m = 3000.0;
  static constexpr double kSame_m = 1e-9;
  static constexpr double kExact = 1.0 + 1e-9;
  static constexpr Duration kPushed = std::chrono::milliseconds(250);
  static constexpr Duration kChanged = std::chrono::milliseconds(30);

  double coulomb_newton_;
  double change_newton_;
  double v_max_m_per_s_;
  double rounding_m_;

  bool has_reading_ = false;
  bool is_frozen_ = false;
  Vector3 position_m_ = Vector3::Zero();
  TimePoint read_at_{};
  TimePoint pushed_since_{};
  bool has_changed_ = false;
  TimePoint changed_at_{};
  Vector3 least_newton_ = Vector3::Zero();
  Vector3 most_newton_ = Vector3::Zero();
};

}  // namespace palpate::device
