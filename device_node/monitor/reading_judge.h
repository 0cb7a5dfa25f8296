// SPDX-License-Identifier: Apache-2.0
// reading_judge.h — whether a hand can have made a reading after the one before.
#pragma once

#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate::device {

/// One thread, no allocation, no throw.
class ReadingJudge {
 public:
  /// @param rounding_m  largest error of the distance of two readings
  ReadingJudge(double v_fault_m_per_s, double rounding_m) noexcept
      : v_fault_m_per_s_(v_fault_m_per_s), rounding_m_(rounding_m) {}

  /// The next reading has none before it.
  void begin() noexcept { has_reading_ = false; }
  /// The time between two readings includes any time for which the process was stopped; rounding
  /// may add one encoder step per axis.
  /// @param late  position and time stamp may be apart by so much
  /// @return      false: further from the last one than a hand of v_fault gets
  [[nodiscard]] bool read(TimePoint at, const Vector3& position_m, Duration late) noexcept {
    moved_m_ = position_m - position_m_;
    elapsed_ = at - read_at_ + late;  // at most
    const bool is_possible =
        !has_reading_ || moved_m_.norm() <= v_fault_m_per_s_ * to_seconds(elapsed_) + rounding_m_;
    if (!has_reading_) elapsed_ = {};
    position_m_ = position_m;
    read_at_ = at;
    has_reading_ = true;
    return is_possible;
  }

  /// Of the last two readings; no time: there was one only.
  [[nodiscard]] const Vector3& moved_m() const noexcept { return moved_m_; }
  [[nodiscard]] Duration elapsed() const noexcept { return elapsed_; }
  [[nodiscard]] bool has_reading() const noexcept { return has_reading_; }
  [[nodiscard]] const Vector3& position_m() const noexcept { return position_m_; }
  [[nodiscard]] TimePoint read_at() const noexcept { return read_at_; }

  /// Every member, to be written to a file or read from one.
  template <class Archive>
  void list(Archive& archive) {
    archive(v_fault_m_per_s_);
    archive(rounding_m_);
    archive(has_reading_);
    archive(position_m_);
    archive(read_at_);
  }

 private:
  double v_fault_m_per_s_;
  double rounding_m_;
  bool has_reading_ = false;  // since the start or the last reset
  Vector3 position_m_ = Vector3::Zero();
  TimePoint read_at_{};
  Vector3 moved_m_ = Vector3::Zero();
  Duration elapsed_{};
};

}  // namespace palpate::device
