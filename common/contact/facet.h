// SPDX-License-Identifier: Apache-2.0
// facet.h — a triangle of a surface seen from one point.
#pragma once

#include "common/contact/surface_view.h"
#include "common/core/vector.h"

namespace palpate {

/// The nearest point of a triangle a b c.
struct FacetFoot {
  Vector3 point_m = Vector3::Zero();
  double squared_distance = 0.0;
  int edge = -1;    ///< from corner `edge` to the next, if the foot is on it
  int corner = -1;  ///< the corner, if the foot is there
};

/// Source: [Ericson05] §5.1.5.
[[nodiscard]] FacetFoot foot_on_facet(const Vector3& a, const Vector3& b, const Vector3& c,
                                      const Vector3& point_m) noexcept;

/// The surface as the point sees it through that foot: round at an edge or corner. The trust radius
/// is not set.
/// @param side     normal of the face, edge or corner at the foot, any length: it decides which
/// side
///     is outside
/// @param face     unit normal of the facet
/// @param along    unit direction of the edge; used only if the foot is on one
[[nodiscard]] SurfaceView view_of_facet(const FacetFoot& foot, const Vector3& side,
                                        const Vector3& face, const Vector3& along,
                                        const Vector3& point_m) noexcept;

}  // namespace palpate
