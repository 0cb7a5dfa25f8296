// SPDX-License-Identifier: Apache-2.0
// assumption_watch.h — readings that contradict what the guarantee assumes of hand and encoder. It
// only counts.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/session/device_config.h"

namespace palpate::device {

/// Whether only a hand faster than v_max can have moved so, whatever the encoder rounded.
[[nodiscard]] inline bool is_too_fast(const Vector3& moved_m, double duration_s,
                                      double v_max_m_per_s, double resolution_m) noexcept {
  return moved_m.norm() - std::sqrt(3.0) * resolution_m > v_max_m_per_s * duration_s;
}

/// A6: two readings that are too far apart.
///
/// A2: steps of an encoder that is coarser than the profile's q. An encoder of step g reads
/// multiples of g, so the smallest change of an axis that ever occurs is g, and it recurs; the
/// readings of a finer one have smaller changes. Counts, once the smallest change of an axis has
/// occurred 100 times and is more than q, each further one. No allocation, no throw.
class AssumptionWatch {
 public:
  /// @param farthest_m  on each axis of D: beyond it nothing bounds what held currents do
  explicit AssumptionWatch(const DeviceConfig& config,
                           const Vector3& farthest_m =
                               Vector3::Constant(std::numeric_limits<double>::infinity())) noexcept
      : v_max_m_per_s_(config.monitor.v_max_m_per_s),
        resolution_m_(config.profile.position_resolution_m),
        farthest_m_(farthest_m) {}

  void is_at(const Vector3& position_m) noexcept {
    if ((position_m.cwiseAbs() - farthest_m_).maxCoeff() > 0.0) ++outside_;
  }

  /// From one reading to the next.
  void moved(const Vector3& moved_m, Duration elapsed) noexcept {
    if (is_too_fast(moved_m, to_seconds(elapsed), v_max_m_per_s_, resolution_m_)) ++too_fast_;
    for (int i = 0; i < 3; ++i) step(axes_[static_cast<std::size_t>(i)], std::abs(moved_m[i]));
  }

  [[nodiscard]] std::uint64_t too_fast_readings() const noexcept { return too_fast_; }
  [[nodiscard]] std::uint64_t coarse_readings() const noexcept { return coarse_; }
  [[nodiscard]] std::uint64_t outside_readings() const noexcept { return outside_; }

 private:
  static constexpr std::uint64_t kEnough = 100;
  static constexpr double kSame = 1e-6;  // of a change: rounding of the differences of two readings
  static constexpr double kCoarser = 1.01;

  struct Axis {
    double smallest_m = std::numeric_limits<double>::infinity();
    std::uint64_t occurred = 0;
  };

  void step(Axis& axis, double step_m) noexcept {
    if (step_m == 0.0) return;
    if (step_m < (1.0 - kSame) * axis.smallest_m) axis = {.smallest_m = step_m};
    if (step_m > (1.0 + kSame) * axis.smallest_m) return;
    if (++axis.occurred > kEnough && axis.smallest_m > kCoarser * resolution_m_) ++coarse_;
  }

  double v_max_m_per_s_;
  double resolution_m_;
  Vector3 farthest_m_;
  std::array<Axis, 3> axes_{};
  std::uint64_t too_fast_ = 0;
  std::uint64_t coarse_ = 0;
  std::uint64_t outside_ = 0;
};

}  // namespace palpate::device
