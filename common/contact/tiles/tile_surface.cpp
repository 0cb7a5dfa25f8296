// SPDX-License-Identifier: Apache-2.0
#include "common/contact/tiles/tile_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "common/contact/analytic_surfaces.h"
#include "common/contact/facet.h"

namespace palpate {
namespace {

// Feet on an edge or corner that two facets share differ by rounding; relative, of the square.
constexpr double kSameDistance = 1e-9;
// Tiles this much further away than the nearest facet are near, and the tool may move this far
// before they are collected anew [m].
constexpr double kNearMargin_m = 12e-3;
constexpr double kNearStep_m = 6e-3;

// Work, in units of a test of bounds or of a facet's sphere.
constexpr std::uint32_t kViewWork = 64;  // all that does not depend on the tiles
constexpr std::uint32_t kFootWork = 24;  // the foot on a facet, and the normal there
constexpr std::uint32_t kBlendWork = 64;
constexpr std::uint32_t kPointWork = 5;
constexpr std::uint32_t kKeepWork = 8;  // a tile becomes one of the near ones
// After so many better ones collecting the near tiles is given up.
constexpr std::uint32_t kMostKept = 512;

}  // namespace

TileSurface::TileSurface(std::span<const HeldTile> held) : held_(held), all_(held.size()) {}

void TileSurface::reset(const TiledGeometry& geometry) noexcept {
  all_.clear();
  geometry_ = geometry;
  covered_ = {.radius_m = 0.0};
  gap_count_ = 0;
  for (Near& near : near_) {
    near.radius_m = 0.0;
    near.count = 0;
  }
}

void TileSurface::add(std::uint32_t slot) noexcept {
  remove(slot);
  all_.add(slot, held_[slot].bounds);
  for (Near& near : near_) near.offer(slot, held_[slot].bounds);
}

void TileSurface::remove(std::uint32_t slot) noexcept {
  if (!all_.remove(slot)) return;
  for (Near& near : near_) near.remove(slot);
}

void TileSurface::except(const Vector3& center_m, double radius_m) noexcept {
  if (gap_count_ < gaps_.size()) {
    gaps_[gap_count_++] = {center_m, radius_m};
  } else {
    covered_.radius_m = 0.0;
  }
}

double TileSurface::unknown_m(const Vector3& point_m) const noexcept {
  double least_m = covered_.radius_m - distance_to_axis_m(covered_, point_m);
  for (std::size_t i = 0; i < gap_count_; ++i) {
    least_m = std::min(least_m, (point_m - gaps_[i].center_m).norm() - gaps_[i].radius_m);
  }
  return least_m;
}

/// The nearest foot so far, and the sum of the normals of the facets that meet there.
struct TileSurface::Search {
  Vector3 point_m;
  std::uint32_t work = 0;
  FacetFoot best;
  bool is_found = false;
  double best_m;
  std::uint32_t cell = 0;
  Vector3 face = Vector3::Zero();
  Vector3 side = Vector3::Zero();
  Vector3 along = Vector3::Zero();
  std::array<std::uint64_t, 2> feature{};  // vertices of the edge or corner at the foot

  /// Only of what is within this distance.
  Search(const Vector3& point, double most_m) : point_m(point), best_m(most_m) {
    best.squared_distance = most_m * most_m;
  }

  void offer(const HeldTile& tile, std::uint32_t slot, std::size_t index) noexcept {
    work += kFootWork;
    const auto& corners = tile.facets[index];
    const auto vertex = [&](std::size_t i) -> const Vector3& {
      return tile.vertices_m[corners[i % 3]];
    };
    const FacetFoot foot = foot_on_facet(vertex(0), vertex(1), vertex(2), point_m);
    if (!(foot.squared_distance <= best.squared_distance * (1.0 + kSameDistance))) return;

    std::array<std::uint64_t, 2> at{};
    Vector3 normal = tile.normals[index];
    if (foot.corner >= 0) {
      const auto i = static_cast<std::size_t>(foot.corner);
      at = {tile.keys[corners[i]], tile.keys[corners[i]]};
      const Vector3 to_next = (vertex(i + 1) - vertex(i)).normalized();
      const Vector3 to_last = (vertex(i + 2) - vertex(i)).normalized();
      normal *= std::acos(std::clamp(to_next.dot(to_last), -1.0, 1.0));
    } else if (foot.edge >= 0) {
      const auto i = static_cast<std::size_t>(foot.edge);
      at = {tile.keys[corners[i]], tile.keys[corners[(i + 1) % 3]]};
      if (at[0] > at[1]) std::swap(at[0], at[1]);
    }
    const auto this_cell = static_cast<std::uint32_t>(slot * kMaxTileFacets + index);
    const bool is_feature = foot.corner >= 0 || foot.edge >= 0;
    const bool is_same = is_feature && (best.corner >= 0) == (foot.corner >= 0) && at == feature;
    if (is_same) {
      if (this_cell != cell) side += normal;
      return;
    }
    if (!(foot.squared_distance < best.squared_distance)) return;
    best = foot;
    is_found = true;
    best_m = std::sqrt(foot.squared_distance);
    cell = this_cell;
    face = tile.normals[index];
    side = normal;
    feature = at;
    if (foot.edge >= 0) {
      const auto i = static_cast<std::size_t>(foot.edge);
      along = (vertex(i + 1) - vertex(i)).normalized();
    }
  }

