// cloud_surface.h — a smooth surface through a cloud of points.
//
// Each point carries a quadric: the weighted least-squares fit to its 48 nearest neighbours, with
//
//   gᵢ(x) = nᵢ·r + ½ r·Hᵢ r − cᵢ,   r = x − pᵢ
//
// and a reach ρᵢ of about 3 times the spacing of the points around it. The surface is where the
// blend of the quadrics that reach x is zero:
//
//   f(x) = Σ wᵢ gᵢ / Σ wᵢ,   wᵢ = (1 − |r|²/ρᵢ²)³ inside the reach
//
// It is twice continuously differentiable. It runs not through the points but through the mean of
// their noise, and reproduces planes and spheres. Fitting is done once; a query only blends.
//
// Limits:
//  - thin sheets: where normals differ by more than 90° quadrics are blended less, beyond 120° not
//    at all, so the two sides of a sheet stay separate however thin it is. A view shows the side of
//    the nearest point: it changes half-way through the sheet, and the normal with it. Where the
//    sheet is thinner than the spacing, estimated normals cannot separate the two sides.
//  - holes: a gap as wide as the reach is bridged by its rim. In a wider gap, and beyond the border
//    of an open cloud, the surface ends one reach from the last point; a point over the gap is
//    outside, and sees that border.
//  - edges are rounded to about the reach; curvature is limited to 1/reach.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "common/core/vector.h"
#include "physics_node/surfaces/file_surface.h"
#include "physics_node/surfaces/octree.h"

namespace palpate::physics {

/// Points of a surface, as in a file.
struct PointCloud {
  std::vector<Vector3> points_m;
  std::vector<Vector3> normals;          ///< out of the tissue, any length but 0; or empty
  std::vector<double> stiffness_ratios;  ///< factor on the material's stiffness, ≥ 0; or empty
};

class CloudSurface final : public FileSurface {
 public:
  /// Fewer points define no surface.
  static constexpr std::size_t kMinPoints = 10;

  /// Missing normals are estimated from the neighbours and oriented consistently; the highest point
  /// (z) of each connected part faces up, which is out of the tissue if the part is closed.
  /// @param cloud  everything finite, ≥ kMinPoints
  explicit CloudSurface(const PointCloud& cloud);

  /// The distance is that to the foot of the perpendicular on the surface; normal and curvature are
  /// derivatives of the distance. The curvature is the mean of the quadrics' curvatures, which is
  /// smoother than the second derivative of f where the points are noisy.
  ///
  /// The trust radius covers the points whose foot stays within the reach of the blended quadrics,
  /// up to the centre of curvature. It does not account for the other side of a thin sheet.
  [[nodiscard]] SurfaceView view(const Vector3& point_m, SurfaceHint& hint) const noexcept override;
  using Surface::view;

  [[nodiscard]] Bounds bounds() const noexcept override { return bounds_; }
  [[nodiscard]] std::size_t bytes() const noexcept override;

  /// The octree, in coordinates relative to origin_m().
  [[nodiscard]] const Octree& tree() const noexcept { return tree_; }
  [[nodiscard]] const Vector3& origin_m() const noexcept { return origin_m_; }
  /// Fitted normal of a point of the tree.
  [[nodiscard]] Vector3 normal(std::uint32_t point) const noexcept;

  /// f and its derivatives at one place, blended over points that reach it.
  struct Blend {
    double height_m = 0.0;  ///< f
    Vector3 gradient = Vector3::Zero();
    Matrix3 curvature_per_m = Matrix3::Zero();  ///< mean of Hᵢ
    double reach_m = 0.0;                       ///< mean of ρᵢ
    double stiffness_ratio = 1.0;
    double weight = 0.0;  ///< Σ wᵢ; 0: nothing reaches this place
  };
  /// Accumulates the blend point by point, so that any search can supply the points.
  class Blender {
   public:
    /// @param place_m  relative to origin_m()        @param side  unit normal of the viewed side
    Blender(const CloudSurface& surface, const Vector3& place_m, const Vector3& side) noexcept
        : surface_(surface), place_m_(place_m), side_(side) {}
    void add(std::uint32_t point) noexcept;
    [[nodiscard]] Blend result() const noexcept;

   private:
    const CloudSurface& surface_;
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

  /// view() with any search: `nearest(place)` returns a point of the tree or kNoPoint, and
  /// `gather(place, visit)` calls visit(point) for at least the points that reach the place.
  template <class Nearest, class Gather>
  [[nodiscard]] SurfaceView view_with(const Vector3& point_m, const Nearest& nearest,
                                      const Gather& gather) const noexcept;
  static constexpr std::uint32_t kNoPoint = 0xffffffff;

 private:
  // 40 bytes per point, in addition to the 16 of the octree
  struct Quadric {
    std::array<float, 3> normal{};
    float offset = 0.0F;
    std::array<float, 6> curvature{};  // xx xy xz yy yz zz
  };
  struct Step {
    double distance_m = 0.0;
    double trust_radius_m = 0.0;
    Vector3 normal = Vector3::Zero();
    Matrix3 curvature_per_m = Matrix3::Zero();
    Vector3 to_foot_m = Vector3::Zero();  // from the place of the blend
    double tangent_m = 0.0;               // length of that along the surface
  };
  static Step step_towards_foot(const Blend& blend, const Vector3& from_place_m) noexcept;

  [[nodiscard]] Vector3 estimate_normal(std::uint32_t point, Octree::Hint& hint) const;
  [[nodiscard]] std::vector<Vector3> estimate_normals() const;
  void orient(std::vector<Vector3>& normals) const;
  void fit(std::uint32_t point, const std::vector<Vector3>& normals, Octree::Hint& hint,
           std::vector<float>& reaches);

  Vector3 origin_m_ = Vector3::Zero();
  Bounds bounds_;
  Octree tree_;
  std::vector<Quadric> quadrics_;
  std::vector<float> stiffness_ratios_;  // empty: all 1
  float near_m_ = 0.0F;                  // beyond, the nearest point may be approximate
};

template <class Nearest, class Gather>
SurfaceView CloudSurface::view_with(const Vector3& point_m, const Nearest& nearest,
                                    const Gather& gather) const noexcept {
  // Each step moves the place closer to the foot of the tool's perpendicular. Two or three suffice,
  // except far away, where the nearest point is only approximate.
  constexpr int kMaxSteps = 12;
  constexpr double kCloseEnough = 0.01;  // of the reach; the error of the last step is its square
  // a tenth of the way to the border the distance differs from a plane's by at most 0.5 %
  constexpr double kBorderTrustRatio = 0.1;

  SurfaceView view;
  view.distance_m = std::numeric_limits<double>::infinity();
  const Vector3 tool_m = point_m - origin_m_;
  const std::uint32_t start = nearest(tool_m);
  if (start == kNoPoint) return view;

  const Octree::Point& first = tree_.points()[start];
  const Vector3 side = normal(start);
  Vector3 place_m(first.x, first.y, first.z);
  Vector3 supported_m = place_m;  // last place within the reach of a point
  bool has_left = false;          // some place was outside the reach of all points
  for (int i = 0; i < kMaxSteps; ++i) {
    Blender blender(*this, place_m, side);
    gather(place_m, [&](std::uint32_t point) { blender.add(point); });
    const Blend blend = blender.result();
    if (blend.weight <= 0.0) {
      has_left = true;
      place_m = 0.5 * (place_m + supported_m);
      continue;
    }
    supported_m = place_m;
    const Step step = step_towards_foot(blend, tool_m - place_m);
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

}  // namespace palpate::physics
