// SPDX-License-Identifier: Apache-2.0
// bounds.h — axis-aligned boxes.
#pragma once

#include <span>

#include "common/core/vector.h"

namespace palpate {

/// Axis-aligned box, in the frame of what it bounds.
struct Bounds {
  Vector3 lowest_m = Vector3::Zero();
  Vector3 highest_m = Vector3::Zero();

  /// Grows to contain the point.
  void include(const Vector3& point_m) noexcept {
    lowest_m = lowest_m.cwiseMin(point_m);
    highest_m = highest_m.cwiseMax(point_m);
  }
  /// Grows to contain the box.
  void include(const Bounds& other) noexcept {
    lowest_m = lowest_m.cwiseMin(other.lowest_m);
    highest_m = highest_m.cwiseMax(other.highest_m);
  }
  /// Grows by this much in both directions of each axis.
  void grow(const Vector3& margin_m) noexcept {
    lowest_m -= margin_m;
    highest_m += margin_m;
  }

  [[nodiscard]] Vector3 center_m() const noexcept { return 0.5 * (lowest_m + highest_m); }
  [[nodiscard]] double longest_side_m() const noexcept { return (highest_m - lowest_m).maxCoeff(); }
  [[nodiscard]] int longest_axis() const noexcept {
    int axis = 0;
    (highest_m - lowest_m).maxCoeff(&axis);
    return axis;
  }
  [[nodiscard]] bool meets(const Bounds& other) const noexcept {
    return (other.highest_m.array() >= lowest_m.array()).all() &&
           (other.lowest_m.array() <= highest_m.array()).all();
  }
  /// 0 inside.
  [[nodiscard]] double squared_distance(const Vector3& point_m) const noexcept {
    return (lowest_m - point_m).cwiseMax(point_m - highest_m).cwiseMax(0.0).squaredNorm();
  }
  /// From the point to the corner that is farthest away.
  [[nodiscard]] double farthest_squared(const Vector3& point_m) const noexcept {
    return (point_m - lowest_m).cwiseAbs().cwiseMax((highest_m - point_m).cwiseAbs()).squaredNorm();
  }
};

/// @param points_m  not empty
[[nodiscard]] inline Bounds bounds_of(std::span<const Vector3> points_m) noexcept {
  Bounds bounds{points_m[0], points_m[0]};
  for (const Vector3& point_m : points_m) bounds.include(point_m);
  return bounds;
}

}  // namespace palpate
