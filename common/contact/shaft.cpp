// SPDX-License-Identifier: Apache-2.0
#include "common/contact/shaft.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {
namespace {

constexpr int kFineSteps = 12;
constexpr double kLevel = 1e-6;
// Distances differ by rounding [m].
constexpr double kSame_m = 1e-12;

/// What earlier searches know of the places on this segment.
void follow(const ShaftSegment& segment, ShaftSearch& search) noexcept {
  const ShaftSegment& last = search.segment;
  const double moved_m = std::max((segment.at_m(segment.first_m) - last.at_m(last.first_m)).norm(),
                                  (segment.at_m(segment.last_m) - last.at_m(last.last_m)).norm());
  const bool is_same = search.is_begun && std::isfinite(moved_m) &&
                       segment.first_m == last.first_m && segment.last_m == last.last_m;
  for (double& at_least_m : search.at_least_m) {
    at_least_m = is_same ? at_least_m - moved_m : -std::numeric_limits<double>::infinity();
  }
  search.is_begun = true;
  search.segment = segment;
}

/// The surface from one place on the segment.
struct Seen {
  double along_m = 0.0;
  SurfaceView view{.distance_m = std::numeric_limits<double>::infinity()};
  double slope = 0.0;  ///< of the distance, along the segment
};

}  // namespace

ShaftSegment shaft_segment(const ToolShape& tool, const Vector3& tip_m,
                           const Vector3& direction) noexcept {
  return {.tip_m = tip_m,
          .direction = direction,
          .first_m = std::min(tool.tip_radius_m + tool.tip_radius_m, tool.shaft_length_m),
          .last_m = tool.shaft_length_m};
}

double nearest_along(const Surface& surface, const ShaftSegment& segment, SheetSide side,
                     double limit_m, double start_m, ShaftSearch& search,
                     SurfaceHint& hint) noexcept {
  const double step_m = (segment.last_m - segment.first_m) / static_cast<double>(kShaftSteps);
  const auto look = [&](double along_m) {
    ++hint.views;
    Seen seen{.along_m = along_m, .view = surface.view(segment.at_m(along_m), hint)};
    if (side == SheetSide::kBehind || (side == SheetSide::kEither && seen.view.distance_m < 0.0)) {
      seen.view = seen.view.from_behind();
    }
    seen.slope = seen.view.normal.dot(segment.direction);
    return seen;
  };

  // coarse: a sixteenth of the segment apart, where the surface may be nearer than the nearest
  follow(segment, search);
  Seen best{.along_m = segment.first_m};
  if (start_m >= segment.first_m && start_m <= segment.last_m) best = look(start_m);
  std::uint32_t best_cell = hint.cell;
  double uncovered_at_least_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i <= kShaftSteps; ++i) {
    double& at_least_m = search.at_least_m[i];
    const double enough_m = std::min(best.view.distance_m, limit_m + step_m);
    if (at_least_m >= enough_m) continue;
    const double along_m =
        i < kShaftSteps ? segment.first_m + static_cast<double>(i) * step_m : segment.last_m;
    const Vector3 point_m = segment.at_m(along_m);
    const double unknown_m = surface.unknown_m(point_m);
    at_least_m = std::min(surface.known_at_least_m(point_m, hint), unknown_m);
    if (at_least_m >= enough_m) continue;

    const std::uint32_t uncovered_views = hint.uncovered_views;
    hint.cell = search.cells[i];
    const Seen seen = look(along_m);
    search.cells[i] = hint.cell;
    at_least_m = std::min(seen.view.distance_m, unknown_m);
    // not all examined, or nothing found where all was looked for
    if (!std::isfinite(seen.view.distance_m) && (hint.is_exhausted() || !hint.only_covered)) {
      at_least_m = -std::numeric_limits<double>::infinity();
    }
    if (hint.uncovered_views > uncovered_views) {
      hint.uncovered_views = uncovered_views;
      uncovered_at_least_m = std::min(uncovered_at_least_m, at_least_m);
    }
    if (seen.view.distance_m < best.view.distance_m) {
      best = seen;
      best_cell = hint.cell;
    }
    for (std::size_t k = 0; k <= kShaftSteps; ++k) {
      const double apart_m = step_m * std::abs(static_cast<double>(k) - static_cast<double>(i));
      search.at_least_m[k] = std::max(search.at_least_m[k], at_least_m - apart_m);
    }
  }
  hint.cell = best_cell;
  if (uncovered_at_least_m < std::min(best.view.distance_m, limit_m + step_m)) {
    ++hint.uncovered_views;
  }
  if (!(best.view.distance_m < limit_m + step_m)) return -1.0;

  // fine: Newton's method for the slope of the distance along the segment; on facets, where the
  // slope is constant, to where the tangents meet; safeguarded by bisection
  struct End {
    double along_m = 0.0;
    double distance_m = 0.0;
    double slope = 0.0;
    bool is_seen = false;
  };
  const auto end_at = [](const Seen& seen) {
    return End{seen.along_m, seen.view.distance_m, seen.slope, true};
  };
  End low{.along_m = std::max(segment.first_m, best.along_m - step_m)};
  End high{.along_m = std::min(segment.last_m, best.along_m + step_m)};
  for (int i = 0; i < kFineSteps; ++i) {
    End& end = best.slope > 0.0 ? low : high;  // downhill
    if (std::abs(best.slope) < kLevel || end.along_m == best.along_m) break;
    const double bend = segment.direction.dot(best.view.curvature_per_m * segment.direction);
    double next_m = end.along_m;
    if (bend > 0.0) {
      next_m = best.along_m - best.slope / bend;
    } else if (end.is_seen && end.slope * best.slope < 0.0) {
      next_m = (end.distance_m - best.view.distance_m + best.slope * best.along_m -
                end.slope * end.along_m) /
               (best.slope - end.slope);
    }
    const bool is_within = std::min(end.along_m, best.along_m) < next_m &&
                           next_m < std::max(end.along_m, best.along_m);
    if (!is_within) next_m = 0.5 * (best.along_m + end.along_m);
    const Seen seen = look(next_m);
    const bool is_nearer = seen.view.distance_m < best.view.distance_m ||
                           (seen.view.distance_m < best.view.distance_m + kSame_m &&
                            std::abs(seen.slope) < std::abs(best.slope));
    if (is_nearer) {
      (best.slope > 0.0 ? high : low) = end_at(best);
      best = seen;
    } else {
      end = end_at(seen);
    }
  }
  return best.view.distance_m < limit_m ? best.along_m : -1.0;
}

}  // namespace palpate
