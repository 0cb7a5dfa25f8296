// SPDX-License-Identifier: Apache-2.0
#include "common/contact/elastic/sphere_sweep.h"

#include <algorithm>

#include "common/contact/elastic/clones.h"

namespace palpate {
namespace {

// Of what a point moves aside, its normal follows so much.
constexpr double kAside = 0.5;
// The force of a point that gives way less than so much of its penalty changes in smaller parts: a
// compliance of floats is not that exact.
constexpr double kLeastGive = 0.1;
// Half the angle of the cone of a point's normals: 60°.
constexpr double kConeCosine = 0.5;
constexpr double kConeSine = 0.8660254037844386;

PALPATE_CLONES void add_three(const float* m, std::size_t stride, const float* x, float* y) {
  const float* const m1 = m + stride;
  const float* const m2 = m1 + stride;
  for (std::size_t i = 0; i < stride; ++i) y[i] = y[i] + m[i] * x[0] + m1[i] * x[1] + m2[i] * x[2];
}

/// @param axis  zero: any direction
Vector3 normal_of(const Vector3& away, const Vector3& axis, double radius_m) noexcept {
  const double distance_m = away.norm();
  const double along_m = axis.dot(away);
  if (distance_m < radius_m && along_m < kConeCosine * distance_m && !axis.isZero(0.0)) {
    const Vector3 sideways = away - along_m * axis;
    const double width_m = sideways.norm();
    if (!(width_m > 0.0)) return axis;
    return kConeCosine * axis + kConeSine / width_m * sideways;
  }
  return away / std::max(distance_m, 1e-9);
}

}  // namespace

Vector3 place_of(const SphereSweep& sphere, std::size_t point) noexcept {
  Vector3 at_m = sphere.base_m[point] +
                 Eigen::Map<const Eigen::Vector3f>(sphere.moved_m + 3 * point).cast<double>();
  if (sphere.pace == 1.0) return at_m;
  const Vector3& from_m = sphere.reached_m[point];
  return from_m + sphere.pace * (at_m - from_m);
}

void add_columns(const SphereSweep& sphere, std::size_t point, const Vector3& x,
                 float* y) noexcept {
  const Eigen::Vector3f amount = (sphere.compliance_ratio * x).cast<float>();
  add_three(sphere.compliance_m_per_newton + 3 * point * sphere.stride, sphere.stride,
            amount.data(), y);
}

SweepEffort sweep(const SphereSweep& sphere, int most_sweeps, int most_changes,
                  double tolerance_m) noexcept {
  const bool has_friction = sphere.friction_coefficient > 0.0;
  for (std::size_t i = 0; i < sphere.count; ++i) {
    Vector3 at_m = place_of(sphere, i);
    if (sphere.still_m != nullptr) {
      const Vector3& still_m = sphere.still_m[i];
      const Vector3 moved_m = at_m - still_m;
      at_m = still_m + (1.0 - kAside) * sphere.along.dot(moved_m) * sphere.along + kAside * moved_m;
    }
    const Vector3 axis = sphere.axes != nullptr ? sphere.axes[i] : Vector3(Vector3::Zero());
    sphere.normals[i] = normal_of(at_m - sphere.center_m, axis, sphere.radius_m);
  }
  SweepEffort effort;
  while (effort.sweeps < most_sweeps) {
    double largest_m = 0.0;
    for (std::size_t i = 0; i < sphere.count; ++i) {
      const Vector3 at_m = place_of(sphere, i);
      const Vector3& normal = sphere.normals[i];
      const double gap = normal.dot(at_m - sphere.center_m) - sphere.radius_m;
      Vector3& force = sphere.forces_newton[i];
      if (gap > 0.0 && force.isZero(0.0)) continue;
      Matrix3 own;
      for (Eigen::Index k = 0; k < 3; ++k) {
        const std::size_t column = 3 * i + static_cast<std::size_t>(k);
        own.col(k) = sphere.pace * sphere.compliance_ratio *
                     Eigen::Map<const Eigen::Vector3f>(sphere.compliance_m_per_newton +
                                                       column * sphere.stride + 3 * i)
                         .cast<double>();
      }
      const double give = std::max(0.0, normal.dot(own * normal));
      const double along = force.dot(normal);
      const double least = sphere.rigid_give_m_per_newton[i];
      const double more = sphere.is_held[i] != 0 ? least : 0.0;
      const double press = std::max(
          0.0, more > 0.0 ? (give * along - gap) / (give + more)
                          : along - gap / std::max(give, kLeastGive * sphere.pace * least));
      Vector3 wanted = press * normal;
      if (has_friction && press > 0.0) {
        // since the end of the last sweep
        const Vector3 slide = at_m - sphere.reached_m[i] - sphere.way_m;
        Vector3 tangential = force - force.dot(normal) * normal;
        const Vector3 sliding = slide - slide.dot(normal) * normal;
        tangential -= sliding / std::max(1e-30, own.trace() / 3.0 + more);
        const double limit = sphere.friction_coefficient * press;
        const double size = tangential.norm();
        wanted += size > limit ? Vector3(tangential * (limit / size)) : tangential;
      }
      const Vector3 change = wanted - force;
      if (change.isZero(0.0)) continue;
      force = wanted;
      largest_m = std::max(largest_m, (give + more) * change.norm());
      add_columns(sphere, i, change, sphere.moved_m);
      if (++effort.changes >= most_changes) {
        ++effort.sweeps;
        return effort;
      }
    }
    if (largest_m <= tolerance_m) return effort;
    ++effort.sweeps;
  }
  return effort;
}

}  // namespace palpate
