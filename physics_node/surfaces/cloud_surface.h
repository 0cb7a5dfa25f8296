// SPDX-License-Identifier: Apache-2.0
// cloud_surface.h — a smooth surface through a cloud of points.
//
// Each point carries a quadric, the weighted least-squares fit to its 48 nearest neighbours, and a
// reach of about 3 times the spacing of the points around it. The surface is where their blend is
// zero (common/contact/cloud/cloud_blend.h).
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

#include "common/contact/cloud/cloud_blend.h"
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
  /// Fitted normal, quadric and stiffness ratio of a point of the tree.
  [[nodiscard]] Vector3 normal(std::uint32_t point) const noexcept;
  [[nodiscard]] const CloudQuadric& quadric(std::uint32_t point) const noexcept {
    return quadrics_[point];
  }
  [[nodiscard]] double stiffness_ratio(std::uint32_t point) const noexcept {
    return stiffness_ratios_.empty() ? 1.0 : static_cast<double>(stiffness_ratios_[point]);
  }

  /// view() with any search: `nearest(place)` returns a point of the tree or kNoPoint, and
  /// `gather(place, visit)` calls visit(point) for at least the points that reach the place.
  template <class Nearest, class Gather>
  [[nodiscard]] SurfaceView view_with(const Vector3& point_m, const Nearest& nearest,
                                      const Gather& gather) const noexcept;
  static constexpr std::uint32_t kNoPoint = 0xffffffff;

 private:
  [[nodiscard]] Vector3 estimate_normal(std::uint32_t point, Octree::Hint& hint) const;
  [[nodiscard]] std::vector<Vector3> estimate_normals() const;
  void orient(std::vector<Vector3>& normals) const;
  void fit(std::uint32_t point, const std::vector<Vector3>& normals, Octree::Hint& hint,
           std::vector<float>& reaches);

  Vector3 origin_m_ = Vector3::Zero();
  Bounds bounds_;
  Octree tree_;
  std::vector<CloudQuadric> quadrics_;   // 40 bytes per point, in addition to the 16 of the octree
  std::vector<float> stiffness_ratios_;  // empty: all 1
  float near_m_ = 0.0F;                  // beyond, the nearest point may be approximate
};

template <class Nearest, class Gather>
SurfaceView CloudSurface::view_with(const Vector3& point_m, const Nearest& nearest,
                                    const Gather& gather) const noexcept {
  const Vector3 tool_m = point_m - origin_m_;
  const std::uint32_t start = nearest(tool_m);
  if (start == kNoPoint) return {.distance_m = std::numeric_limits<double>::infinity()};
  const auto place_of = [&](std::uint32_t point) {
    const Octree::Point& p = tree_.points()[point];
    return Vector3(p.x, p.y, p.z);
  };
  return view_of_cloud(tool_m, place_of(start), normal(start),
                       [&](const Vector3& place_m, CloudBlender& blender) {
                         gather(place_m, [&](std::uint32_t point) {
                           blender.add(place_of(point), tree_.points()[point].reach,
                                       quadrics_[point], stiffness_ratio(point));
                         });
                       });
}

}  // namespace palpate::physics
