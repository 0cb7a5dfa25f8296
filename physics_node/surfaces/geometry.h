// geometry.h — the surfaces a tissue can have, seen from one point: how far, which way, how curved.
#pragma once

#include "common/session/scene_config.h"
#include "common/core/vector.h"

namespace palpate::physics {

/// A surface that is the same everywhere, as far as numbers of a message go.
inline constexpr double kMaxTrustRadiusM = 1000.0;
/// A surface that is about to change is described this far at least.
inline constexpr double kMinTrustRadiusM = 1e-4;

/// The surface as one point of W sees it.
struct SurfaceView {
  double distance_m = 0.0;            ///< signed: > 0 outside the tissue, < 0 inside
  Vector3 normal = Vector3::UnitZ();  ///< unit, out of the tissue; the gradient of the distance
  Matrix3 curvature_per_m = Matrix3::Zero();  ///< Hessian of the distance; curvature · normal = 0
  double stiffness_ratio = 1.0;               ///< of this place: factor on the material's stiffness
  /// How far from the point this quadric is still the surface; > 0.
  double trust_radius_m = kMaxTrustRadiusM;
};

/// Axis-aligned box in W.
struct Bounds {
  Vector3 lowest_m = Vector3::Zero();
  Vector3 highest_m = Vector3::Zero();
};

/// Exact everywhere; the plane has no curvature. Needs |normal| = 1.
[[nodiscard]] SurfaceView view(const HalfSpaceGeometry& half_space,
                               const Vector3& point_m) noexcept;

/// Exact. At the centre (closer than 1 pm) no direction leads out more than another: the normal is
/// +z there and the curvature, which grows as 1/distance from the centre, is given as zero. The
/// trust radius ends at the centre.
[[nodiscard]] SurfaceView view(const SphereGeometry& sphere, const Vector3& point_m) noexcept;

/// Outside: the distance to the nearest point of the box, be it on a face, an edge (curved like a
/// cylinder) or a corner (curved like a sphere). Inside, and closer than 1 pm: the nearest face;
/// where several are equally near the first in the order x, y, z, and of two opposite ones the one
/// in positive direction, so the normal jumps there while the distance does not. The trust radius
/// ends where another face, edge or corner becomes the nearest.
[[nodiscard]] SurfaceView view(const BoxGeometry& box, const Vector3& point_m) noexcept;

/// Exact. On the axis no direction leads out more than another: the normal is one across it, and
/// the curvature zero. The trust radius ends where the rounded ends begin, and at the axis.
[[nodiscard]] SurfaceView view(const CapsuleGeometry& capsule, const Vector3& point_m) noexcept;

/// The smallest box round the tissue.
[[nodiscard]] Bounds bounds_of(const SphereGeometry& sphere) noexcept;
[[nodiscard]] Bounds bounds_of(const BoxGeometry& box) noexcept;
[[nodiscard]] Bounds bounds_of(const CapsuleGeometry& capsule) noexcept;

}  // namespace palpate::physics
