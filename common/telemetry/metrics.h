// SPDX-License-Identifier: Apache-2.0
// metrics.h — figures of a run, computed the same way live, in lockstep and in benches.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>

#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate {

/// Time in which forces are below this is excluded from transparency [N] (docs/theory.md §7.2).
inline constexpr double kForceFloorNewton = 0.05;

/// Whether a person can tell the force from the reference: they differ by more than 7 % of it and
/// by more than 0.05 N (force JND, docs/theory.md §7.3).
[[nodiscard]] inline bool is_beyond_force_jnd(const Vector3& reference_newton,
                                              const Vector3& applied_newton) noexcept {
  constexpr double kJndRatio = 0.07;
  return (applied_newton - reference_newton).norm() >
         std::max(kJndRatio * reference_newton.norm(), kForceFloorNewton);
}

/// The paper's transparency, [MOFC] eqs. (15)–(18): with v_o = v_e the ratio of impedances is the
/// ratio of forces, per axis its mean over the time with |f_e| > 0.05 N.
class PaperTransparency {
 public:
  /// The applied force acted for so long.
  void add(double duration_s, const Vector3& requested_newton,
           const Vector3& applied_newton) noexcept {
    for (int axis = 0; axis < 3; ++axis) {
      if (std::abs(requested_newton[axis]) > kForceFloorNewton) {
        integral_s_[axis] += duration_s * applied_newton[axis] / requested_newton[axis];
        judged_s_[axis] += duration_s;
      }
    }
  }
  /// NaN on an axis that never exceeded the floor.
  [[nodiscard]] Vector3 mean() const noexcept {
    Vector3 mean = Vector3::Constant(kNaN);
    for (int axis = 0; axis < 3; ++axis) {
      if (judged_s_[axis] > 0.0) mean[axis] = integral_s_[axis] / judged_s_[axis];
    }
    return mean;
  }

 private:
  Vector3 integral_s_ = Vector3::Zero();
  Vector3 judged_s_ = Vector3::Zero();
};

/// Torques are compared as the forces that they are at the end of this arm: the floor of a torque
/// is then 1 mN·m.
inline constexpr double kTorqueArm_m = 0.02;

/// What a rendered force F was against a reference R over time, docs/theory.md §7.2. All figures
/// are integrals over the time with |F| or |R| > 0.05 N, so a force counts for as long as it acted
/// and a hole for as long as it lasted. Sums of comparisons are comparisons of longer times.
/// No allocation, no throw.
class ForceComparison {
 public:
  /// The integrals, for the wire and for files: [s], [N²·s], [N·s].
  struct Integrals {
    double judged_s = 0.0;        ///< the time that counts
    double transparency_s = 0.0;  ///< ∫ min(1, max(0, F·R/|R|²)) dt
    double along_n2s = 0.0;       ///< ∫ F·R dt
    double reference_n2s = 0.0;   ///< ∫ |R|² dt
    double error_n2s = 0.0;       ///< ∫ |F − R|² dt
    double error_ns = 0.0;        ///< ∫ |F − R| dt
    double beyond_jnd_s = 0.0;    ///< time in which F and R differ by more than the force JND
  };

  ForceComparison() = default;
  explicit ForceComparison(const Integrals& integrals) : i_(integrals) {}

  /// Both forces were constant for so long.
  void add(double duration_s, const Vector3& reference_newton,
           const Vector3& applied_newton) noexcept {
    const double reference2 = reference_newton.squaredNorm();
    const double floor2 = kForceFloorNewton * kForceFloorNewton;
    if (!(reference2 > floor2 || applied_newton.squaredNorm() > floor2)) return;
    const double along = applied_newton.dot(reference_newton);
    const double ratio = reference2 > 0.0 ? along / reference2 : 0.0;
    const double error2 = (applied_newton - reference_newton).squaredNorm();
    i_.judged_s += duration_s;
    i_.transparency_s += duration_s * std::min(1.0, std::max(0.0, ratio));
    i_.along_n2s += duration_s * along;
    i_.reference_n2s += duration_s * reference2;
    i_.error_n2s += duration_s * error2;
    i_.error_ns += duration_s * std::sqrt(error2);
    if (is_beyond_force_jnd(reference_newton, applied_newton)) i_.beyond_jnd_s += duration_s;
  }

  /// The applied force was constant while the reference went from one value to the other. In equal
  /// pieces of at most 0.25 ms, each judged at the reference of its middle.
  void add(double duration_s, const Vector3& reference_at_begin_newton,
           const Vector3& reference_at_end_newton, const Vector3& applied_newton) noexcept {
    if (!(duration_s > 0.0)) return;
    const Vector3 change = reference_at_end_newton - reference_at_begin_newton;
    const double pieces = change.isZero(0.0) ? 1.0 : std::ceil(duration_s / kLongestPiece_s - 1e-9);
    for (double piece = 0.5; piece < pieces; piece += 1.0) {
      add(duration_s / pieces, reference_at_begin_newton + piece / pieces * change, applied_newton);
    }
  }

