// SPDX-License-Identifier: Apache-2.0
// cloud_blend.h — a smooth surface blended from the quadrics of points.
//
// Point i has a quadric and a reach ρᵢ:
//
//   gᵢ(x) = nᵢ·r + ½ r·Hᵢ r − cᵢ,   r = x − pᵢ
//
// The surface is where the blend of the quadrics that reach x is zero:
//
//   f(x) = Σ wᵢ gᵢ / Σ wᵢ,   wᵢ = (1 − |r|²/ρᵢ²)³ inside the reach
//
// Where normals differ by more than 90° from that of the viewed side quadrics are blended less,
// beyond 120° not at all. No allocation, no throw.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "common/contact/surface_view.h"
#include "common/core/vector.h"

namespace palpate {

/// Two unit vectors that form a right-handed frame with the unit normal n.
struct Tangents {
  explicit Tangents(const Vector3& n) {
    const int axis = std::abs(n.x()) < 0.6 ? 0 : 1;
    first = n.cross(Vector3::Unit(axis)).normalized();
    second = n.cross(first);
  }
  Vector3 first;
  Vector3 second;
};

/// Of one point.
struct CloudQuadric {
  std::array<float, 3> normal;     ///< n
  float offset;                    ///< c [m]
  std::array<float, 6> curvature;  ///< H [1/m]: xx xy xz yy yz zz
};

/// f and its derivatives at one place.
struct CloudBlend {
  double height_m = 0.0;  ///< f
  Vector3 gradient = Vector3::Zero();
  Matrix3 curvature_per_m = Matrix3::Zero();  ///< mean of Hᵢ
  double reach_m = 0.0;                       ///< mean of ρᵢ
  double stiffness_ratio = 1.0;
  double weight = 0.0;  ///< Σ wᵢ; 0: nothing reaches this place
};

/// Accumulates the blend point by point, in any order.
class CloudBlender {
 public:
  /// @param side  unit normal of the viewed side
  CloudBlender(const Vector3& place_m, const Vector3& side) noexcept
      : place_m_(place_m), side_(side) {}
  /// @param point_m  in the frame of the place; a point that does not reach it adds nothing
  void add(const Vector3& point_m, double reach_m, const CloudQuadric& quadric,
           double stiffness_ratio) noexcept;
  [[nodiscard]] CloudBlend result() const noexcept;

 private:
  Vector3 place_m_;
  Vector3 side_;
  double weight_ = 0.0;
  double height_ = 0.0;
  double reach_ = 0.0;
  double stiffness_ = 0.0;
  Vector3 gradient_ = Vector3::Zero();         // Σ w ∇g
  Vector3 weight_gradient_ = Vector3::Zero();  // Σ ∇w
  Vector3 height_gradient_ = Vector3::Zero();  // Σ g ∇w
  Matrix3 curvature_ = Matrix3::Zero();
};

/// The surface near one place of a blend, seen from a tool.
struct CloudStep {
  double distance_m = 0.0;
  double trust_radius_m = 0.0;
  Vector3 normal = Vector3::Zero();
  Matrix3 curvature_per_m = Matrix3::Zero();
  Vector3 to_foot_m = Vector3::Zero();  ///< from the place of the blend
  double tangent_m = 0.0;               ///< length of that along the surface
};
/// @param from_place_m  of the tool
[[nodiscard]] CloudStep step_towards_foot(const CloudBlend& blend,
                                          const Vector3& from_place_m) noexcept;

/// The surface as a tool sees it, found from its nearest point.
/// @param nearest_m  the point nearest to the tool, in the same frame
/// @param side       unit, normal of that point
/// @param gather     gather(place, blender) adds at least the points that reach the place
template <class Gather>
[[nodiscard]] SurfaceView view_of_cloud(const Vector3& tool_m, const Vector3& nearest_m,
                                        const Vector3& side, const Gather& gather) noexcept {
  // Each step moves the place closer to the foot of the tool's perpendicular. Two or three suffice,
  // except far away, where the nearest point is only approximate.
  constexpr int kMaxSteps = 12;
  constexpr double kCloseEnough = 0.01;  // of the reach; the error of the last step is its square
  // a tenth of the way to the border the distance differs from a plane's by at most 0.5 %
  constexpr double kBorderTrustRatio = 0.1;

  SurfaceView view;
  view.distance_m = std::numeric_limits<double>::infinity();
  Vector3 place_m = nearest_m;
  Vector3 supported_m = place_m;  // last place within the reach of a point
  bool has_left = false;          // some place was outside the reach of all points
  for (int i = 0; i < kMaxSteps; ++i) {
    CloudBlender blender(place_m, side);
    gather(place_m, blender);
    const CloudBlend blend = blender.result();
    if (blend.weight <= 0.0) {
      has_left = true;
      place_m = 0.5 * (place_m + supported_m);
      continue;
    }
    supported_m = place_m;
    const CloudStep step = step_towards_foot(blend, tool_m - place_m);
    view.distance_m = step.distance_m;
    view.normal = step.normal;
    view.curvature_per_m = step.curvature_per_m;
    view.stiffness_ratio = blend.stiffness_ratio;
    view.trust_radius_m = step.trust_radius_m;
    if (step.tangent_m < kCloseEnough * blend.reach_m) return view;
    place_m += step.to_foot_m;
  }
  // the foot lies beyond the border: the view is that of the border, from outside
  if (has_left) {
    const Vector3 from_border = tool_m - supported_m;
    view.distance_m = from_border.norm();
    view.normal = view.distance_m > 0.0 ? Vector3(from_border / view.distance_m) : side;
    view.curvature_per_m.setZero();
    view.trust_radius_m =
        std::clamp(kBorderTrustRatio * view.distance_m, kMinTrustRadiusM, kMaxTrustRadiusM);
  }
  return view;
}

}  // namespace palpate
