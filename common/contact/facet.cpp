// SPDX-License-Identifier: Apache-2.0
#include "common/contact/facet.h"

#include <cmath>

namespace palpate {
namespace {

// Below this length a direction is rounding, not geometry [m].
constexpr double kShortestOffset = 1e-12;

}  // namespace

FacetFoot foot_on_facet(const Vector3& a, const Vector3& b, const Vector3& c,
                        const Vector3& point_m) noexcept {
  const Vector3 ab = b - a;
  const Vector3 ac = c - a;
  FacetFoot foot;
  const auto at_corner = [&](int corner, const Vector3& place) {
    foot.corner = corner;
    foot.point_m = place;
  };
  const auto on_edge = [&](int edge, const Vector3& from, const Vector3& along, double t) {
    foot.edge = edge;
    foot.point_m = from + t * along;
  };

  const Vector3 ap = point_m - a;
  const double d1 = ab.dot(ap);
  const double d2 = ac.dot(ap);
  const Vector3 bp = point_m - b;
  const double d3 = ab.dot(bp);
  const double d4 = ac.dot(bp);
  const Vector3 cp = point_m - c;
  const double d5 = ab.dot(cp);
  const double d6 = ac.dot(cp);
  const double va = d3 * d6 - d5 * d4;
  const double vb = d5 * d2 - d1 * d6;
  const double vc = d1 * d4 - d3 * d2;
  if (d1 <= 0.0 && d2 <= 0.0) {
    at_corner(0, a);
  } else if (d3 >= 0.0 && d4 <= d3) {
    at_corner(1, b);
  } else if (d6 >= 0.0 && d5 <= d6) {
    at_corner(2, c);
  } else if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) {
    on_edge(0, a, ab, d1 / (d1 - d3));
  } else if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0) {
    on_edge(1, b, c - b, (d4 - d3) / ((d4 - d3) + (d5 - d6)));
  } else if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) {
    on_edge(2, a, ac, d2 / (d2 - d6));
  } else {
    const double per_sum = 1.0 / (va + vb + vc);
    foot.point_m = a + vb * per_sum * ab + vc * per_sum * ac;
  }
  foot.squared_distance = (point_m - foot.point_m).squaredNorm();
  return foot;
}

SurfaceView view_of_facet(const FacetFoot& foot, const Vector3& side, const Vector3& face,
                          const Vector3& along, const Vector3& point_m) noexcept {
  const Vector3 from_foot = point_m - foot.point_m;
  const double distance_m = std::sqrt(foot.squared_distance);
  const double sign = from_foot.dot(side) < 0.0 ? -1.0 : 1.0;
  SurfaceView view;
  view.distance_m = sign * distance_m;
  if (distance_m <= kShortestOffset) {
    const double length = side.norm();
    view.normal = length > 0.0 ? Vector3(side / length) : face;
    return view;
  }
  if (foot.edge < 0 && foot.corner < 0) {
    view.normal = face;
    return view;
  }
  // a corner is curved like a sphere, an edge like a cylinder
  view.normal = sign / distance_m * from_foot;
  view.curvature_per_m = Matrix3::Identity() - view.normal * view.normal.transpose();
  if (foot.edge >= 0) view.curvature_per_m -= along * along.transpose();
  view.curvature_per_m /= view.distance_m;
  return view;
}

}  // namespace palpate
