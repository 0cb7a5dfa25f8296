// SPDX-License-Identifier: Apache-2.0
// relaxation.h — how far relaxing tissues have relaxed under one tool.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace palpate {

/// Of one relaxing tissue: τ ż = p − z.
struct RelaxationState {
  double penetration_m = 0.0;  ///< p ≥ 0
  double relaxed_m = 0.0;      ///< z

  /// p changes linearly to `depth_m` (≤ 0 or not finite: not pressed) within `dt_s` ≥ 0.
  /// @param relaxation_time_s  τ > 0
  void press(double relaxation_time_s, double depth_m, double dt_s) noexcept;
  [[nodiscard]] bool is_at_rest() const noexcept {
    return penetration_m == 0.0 && relaxed_m == 0.0;
  }
};

/// For each relaxing tissue its penetration p and the penetration z that it has relaxed to:
/// τ ż = p − z. Tissue at rest (p = z = 0) is asleep and costs nothing. Only the constructor
/// allocates.
class Relaxation {
 public:
  Relaxation() = default;
  /// @param relaxation_times_s  τ > 0 of each relaxing tissue
  explicit Relaxation(std::vector<double> relaxation_times_s);

  /// z; 0 for an index that does not exist.
  [[nodiscard]] double relaxed_m(std::size_t index) const noexcept {
    return index < states_.size() ? states_[index].relaxed_m : 0.0;
  }
  [[nodiscard]] std::size_t awake_count() const noexcept { return awake_.size(); }

  /// p changes linearly to `depth_m` (≤ 0 or not finite: not pressed) within `dt_s` ≥ 0, which
  /// ends at `time_s`.
  void press(std::size_t index, double depth_m, double dt_s, double time_s) noexcept;

  /// Ends a step: tissues not pressed since the last one recover; those at rest fall asleep.
  void finish_step(double dt_s, double time_s) noexcept;

 private:
  struct State : RelaxationState {
    double advanced_s = 0.0;
  };

  std::vector<double> relaxation_times_s_;
  std::vector<State> states_;
  std::vector<std::uint32_t> awake_;  // tissues that are not at rest
};

}  // namespace palpate
