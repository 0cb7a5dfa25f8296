// SPDX-License-Identifier: Apache-2.0
// vector.h — the vector types of the project.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>

namespace palpate {

using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;
using Quaternion = Eigen::Quaterniond;

inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// The vector, scaled down to the norm `limit` (≥ 0) if it is longer; direction unchanged.
[[nodiscard]] inline Vector3 limited_to_norm(const Vector3& v, double limit) noexcept {
  const double norm = v.norm();
  return norm > limit ? Vector3(v * (limit / norm)) : v;
}

/// Each component at most that of `most`, ≥ 0, either way.
[[nodiscard]] inline Vector3 limited_per_component(const Vector3& v, const Vector3& most) noexcept {
  return v.cwiseMin(most).cwiseMax(-most);
}

}  // namespace palpate
