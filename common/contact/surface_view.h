// SPDX-License-Identifier: Apache-2.0
// surface_view.h — a surface seen from one point: distance, direction, curvature.
#pragma once

#include <cstdint>

#include "common/core/vector.h"

namespace palpate {

/// Trust radius of a surface that continues without change, such as a plane [m].
inline constexpr double kMaxTrustRadiusM = 1000.0;
/// Least trust radius, also where the surface is about to change [m].
inline constexpr double kMinTrustRadiusM = 1e-4;

/// The surface as one point sees it, in the frame of the point.
struct SurfaceView {
  double distance_m = 0.0;            ///< signed: > 0 outside the tissue, < 0 inside
  Vector3 normal = Vector3::UnitZ();  ///< unit, out of the tissue; the gradient of the distance
  Matrix3 curvature_per_m = Matrix3::Zero();  ///< Hessian of the distance; curvature · normal = 0
  double stiffness_ratio = 1.0;               ///< local factor on the material's stiffness
  /// Distance from the point within which this quadric describes the surface; > 0.
  double trust_radius_m = kMaxTrustRadiusM;

  /// The surface continues without change, so there is no way around it.
  [[nodiscard]] bool is_plane() const noexcept { return trust_radius_m >= kMaxTrustRadiusM; }

  /// The same surface with inside and outside exchanged.
  [[nodiscard]] SurfaceView from_behind() const noexcept {
    SurfaceView view = *this;
    view.distance_m = -distance_m;
    view.normal = -normal;
    view.curvature_per_m = -curvature_per_m;
    return view;
  }
};

/// Where the last view of one caller ended; zero at first. It saves time where the tool moves
/// little between two steps and never changes a result.
struct SurfaceHint {
  std::uint32_t cell = 0;
  std::uint32_t octree_cells_visited = 0;  ///< by the views since the caller last set it to 0
  std::uint32_t last_cell_hits = 0;        ///< views whose nearest point was in the last one's cell
  std::uint32_t views = 0;                 ///< by the proxy and along the shaft, since then
  std::uint32_t uncovered_views = 0;       ///< views that another, unknown part may have changed
  std::uint32_t work = 0;                  ///< what the views looked at, since then; only of tiles
  std::uint32_t most_work = 0;  ///< a view that would need more ends, uncovered; 0: no limit
  bool only_covered = false;    ///< a view that is not covered need not see anything

  /// Some view ended because of most_work.
  [[nodiscard]] bool is_exhausted() const noexcept { return most_work > 0 && work > most_work; }
};

}  // namespace palpate
