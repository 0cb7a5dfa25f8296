// SPDX-License-Identifier: Apache-2.0
#include "physics_node/surfaces/shape.h"

#include <type_traits>

#include "common/contact/analytic_surfaces.h"

namespace palpate::physics {
namespace {

SurfaceView view_of(const PlacedSurface& placed, const Vector3& point_m,
                    SurfaceHint& hint) noexcept {
  const Matrix3 R = placed.rotation.toRotationMatrix();
  SurfaceView seen = placed.surface->view(R.transpose() * (point_m - placed.position_m), hint);
  seen.normal = R * seen.normal;
  seen.curvature_per_m = R * seen.curvature_per_m * R.transpose();
  return seen;
}

/// The axis-aligned box around the rotated box.
Bounds bounds_of(const PlacedSurface& placed) noexcept {
  const Bounds own = placed.surface->bounds();
  const Matrix3 R = placed.rotation.toRotationMatrix();
  const Vector3 center_m = placed.position_m + R * own.center_m();
  const Vector3 half_m = R.cwiseAbs() * (0.5 * (own.highest_m - own.lowest_m));
  return {center_m - half_m, center_m + half_m};
}

}  // namespace

SurfaceView Shape::view(const Vector3& point_m, SurfaceHint& hint) const noexcept {
  return std::visit(
      [&](const auto& form) {
        if constexpr (std::is_same_v<std::decay_t<decltype(form)>, PlacedSurface>) {
          return view_of(form, point_m, hint);
        } else {
          return palpate::view(form, point_m);
        }
      },
      form_);
}

std::optional<Bounds> Shape::bounds() const noexcept {
  return std::visit(
      [](const auto& form) -> std::optional<Bounds> {
        if constexpr (std::is_same_v<std::decay_t<decltype(form)>, HalfSpaceGeometry>) {
          return std::nullopt;
        } else {
          return bounds_of(form);
        }
      },
      form_);
}

bool Shape::is_sheet() const noexcept {
  const FileSurface* const surface = file_surface();
  return surface != nullptr && surface->is_sheet();
}

const FileSurface* Shape::file_surface() const noexcept {
  const auto* const placed = std::get_if<PlacedSurface>(&form_);
  return placed != nullptr ? placed->surface.get() : nullptr;
}

}  // namespace palpate::physics
