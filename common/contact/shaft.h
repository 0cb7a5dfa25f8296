// shaft.h — where a straight shaft is deepest in a tissue.
#pragma once

#include "common/contact/surface.h"
#include "common/core/vector.h"

namespace palpate {

/// A straight segment behind the tip, in the frame of a surface.
struct ShaftSegment {
  Vector3 tip_m = Vector3::Zero();
  Vector3 direction = Vector3::UnitZ();  ///< unit, from the tip to the handle
  double first_m = 0.0;                  ///< distance from the tip at which the segment begins
  double last_m = 0.0;                   ///< and at which it ends

  [[nodiscard]] Vector3 at_m(double along_m) const noexcept { return tip_m + along_m * direction; }
};

/// Which side of a sheet counts as outside.
enum class SheetSide { kFront, kBehind, kEither };

/// Distance from the tip at which the segment is nearest to the surface, m; below 0 if no part is
/// nearer than `limit_m`. At most 29 views. No allocation, no throw.
[[nodiscard]] double nearest_along(const Surface& surface, const ShaftSegment& segment,
                                   SheetSide side, double limit_m, SurfaceHint& hint) noexcept;

}  // namespace palpate
