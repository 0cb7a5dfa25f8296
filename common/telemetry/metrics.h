// metrics.h — figures of a run, computed the same way live, in lockstep and in benches.
#pragma once

#include <array>
#include <cstdint>

#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate {

/// Samples below this force are excluded from transparency [N] (docs/theory.md §7.2).
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
/// ratio of forces, averaged per axis over samples in contact with |f_e| > 0.05 N.
class PaperTransparency {
 public:
  void add(const Vector3& asked_newton, const Vector3& applied_newton) noexcept {
    for (int axis = 0; axis < 3; ++axis) {
      if (std::abs(asked_newton[axis]) > kForceFloorNewton) {
        sum_[axis] += applied_newton[axis] / asked_newton[axis];
        ++samples_[static_cast<std::size_t>(axis)];
      }
    }
  }
  /// NaN on an axis that never exceeded the floor.
  [[nodiscard]] Vector3 mean() const noexcept {
    Vector3 mean = Vector3::Constant(kNaN);
    for (int axis = 0; axis < 3; ++axis) {
      const auto n = samples_[static_cast<std::size_t>(axis)];
      if (n > 0) mean[axis] = sum_[axis] / static_cast<double>(n);
    }
    return mean;
  }

 private:
  Vector3 sum_ = Vector3::Zero();
  std::array<std::uint64_t, 3> samples_{};
};

/// Projected capped transparency, docs/theory.md §7.2: mean of min(1, max(0, fs·fi/|fi|²)) over
/// samples with |fi| or |fs| > 0.05 N. Also the rms force error relative to |fi|.
class ProjectedTransparency {
 public:
  void add(const Vector3& reference_newton, const Vector3& applied_newton) noexcept {
    const double reference2 = reference_newton.squaredNorm();
    const double floor2 = kForceFloorNewton * kForceFloorNewton;
    if (!(reference2 > floor2 || applied_newton.squaredNorm() > floor2)) return;
    const double ratio = reference2 > 0 ? applied_newton.dot(reference_newton) / reference2 : 0.0;
    sum_ += std::min(1.0, std::max(0.0, ratio));
    error2_ += (applied_newton - reference_newton).squaredNorm();
    reference2_ += reference2;
    ++samples_;
  }
  [[nodiscard]] double mean() const noexcept {
    return samples_ > 0 ? sum_ / static_cast<double>(samples_) : kNaN;
  }
  [[nodiscard]] double rms_error_ratio() const noexcept {
    return reference2_ > 0 ? std::sqrt(error2_ / reference2_) : kNaN;
  }
  [[nodiscard]] double sum() const noexcept { return sum_; }
  [[nodiscard]] std::uint64_t samples() const noexcept { return samples_; }

 private:
  double sum_ = 0.0;
  double error2_ = 0.0;
  double reference2_ = 0.0;
  std::uint64_t samples_ = 0;
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