  void add(const ForceComparison& other) noexcept {
    i_.judged_s += other.i_.judged_s;
    i_.transparency_s += other.i_.transparency_s;
    i_.along_n2s += other.i_.along_n2s;
    i_.reference_n2s += other.i_.reference_n2s;
    i_.error_n2s += other.i_.error_n2s;
    i_.error_ns += other.i_.error_ns;
    i_.beyond_jnd_s += other.i_.beyond_jnd_s;
  }

  /// Projected and capped: mean of min(1, max(0, F·R/|R|²)). Like the others NaN before any time
  /// counts.
  [[nodiscard]] double transparency() const noexcept {
    return quotient(i_.transparency_s, i_.judged_s);
  }
  /// ∫ F·R dt / ∫ |R|² dt, not capped: 1 where the force is right, above 1 where it overshoots.
  [[nodiscard]] double gain() const noexcept { return quotient(i_.along_n2s, i_.reference_n2s); }
  /// rms of F − R over that of R.
  [[nodiscard]] double rms_error_ratio() const noexcept {
    return std::sqrt(quotient(i_.error_n2s, i_.reference_n2s));
  }
  /// Share of the time in which the two differ by more than the force JND.
  [[nodiscard]] double beyond_jnd_ratio() const noexcept {
    return quotient(i_.beyond_jnd_s, i_.judged_s);
  }
  [[nodiscard]] const Integrals& integrals() const noexcept { return i_; }

 private:
  static constexpr double kLongestPiece_s = 0.25e-3;
  static double quotient(double part, double whole) noexcept {
    return whole > 0.0 ? part / whole : kNaN;
  }
  Integrals i_;
};

/// The largest mean over a window of at least 20 ms that is made of whole pieces.
class LargestMean {
 public:
  /// @param integral  of the quantity, ≥ 0, over a piece of `duration_s` that follows the last one
  void add(double duration_s, double integral) {
    pieces_.push_back({duration_s, integral});
    duration_s_ += duration_s;
    integral_ += integral;
    while (duration_s_ - pieces_.front().duration_s >= kWindow_s) {
      duration_s_ -= pieces_.front().duration_s;
      integral_ -= pieces_.front().integral;
      pieces_.pop_front();
    }
    if (duration_s_ >= kWindow_s) largest_ = std::fmax(largest_, integral_ / duration_s_);
  }
  /// NaN before the first window is full.
  [[nodiscard]] double value() const noexcept { return largest_; }

 private:
  static constexpr double kWindow_s = 20e-3 - 1e-9;
  struct Piece {
    double duration_s;
    double integral;
  };
  std::deque<Piece> pieces_;
  double duration_s_ = 0.0;
  double integral_ = 0.0;
  double largest_ = kNaN;
};

/// Direction changes of a motion, per axis, that are larger than 0.5 mm (docs/theory.md §7.4): a
/// turn counts once the position has returned by more than the threshold from the last extreme.
class ReversalCounter {
 public:
  explicit ReversalCounter(double threshold_m = 0.5e-3) : threshold_m_(threshold_m) {}

  void add(const Vector3& position_m) noexcept {
    for (std::size_t i = 0; i < 3; ++i) axes_[i].add(position_m[static_cast<int>(i)], threshold_m_);
  }
  [[nodiscard]] std::array<std::uint64_t, 3> reversals() const noexcept {
    return {axes_[0].reversals, axes_[1].reversals, axes_[2].reversals};
  }
  [[nodiscard]] std::uint64_t total() const noexcept {
    return axes_[0].reversals + axes_[1].reversals + axes_[2].reversals;
  }

 private:
  struct Axis {
    bool has_start = false;
    int direction = 0;  // 0 until the first move beyond the threshold
    double extreme = 0.0;
    std::uint64_t reversals = 0;

    void add(double x, double threshold) noexcept {
      if (!has_start) {
        has_start = true;
        extreme = x;
        return;
      }
      if (direction == 0) {
        if (std::abs(x - extreme) > threshold) {
          direction = x > extreme ? 1 : -1;
          extreme = x;
        }
        return;
      }
      if ((x - extreme) * direction > 0) {
        extreme = x;
      } else if ((extreme - x) * direction > threshold) {
        direction = -direction;
        extreme = x;
        ++reversals;
      }
    }
  };
  double threshold_m_;
  std::array<Axis, 3> axes_;
};

/// Percentiles of a duration without allocation: buckets of 1/8 octave from 64 ns to 17 s, so a
/// reported percentile is at most 9 % above the true one.
class DurationHistogram {
 public:
  void add(Duration d) noexcept;
  /// Upper edge of the bucket that holds quantile `q` in [0, 1]; 0 when empty.
  [[nodiscard]] Duration quantile(double q) const noexcept;
  [[nodiscard]] Duration maximum() const noexcept { return maximum_; }
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }

 private:
  static constexpr int kLowestExponent = 6;
  static constexpr int kOctaves = 28;
  static constexpr int kPerOctave = 8;
  std::array<std::uint64_t, std::size_t{kOctaves} * kPerOctave> buckets_{};
  std::uint64_t count_ = 0;
  Duration maximum_{};
};

}  // namespace palpate
