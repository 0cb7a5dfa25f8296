// SPDX-License-Identifier: Apache-2.0
/// @file
/// memory_based.h — memory-based passivation: releasing gives back what pressing has stored.
#pragma once

#include <array>
#include <cstddef>

#include "interval.h"

namespace palpate::controllers {

/// Remembers the force over the penetration p while the hand presses, as a stack of segments with
/// area A, and the work E_m that it has cost. Along the surface's normal, with f the pressing part
/// of F_e and l = max(1.5|Δp|, q):
///
///     Δp > 0   push (p(k−1), p(k)] with F(k−1);   F = f
///     Δp = 0   F = min(f, F(k−1))
///     Δp < 0   take off what lies above p(k);   F = min(f, max(0, M − (A − E_m)₊ / l)),
///              M the mean of the memory over (p(k) − l, p(k)]
///     p ≤ 0    forget everything
///
/// The tangential part is scaled with the normal one. Pulling forces pass.
///
/// Property: a contact ends with no net energy given to the hand, if every retreat is at most 1.5
/// times the one before; no friction, velocity or damping is needed. Broken by: force that is not a
/// function of the penetration (damping, cutting, moving tissue), reversals at every sample, noise
/// of the direction.
/// Source: [Ryu14], one axis. Differs: written from the idea of the paper, not from its equations;
/// the loss of a contact is judged by them alone.
class MemoryBased final : public ForceController {
 public:
  /// @param resolution_m  q ≥ 0, of the position, per axis
  explicit MemoryBased(double resolution_m) : resolution_m_(resolution_m) {}
  void reset() noexcept override;
  /// The first step of a contact gives the requested force and its normal: that of the surface, or
  /// of the force where no normal is known.
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override;

  /// p of the last step, measured from where the contact began.
  [[nodiscard]] double penetration_m() const noexcept { return penetration_m_; }

 private:
  struct Segment {
    double low_m = 0.0;
    double high_m = 0.0;
    double newton = 0.0;
    [[nodiscard]] double joule() const noexcept { return newton * (high_m - low_m); }
  };
  static constexpr std::size_t kMostSegments = 1024;
  static constexpr double kLeastSegmentMetre = 2e-5;  // shorter ones are joined: 20 mm are stored

  void forget() noexcept;
  void press(double to_m, double newton) noexcept;
  void release(double to_m) noexcept;
  [[nodiscard]] double mean_newton(double length_m) const noexcept;

  double resolution_m_;
  IntervalReader interval_;
  std::array<Segment, kMostSegments> segments_{};
  std::size_t count_ = 0;
  double area_joule_ = 0.0;   // A
  double spent_joule_ = 0.0;  // E_m
  double penetration_m_ = 0.0;
  bool is_in_contact_ = false;
  Vector3 normal_ = Vector3::Zero();
};

}  // namespace palpate::controllers
