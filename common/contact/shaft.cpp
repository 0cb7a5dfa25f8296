#include "common/contact/shaft.h"

#include <algorithm>
#include <cmath>

namespace palpate {

double nearest_along(const Surface& surface, const ShaftSegment& segment, SheetSide side,
                     double limit_m, SurfaceHint& hint) noexcept {
  constexpr double kCoarseSteps = 16.0;
  constexpr int kFineSteps = 12;
  constexpr double kLevel = 1e-6;
  const double first_m = segment.first_m;
  const double last_m = segment.last_m;
  const double step_m = (last_m - first_m) / kCoarseSteps;
  const auto look = [&](double along_m) {
    ++hint.views;
    const SurfaceView seen = surface.view(segment.at_m(along_m), hint);
    const bool is_behind =
        side == SheetSide::kBehind || (side == SheetSide::kEither && seen.distance_m < 0.0);
    return is_behind ? seen.from_behind() : seen;
  };

  // coarse: steps of a sixteenth of the segment, or as long as the distance allows
  double best_m = first_m;
  SurfaceView best = look(first_m);
  double distance_m = best.distance_m;
  for (double along_m = first_m; along_m < last_m;) {
    const double skip_m = std::max(step_m, distance_m - std::min(best.distance_m, limit_m));
    along_m = std::min(last_m, along_m + skip_m);
    if (!(step_m > 0.0) || !std::isfinite(along_m)) break;
    const SurfaceView seen = look(along_m);
    distance_m = seen.distance_m;
    if (seen.distance_m < best.distance_m) {
      best = seen;
      best_m = along_m;
    }
  }
  if (!(best.distance_m < limit_m + step_m)) return -1.0;

  // fine: Newton's method for the slope of the distance along the segment, safeguarded by bisection
  double low_m = std::max(first_m, best_m - step_m);
  double high_m = std::min(last_m, best_m + step_m);
  for (int i = 0; i < kFineSteps; ++i) {
    const double slope = best.normal.dot(segment.direction);
    double& end_m = slope > 0.0 ? low_m : high_m;  // downhill
    if (std::abs(slope) < kLevel || end_m == best_m) break;
    const double bend = segment.direction.dot(best.curvature_per_m * segment.direction);
    const double newton_m = bend > 0.0 ? best_m - slope / bend : end_m;
    const bool is_within = low_m < newton_m && newton_m < high_m;
    const double next_m = is_within ? newton_m : 0.5 * (best_m + end_m);
    const SurfaceView seen = look(next_m);
    if (seen.distance_m < best.distance_m) {
      (slope > 0.0 ? high_m : low_m) = best_m;
      best = seen;
      best_m = next_m;
    } else {
      end_m = next_m;
    }
  }
  return best.distance_m < limit_m ? best_m : -1.0;
}

}  // namespace palpate
