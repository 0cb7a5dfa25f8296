// SPDX-License-Identifier: Apache-2.0
// hand_motion.h — path length and smoothness of a motion, from positions with the steps of an
// encoder.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "common/core/vector.h"

namespace palpate {

/// The path is that of a point which a string of 50 µm pulls after means over 10 ms, so that
/// neither the steps of an encoder nor a tremor of that size lengthen it; it loses twice the string
/// at each turn. Smoothness is that of means over 50 ms. A slot without a position is bridged by a
/// straight line and left out of the smoothness.
class HandMotion {
 public:
  static constexpr double kSlot_s = 0.05;
  static constexpr double kPathSlot_s = 0.01;
  static constexpr double kString_m = 5e-5;
  static constexpr double kLeastPath_m = 1e-3;

  /// @param t_s  not before that of the last call
  void add(double t_s, const Vector3& position_m);
  /// Completes the last slot. Call it once, after the last position.
  void finish();

  [[nodiscard]] double path_m() const { return path_m_; }
  /// Log dimensionless jerk, −ln(T³/v_peak² ∫|d³x/dt³|² dt), after [Balasubramanian15], of the
  /// vector: larger, nearer to 0, is smoother. NaN if the path is shorter than 1 mm (the steps of
  /// an encoder under a hand at rest are no motion) or with less than 4 slots.
  [[nodiscard]] double log_dimensionless_jerk() const;

 private:
  struct Mean {
    std::int64_t slot = 0;
    Vector3 position_m = Vector3::Zero();
  };
  /// The mean of the positions in each slot of time.
  struct Slots {
    double length_s;
    std::int64_t slot = 0;
    Vector3 sum_m = Vector3::Zero();
    std::uint64_t count = 0;

    /// @param t_s  since the first position
    /// @return     that of the slot that ended before it, if one did
    std::optional<Mean> add(double t_s, const Vector3& position_m);
    std::optional<Mean> end();
  };
  void pull(const std::optional<Mean>& mean);
  void take(const std::optional<Mean>& mean);

  std::optional<double> begin_s_;
  double end_s_ = 0.0;
  Slots slots_{kSlot_s};
  Slots path_slots_{kPathSlot_s};
  std::array<Mean, 4> last_{};  // newest first
  std::size_t known_ = 0;       // of last_
  Vector3 pulled_m_ = Vector3::Zero();
  Vector3 newest_m_ = Vector3::Zero();
  double path_m_ = 0.0;
  double peak_m_per_s_ = 0.0;
  double jerk2_s_ = 0.0;  // ∫|jerk|² dt
  std::uint64_t jerks_ = 0;
};

}  // namespace palpate
