// SPDX-License-Identifier: Apache-2.0
// analytic_surfaces.h — half-space, sphere, box and capsule seen from one point, by formula.
#pragma once

#include <variant>

#include "common/contact/bounds.h"
#include "common/contact/surface.h"
#include "common/contact/surface_view.h"
#include "common/core/tissue.h"
#include "common/core/vector.h"

namespace palpate {

/// Exact everywhere; the plane has no curvature. Needs |normal| = 1.
[[nodiscard]] SurfaceView view(const HalfSpaceGeometry& half_space,
                               const Vector3& point_m) noexcept;

/// Exact. At the centre (closer than 1 pm) the direction is undefined: the normal is +z there, the
/// curvature, which grows as 1/distance from the centre, is zero, and the trust radius is the
/// least. Elsewhere the trust radius ends at the centre.
[[nodiscard]] SurfaceView view(const SphereGeometry& sphere, const Vector3& point_m) noexcept;

/// Outside: the distance to the nearest point of the box, on a face, an edge (curved like a
/// cylinder) or a corner (curved like a sphere). Inside, or closer than 1 pm: the nearest face. Of
/// equally near faces the first in the order x, y, z counts, and of two opposite ones the one in
/// positive direction, so the normal jumps there while the distance is continuous. The trust radius
/// ends where another face, edge or corner becomes the nearest.
[[nodiscard]] SurfaceView view(const BoxGeometry& box, const Vector3& point_m) noexcept;

/// Exact. On the axis the direction is undefined: the normal is some vector across it, and the
/// curvature is zero. The trust radius ends where the rounded ends begin, and at the axis.
[[nodiscard]] SurfaceView view(const CapsuleGeometry& capsule, const Vector3& point_m) noexcept;

/// From the point to the line between the capsule's ends, m ≥ 0.
[[nodiscard]] double distance_to_axis_m(const CapsuleGeometry& capsule,
                                        const Vector3& point_m) noexcept;

/// The smallest box around the tissue.
[[nodiscard]] Bounds bounds_of(const SphereGeometry& sphere) noexcept;
[[nodiscard]] Bounds bounds_of(const BoxGeometry& box) noexcept;
[[nodiscard]] Bounds bounds_of(const CapsuleGeometry& capsule) noexcept;

/// One of these shapes as a surface.
class AnalyticSurface final : public Surface {
 public:
  using Form = std::variant<HalfSpaceGeometry, SphereGeometry, BoxGeometry, CapsuleGeometry>;

  AnalyticSurface() = default;
  explicit AnalyticSurface(const Form& form) : form_(form) {}

  [[nodiscard]] SurfaceView view(const Vector3& point_m,
                                 SurfaceHint& /*hint*/) const noexcept override {
    return std::visit([&](const auto& shape) { return palpate::view(shape, point_m); }, form_);
  }
  using Surface::view;

 private:
  Form form_;
};

}  // namespace palpate
