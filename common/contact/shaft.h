// SPDX-License-Identifier: Apache-2.0
// shaft.h — where a straight shaft is deepest in a tissue.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/contact/surface.h"
#include "common/core/tissue.h"
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

/// The part of the shaft that touches: from one diameter of the tip behind its centre on.
[[nodiscard]] ShaftSegment shaft_segment(const ToolShape& tool, const Vector3& tip_m,
                                         const Vector3& direction) noexcept;

/// A segment is looked at in steps of this share of its length.
inline constexpr std::size_t kShaftSteps = 16;

/// What a search along a shaft leaves for the next one along the same shaft, a little later: it
/// saves views and never changes a result.
struct ShaftSearch {
  bool is_begun = false;
  ShaftSegment segment{};  ///< that was searched
  /// No part of the surface is nearer than this to the places on it.
  std::array<double, kShaftSteps + 1> at_least_m{};
  std::array<std::uint32_t, kShaftSteps + 1> cells{};  ///< SurfaceHint::cell of their views
};

/// Which side of a sheet counts as outside.
enum class SheetSide { kFront, kBehind, kEither };

/// Distance from the tip at which the segment is nearest to the surface, m; below 0 if no part is
/// nearer than `limit_m`. At most 30 views. Only those count as uncovered that may be nearest.
/// No allocation, no throw.
/// @param start_m  distance from the tip at which it was nearest before; below 0: none
[[nodiscard]] double nearest_along(const Surface& surface, const ShaftSegment& segment,
                                   SheetSide side, double limit_m, double start_m,
                                   ShaftSearch& search, SurfaceHint& hint) noexcept;

}  // namespace palpate