  bool offer_all(const HeldTile& tile, std::uint32_t slot) noexcept {
    work += tile.facet_count;
    for (std::size_t i = 0; i < tile.facet_count; ++i) {
      // nearer than neither its sphere nor its plane
      const double most_m = best_m * (1.0 + kSameDistance);
      const Vector3 from_center_m = point_m - tile.centers_m[i];
      const double reach_m = most_m + tile.radii_m[i];
      if (from_center_m.squaredNorm() > reach_m * reach_m) continue;
      if (std::abs(tile.normals[i].dot(from_center_m)) > most_m) continue;
      offer(tile, slot, i);
    }
    return true;
  }
  [[nodiscard]] double limit() const noexcept {
    return best.squared_distance * (1.0 + kSameDistance);
  }
};

/// The nearest point of a cloud.
struct TileSurface::PointSearch {
  Vector3 point_m;
  double best_squared;  // of what may be found, before
  std::uint32_t work = 0;
  const HeldTile* best_tile = nullptr;
  std::size_t best = 0;  // of its points

  bool offer_all(const HeldTile& tile, std::uint32_t /*slot*/) noexcept {
    if (!(tile.core.squared_distance(point_m) <= best_squared)) return false;
    work += kPointWork * tile.point_count;
    const HeldTile::OfPoints squared = tile.squared_distances(point_m);
    Eigen::Index nearest = 0;
    if (!(squared.minCoeff(&nearest) < best_squared)) return true;
    best_squared = squared[nearest];
    best_tile = &tile;
    best = static_cast<std::size_t>(nearest);
    return true;
  }
  [[nodiscard]] double limit() const noexcept { return best_squared; }
};

/// Keeps the tile if it is within the radius; of too many the nearest, within a smaller one.
void TileSurface::Near::offer(std::uint32_t slot, const Bounds& tile) noexcept {
  const double squared = tile.squared_distance(center_m);
  if (!(squared < radius_m * radius_m)) return;
  const double distance_m = std::sqrt(squared);
  if (count == kMaxNear) {
    if (distance_m >= distances_m[count - 1]) {
      radius_m = distance_m;
      return;
    }
    radius_m = distances_m[--count];
  }
  std::size_t place = count++;
  for (; place > 0 && distance_m < distances_m[place - 1]; --place) {
    distances_m[place] = distances_m[place - 1];
    slots[place] = slots[place - 1];
    bounds[place] = bounds[place - 1];
  }
  distances_m[place] = distance_m;
  slots[place] = slot;
  bounds[place] = tile;
}

void TileSurface::Near::remove(std::uint32_t slot) noexcept {
  const auto end = slots.begin() + static_cast<std::ptrdiff_t>(count);
  const auto found = std::find(slots.begin(), end, slot);
  if (found == end) return;
  --count;
  for (auto i = static_cast<std::size_t>(found - slots.begin()); i < count; ++i) {
    slots[i] = slots[i + 1];
    bounds[i] = bounds[i + 1];
    distances_m[i] = distances_m[i + 1];
  }
}

bool TileSurface::Near::has(std::uint32_t slot) const noexcept {
  const auto end = slots.begin() + static_cast<std::ptrdiff_t>(count);
  return std::find(slots.begin(), end, slot) != end;
}

template <class Limit, class Look>
bool TileSurface::Near::look_near(const Vector3& point_m, SurfaceHint& hint, const Limit& limit,
                                  const Look& look) const noexcept {
  for (std::size_t i = 0; i < count; ++i) {
    ++hint.work;
    if (bounds[i].squared_distance(point_m) <= limit() && !look(slots[i], bounds[i])) return false;
    if (hint.is_exhausted()) return false;
  }
  return true;
}

std::uint32_t TileSurface::gather(const Vector3& point_m, std::size_t place) noexcept {
  Near& near = near_[place];
  if (near.radius_m > 0.0 && (point_m - near.center_m).norm() < kNearStep_m) return 0;
  near.count = 0;
  near.radius_m = 0.0;
  near.center_m = point_m;
  if (all_.is_empty() || !point_m.allFinite()) return 0;

  // a heap of the nearest, the farthest of them on top; of too many the radius is smaller
  struct Kept {
    double distance_m = 0.0;
    std::uint32_t slot = 0;
    [[nodiscard]] bool operator<(const Kept& other) const noexcept {
      return distance_m < other.distance_m;
    }
  };
  std::array<Kept, kMaxNear> heap;
  std::size_t count = 0;
  std::uint32_t kept = 0;
  SurfaceHint hint;
  double radius_m = nearest_at_most_m(point_m, hint) + kNearMargin_m;
  const bool is_complete = all_.look_near(
      point_m, hint, [&] { return radius_m * radius_m; },
      [&](std::uint32_t slot, const Bounds& tile) {
        const double distance_m = std::sqrt(tile.squared_distance(point_m));
        const auto begin = heap.begin();
        if (count == kMaxNear) {
          if (distance_m >= heap[0].distance_m) {
            radius_m = std::min(radius_m, distance_m);
            return true;
          }
          radius_m = std::min(radius_m, heap[0].distance_m);
          std::pop_heap(begin, begin + static_cast<std::ptrdiff_t>(count--));
        }
        heap[count++] = {distance_m, slot};
        std::push_heap(begin, begin + static_cast<std::ptrdiff_t>(count));
        hint.work += kKeepWork;
        return ++kept <= kMostKept;
      });
  if (!is_complete) return hint.work;
  std::sort_heap(heap.begin(), heap.begin() + static_cast<std::ptrdiff_t>(count));
  near.radius_m = radius_m;
  for (; near.count < count; ++near.count) {
    const Kept& one = heap[near.count];
    near.slots[near.count] = one.slot;
    near.bounds[near.count] = held_[one.slot].bounds;
    near.distances_m[near.count] = one.distance_m;
  }
  return hint.work;
}

double TileSurface::nearest_at_most_m(const Vector3& point_m, SurfaceHint& hint) const noexcept {
  double most_squared = std::numeric_limits<double>::max();
  all_.look_near(
      point_m, hint, [&] { return most_squared; },
      [&](std::uint32_t /*slot*/, const Bounds& tile) {
        most_squared = std::min(most_squared, tile.farthest_squared(point_m));
        return true;
      });
  return std::sqrt(most_squared);
}

const TileSurface::Near& TileSurface::near_to(const Vector3& point_m) const noexcept {
  const Near* nearest = &near_[0];
  for (const Near& near : near_) {
    if (!(near.radius_m > 0.0)) continue;
    const bool is_nearer =
        (point_m - near.center_m).squaredNorm() < (point_m - nearest->center_m).squaredNorm();
    if (!(nearest->radius_m > 0.0) || is_nearer) nearest = &near;
  }
  return *nearest;
}

bool TileSurface::has_all(const Near& near, const Vector3& point_m, double distance_m) noexcept {
  return (point_m - near.center_m).norm() + distance_m < near.radius_m;
}

double TileSurface::known_at_least_m(const Vector3& point_m, SurfaceHint& hint) const noexcept {
  hint.work += kViewWork;
  if (geometry_.is_cloud) return 0.0;
  const Near& near = near_to(point_m);
  const double to_others_m = near.radius_m - (point_m - near.center_m).norm();
  double least_squared = std::numeric_limits<double>::max();
  const auto look = [&](const auto& tiles) {
    return tiles.look_near(
        point_m, hint, [&] { return least_squared; },
        [&](std::uint32_t /*slot*/, const Bounds& tile) {
          least_squared = std::min(least_squared, tile.squared_distance(point_m));
          return true;
        });
  };
  if (!look(near)) return 0.0;
  if (const double near_m = std::sqrt(least_squared); near_m <= to_others_m) return near_m;
  return look(all_) ? std::sqrt(least_squared) : 0.0;
}

template <class Tiles, class Limit, class Examine>
bool TileSurface::visit(const Tiles& tiles, const Vector3& point_m, SurfaceHint& hint,
                        const Limit& limit, const Examine& examine) const noexcept {
  int examined = 0;
  const bool is_complete =
      tiles.look_near(point_m, hint, limit, [&](std::uint32_t slot, const Bounds& /*tile*/) {
        return !examine(held_[slot], slot) || ++examined <= kMostExamined;
      });
  if (!is_complete) hint.work = std::max(hint.work, hint.most_work + 1);
  return is_complete;
}

/// What is farther away need not be found.
double TileSurface::worth_m(const Vector3& point_m, const SurfaceHint& hint) const noexcept {
  constexpr double kFar_m = 1e100;
  if (!hint.only_covered) return kFar_m;
  return std::clamp((1.0 + kSameDistance) * unknown_m(point_m), 0.0, kFar_m);
}

SurfaceView TileSurface::view(const Vector3& point_m, SurfaceHint& hint) const noexcept {
  hint.work += kViewWork;
  return geometry_.is_cloud ? view_of_points(point_m, hint) : view_of_facets(point_m, hint);
}

SurfaceView TileSurface::view_of_facets(const Vector3& point_m, SurfaceHint& hint) const noexcept {
  Search search(point_m, worth_m(point_m, hint));
  const Near& near = near_to(point_m);
  const auto hinted = static_cast<std::uint32_t>(hint.cell / kMaxTileFacets);
  const std::size_t hinted_facet = hint.cell % kMaxTileFacets;
  if (near.has(hinted) && hinted_facet < held_[hinted].facet_count) {
    search.offer(held_[hinted], hinted, hinted_facet);
  }
  const auto limit = [&] { return search.limit(); };
  const auto offer = [&](const HeldTile& tile, std::uint32_t slot) {
    const bool is_worth_it = search.offer_all(tile, slot);
    hint.work += std::exchange(search.work, 0);
    return is_worth_it;
  };
  bool is_complete = visit(near, point_m, hint, limit, offer);
  if (is_complete && !has_all(near, point_m, search.best_m)) {
    // a tile that is not near may be nearer: once more, over all, within the distance found
    const double most_m =
        search.is_found ? search.best_m : std::min(search.best_m, nearest_at_most_m(point_m, hint));
    search = Search(point_m, (1.0 + kSameDistance) * most_m);
    is_complete = visit(all_, point_m, hint, limit, offer);
  }

  const bool is_seen = is_complete && search.is_found;
  if (!is_seen || !(search.best_m <= unknown_m(point_m))) ++hint.uncovered_views;
  if (!is_seen) {
    return {.distance_m = std::numeric_limits<double>::infinity()};
  }
  hint.cell = search.cell;
  SurfaceView view = view_of_facet(search.best, search.side, search.face, search.along, point_m);
  view.trust_radius_m = kMinTrustRadiusM;
  return view;
}

SurfaceView TileSurface::view_of_points(const Vector3& point_m, SurfaceHint& hint) const noexcept {
  const double worth_m = this->worth_m(point_m, hint);
  PointSearch search{.point_m = point_m, .best_squared = worth_m * worth_m};
  const Near& near = near_to(point_m);
  const auto limit = [&] { return search.limit(); };
  const auto offer = [&](const HeldTile& tile, std::uint32_t slot) {
    const bool is_worth_it = search.offer_all(tile, slot);
    hint.work += std::exchange(search.work, 0);
    return is_worth_it;
  };
  bool is_complete = visit(near, point_m, hint, limit, offer);
  if (is_complete && !has_all(near, point_m, std::sqrt(search.best_squared))) {
    const double most_m = (1.0 + kSameDistance) * nearest_at_most_m(point_m, hint);
    search.best_squared = std::min(search.best_squared, most_m * most_m);
    is_complete = visit(all_, point_m, hint, limit, offer);
  }
  if (!is_complete || search.best_tile == nullptr) {
    ++hint.uncovered_views;
    return {.distance_m = std::numeric_limits<double>::infinity()};
  }
  double farthest_m = std::sqrt(search.best_squared);
  const auto& [x, y, z] = search.best_tile->points[search.best].quadric.normal;
  SurfaceView view = view_of_cloud(
      point_m, search.best_tile->place_m(search.best), Vector3(x, y, z),
      [&](const Vector3& place_m, CloudBlender& blender) {
        farthest_m = std::max(farthest_m, (place_m - point_m).norm());
        const auto add = [&](const HeldTile& tile, std::uint32_t /*slot*/) {
          hint.work += kPointWork * tile.point_count;
          const HeldTile::OfPoints squared = tile.squared_distances(place_m);
          for (std::size_t i = 0; i < tile.point_count; ++i) {
            const HeldTile::Point& one = tile.points[i];
            if (!(squared[static_cast<Eigen::Index>(i)] < one.reach_m * one.reach_m)) continue;
            hint.work += kBlendWork;
            blender.add(tile.place_m(i), one.reach_m, one.quadric, one.stiffness_ratio);
          }
          return true;
        };
        if (!is_complete) return;
        const Near& there = near_to(place_m);
        const auto within = [] { return 0.0; };
        is_complete = has_all(there, place_m, 0.0) ? visit(there, place_m, hint, within, add)
                                                   : visit(all_, place_m, hint, within, add);
      });
  if (!is_complete || !(farthest_m <= unknown_m(point_m))) ++hint.uncovered_views;
  return view;
}

}  // namespace palpate
