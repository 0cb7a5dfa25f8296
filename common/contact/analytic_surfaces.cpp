// SPDX-License-Identifier: Apache-2.0
#include "common/contact/analytic_surfaces.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate {
namespace {

// Below this length a direction is rounding, not geometry [m].
constexpr double kShortestDirection = 1e-12;

// How far a point may move before another face, edge or corner of the box is nearest. `beyond_face`
// as in view(): > 0 outside that slab.
double distance_to_next_feature(const Vector3& from_center, const Vector3& beyond_face,
                                int nearest_face) noexcept {
  const bool is_at_face = (beyond_face.array() > 0.0).count() <= 1;
  double nearest = is_at_face ? std::abs(from_center[nearest_face]) : kMaxTrustRadiusM;
  for (int axis = 0; axis < 3; ++axis) {
    if (axis == nearest_face && is_at_face) continue;
    // to the plane that bounds the slab; before it, inside, two faces may be equally near
    nearest = std::min(nearest, std::abs(beyond_face[axis]));
    if (is_at_face) {
      nearest =
          std::min(nearest, (beyond_face[nearest_face] - beyond_face[axis]) / std::numbers::sqrt2);
    }
  }
  return std::max(nearest, kMinTrustRadiusM);
}

}  // namespace

SurfaceView view(const HalfSpaceGeometry& half_space, const Vector3& point_m) noexcept {
  SurfaceView surface;
  surface.distance_m = half_space.normal.dot(point_m - half_space.point_m);
  surface.normal = half_space.normal;
  return surface;
}

SurfaceView view(const SphereGeometry& sphere, const Vector3& point_m) noexcept {
  SurfaceView surface;
  const Vector3 from_center = point_m - sphere.center_m;
  const double distance_to_center = from_center.norm();
  surface.distance_m = distance_to_center - sphere.radius_m;
  surface.trust_radius_m = std::clamp(distance_to_center, kMinTrustRadiusM, kMaxTrustRadiusM);
  if (distance_to_center > kShortestDirection) {
    surface.normal = from_center / distance_to_center;
    surface.curvature_per_m =
        (Matrix3::Identity() - surface.normal * surface.normal.transpose()) / distance_to_center;
  }
  return surface;
}

SurfaceView view(const BoxGeometry& box, const Vector3& point_m) noexcept {
  SurfaceView surface;
  const Vector3 from_center = point_m - box.center_m;
  const Vector3 sign = from_center.unaryExpr([](double x) { return x < 0.0 ? -1.0 : 1.0; });
  const Vector3 beyond_face = from_center.cwiseAbs() - 0.5 * box.size_m;  // > 0: outside that slab
  int nearest_face = 0;
  const double nearest = beyond_face.maxCoeff(&nearest_face);

  surface.trust_radius_m = distance_to_next_feature(from_center, beyond_face, nearest_face);

  if (nearest <= kShortestDirection) {
    surface.distance_m = nearest;
    surface.normal = sign[nearest_face] * Vector3::Unit(nearest_face);
    return surface;
  }

  // outside: the nearest point of the box differs in the axes whose slab the point is outside of
  const Vector3 from_box = beyond_face.cwiseMax(0.0).cwiseProduct(sign);
  surface.distance_m = from_box.norm();
  surface.normal = from_box / surface.distance_m;
  const Vector3 is_beyond = beyond_face.unaryExpr([](double x) { return x > 0.0 ? 1.0 : 0.0; });
  if (is_beyond.sum() > 1.0) {
    surface.curvature_per_m =
        (Matrix3(is_beyond.asDiagonal()) - surface.normal * surface.normal.transpose()) /
        surface.distance_m;
  }
  return surface;
}

SurfaceView view(const CapsuleGeometry& capsule, const Vector3& point_m) noexcept {
  // the nearest point of the axis
  const Vector3 axis = capsule.to_m - capsule.from_m;
  const Vector3 from_start = point_m - capsule.from_m;
  const double length2 = axis.squaredNorm();
  const double along = length2 > 0.0 ? from_start.dot(axis) / length2 : 0.0;
  const bool is_beside = along > 0.0 && along < 1.0;
  const Vector3 from_axis = from_start - std::clamp(along, 0.0, 1.0) * axis;

  SurfaceView surface;
  const double distance_to_axis = from_axis.norm();
  surface.distance_m = distance_to_axis - capsule.radius_m;
  if (distance_to_axis <= kShortestDirection) {
    const Vector3 across =
        axis.cross(std::abs(axis.x()) <= std::abs(axis.z()) ? Vector3::UnitX() : Vector3::UnitZ());
    if (across.norm() > 0.0) surface.normal = across.normalized();
    surface.trust_radius_m = kMinTrustRadiusM;
    return surface;
  }
  // to the planes that separate the ends from the middle, and to the axis
  const double length = std::sqrt(length2);
  double nearest = distance_to_axis;
  if (length2 > 0.0) {
    nearest = std::min({nearest, std::abs(along) * length, std::abs(1.0 - along) * length});
  }
  surface.trust_radius_m = std::clamp(nearest, kMinTrustRadiusM, kMaxTrustRadiusM);
  surface.normal = from_axis / distance_to_axis;
  surface.curvature_per_m = Matrix3::Identity() - surface.normal * surface.normal.transpose();
  if (is_beside) surface.curvature_per_m -= axis * axis.transpose() / length2;
  surface.curvature_per_m /= distance_to_axis;
  return surface;
}

double distance_to_axis_m(const CapsuleGeometry& capsule, const Vector3& point_m) noexcept {
  const Vector3 axis = capsule.to_m - capsule.from_m;
  const Vector3 from_start = point_m - capsule.from_m;
  const double length2 = axis.squaredNorm();
  const double along = length2 > 0.0 ? from_start.dot(axis) / length2 : 0.0;
  return (from_start - std::clamp(along, 0.0, 1.0) * axis).norm();
}

Bounds bounds_of(const SphereGeometry& sphere) noexcept {
  const Vector3 radius_m = Vector3::Constant(sphere.radius_m);
  return {sphere.center_m - radius_m, sphere.center_m + radius_m};
}

Bounds bounds_of(const BoxGeometry& box) noexcept {
  return {box.center_m - 0.5 * box.size_m, box.center_m + 0.5 * box.size_m};
}

Bounds bounds_of(const CapsuleGeometry& capsule) noexcept {
  const Vector3 radius_m = Vector3::Constant(capsule.radius_m);
  return {capsule.from_m.cwiseMin(capsule.to_m) - radius_m,
          capsule.from_m.cwiseMax(capsule.to_m) + radius_m};
}

}  // namespace palpate
