// SPDX-License-Identifier: Apache-2.0
// surface.h — the interface through which the contact sees a surface.
#pragma once

#include <limits>

#include "common/contact/surface_view.h"
#include "common/core/vector.h"

namespace palpate {

/// Immutable. Thread-safe. view() is real-time safe: no allocation, no lock, no throw, bounded
/// time.
class Surface {
 public:
  virtual ~Surface() = default;

  /// @param point_m  in the surface's frame; for a point that is not finite or too far away for the
  ///     arithmetic the distance is infinite or not a number
  [[nodiscard]] virtual SurfaceView view(const Vector3& point_m,
                                         SurfaceHint& hint) const noexcept = 0;
  [[nodiscard]] SurfaceView view(const Vector3& point_m) const noexcept {
    SurfaceHint none;
    return view(point_m, none);
  }

  /// What view() does not know of the surface is nowhere nearer to the point than this, m; may be
  /// below 0.
  [[nodiscard]] virtual double unknown_m(const Vector3& /*point_m*/) const noexcept {
    return std::numeric_limits<double>::infinity();
  }
  /// What it knows is nowhere nearer than this, m ≥ 0: a lower bound of the distance that costs
  /// less than a view.
  /// @param hint  of the view that it saves: its work is counted there
  [[nodiscard]] virtual double known_at_least_m(const Vector3& /*point_m*/,
                                                SurfaceHint& /*hint*/) const noexcept {
    return 0.0;
  }

  /// True of an open surface: it has no inside, and a tool may be on either side of it.
  [[nodiscard]] virtual bool is_sheet() const noexcept { return false; }

 protected:
  Surface() = default;
  Surface(const Surface&) = default;
  Surface(Surface&&) = default;
  Surface& operator=(const Surface&) = default;
  Surface& operator=(Surface&&) = default;
};

}  // namespace palpate
