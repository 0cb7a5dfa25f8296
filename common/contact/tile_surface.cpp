#include "common/contact/tile_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/contact/facet.h"

namespace palpate {
namespace {

// Feet on an edge or corner that two facets share differ by rounding; relative, of the square.
constexpr double kSameDistance = 1e-9;
// Tiles this much further away than the nearest facet are near, and the tool may move this far
// before they are collected anew [m].
constexpr double kNearMargin_m = 8e-3;
constexpr double kNearStep_m = 3e-3;

}  // namespace

void HeldTile::take(const SurfaceTile& tile) noexcept {
  version = tile.version;
  described_slot = tile.described_slot;
  is_held = true;
  for (std::size_t i = 0; i < tile.vertex_count; ++i) {
    const auto& [x, y, z] = tile.vertices[i];
    vertices_m[i] = tile.origin_m + tile.step_m * Vector3(x, y, z);
    keys[i] = (std::uint64_t{x} << 32U) | (std::uint64_t{y} << 16U) | z;
  }
  facets = tile.facets;
  facet_count = tile.facet_count;
  for (std::size_t i = 0; i < facet_count; ++i) {
    const Vector3& a = vertices_m[facets[i][0]];
    const Vector3& b = vertices_m[facets[i][1]];
    const Vector3& c = vertices_m[facets[i][2]];
    normals[i] = (b - a).cross(c - a).normalized();
    centers_m[i] = (a + b + c) / 3.0;
    radii_m[i] =
        std::sqrt(std::max({(a - centers_m[i]).squaredNorm(), (b - centers_m[i]).squaredNorm(),
                            (c - centers_m[i]).squaredNorm()}));
    const Bounds facet = bounds_of(std::array<Vector3, 3>{a, b, c});
    if (i == 0) bounds = facet;
    bounds.include(facet);
  }
}

void TileSurface::reset(bool is_sheet) noexcept {
  slots_.clear();
  is_sheet_ = is_sheet;
  covered_radius_m_ = 0.0;
  gap_count_ = 0;
  near_count_ = 0;
  near_radius_m_ = 0.0;
}

void TileSurface::add(std::uint32_t slot) noexcept {
  near_radius_m_ = 0.0;
  if (std::find(slots_.begin(), slots_.end(), slot) == slots_.end()) slots_.push_back(slot);
}

void TileSurface::remove(std::uint32_t slot) noexcept {
  near_radius_m_ = 0.0;
  std::erase(slots_, slot);
}

void TileSurface::except(const Vector3& center_m, double radius_m) noexcept {
  if (gap_count_ < gaps_.size()) {
    gaps_[gap_count_++] = {center_m, radius_m};
  } else {
    covered_radius_m_ = 0.0;
  }
}

double TileSurface::unknown_m(const Vector3& point_m) const noexcept {
  double least_m = covered_radius_m_ - (point_m - covered_center_m_).norm();
  for (std::size_t i = 0; i < gap_count_; ++i) {
    least_m = std::min(least_m, (point_m - gaps_[i].center_m).norm() - gaps_[i].radius_m);
  }
  return least_m;
}

/// The nearest foot so far, and the sum of the normals of the facets that meet there.
struct TileSurface::Search {
  Vector3 point_m;
  FacetFoot best;
  double best_m = std::numeric_limits<double>::max();
  std::uint32_t cell = 0;
  Vector3 face = Vector3::Zero();
  Vector3 side = Vector3::Zero();
  Vector3 along = Vector3::Zero();
  std::array<std::uint64_t, 2> feature{};  // vertices of the edge or corner at the foot

  explicit Search(const Vector3& point) : point_m(point) {
    best.squared_distance = std::numeric_limits<double>::max();
  }

  void offer(const HeldTile& tile, std::uint32_t slot, std::size_t index) noexcept {
    const auto& corners = tile.facets[index];
    const auto vertex = [&](std::size_t i) -> const Vector3& {
      return tile.vertices_m[corners[i % 3]];
    };
    const FacetFoot foot = foot_on_facet(vertex(0), vertex(1), vertex(2), point_m);
    if (!(foot.squared_distance <= best.squared_distance * (1.0 + kSameDistance))) return;

    std::array<std::uint64_t, 2> at{};
    Vector3 normal = tile.normals[index];
    if (foot.corner >= 0) {
      const auto i = static_cast<std::size_t>(static_cast<unsigned char>(foot.corner));
      at = {tile.keys[corners[i]], tile.keys[corners[i]]};
      const Vector3 to_next = (vertex(i + 1) - vertex(i)).normalized();
      const Vector3 to_last = (vertex(i + 2) - vertex(i)).normalized();
      normal *= std::acos(std::clamp(to_next.dot(to_last), -1.0, 1.0));
    } else if (foot.edge >= 0) {
      const auto i = static_cast<std::size_t>(static_cast<unsigned char>(foot.edge));
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
    best_m = std::sqrt(foot.squared_distance);
    cell = this_cell;
    face = tile.normals[index];
    side = normal;
    feature = at;
    if (foot.edge >= 0) {
      const auto i = static_cast<std::size_t>(static_cast<unsigned char>(foot.edge));
      along = (vertex(i + 1) - vertex(i)).normalized();
    }
  }

  void offer_all(const HeldTile& tile, std::uint32_t slot) noexcept {
    const double limit = best.squared_distance * (1.0 + kSameDistance);
    if (!(tile.bounds.squared_distance(point_m) <= limit)) return;
    for (std::size_t i = 0; i < tile.facet_count; ++i) {
      const double reach_m = best_m * (1.0 + kSameDistance) + tile.radii_m[i];
      if ((point_m - tile.centers_m[i]).squaredNorm() > reach_m * reach_m) continue;
      offer(tile, slot, i);
    }
  }
};

void TileSurface::gather(const Vector3& point_m) noexcept {
  if (near_radius_m_ > 0.0 && (point_m - near_center_m_).norm() < kNearStep_m) return;
  near_count_ = 0;
  near_radius_m_ = 0.0;
  near_center_m_ = point_m;
  if (slots_.empty() || !point_m.allFinite()) return;
  Search search(point_m);
  for (const std::uint32_t slot : slots_) search.offer_all(held_[slot], slot);
  const double radius_m = search.best_m + kNearMargin_m;
  for (const std::uint32_t slot : slots_) {
    if (!(held_[slot].bounds.squared_distance(point_m) <= radius_m * radius_m)) continue;
    if (near_count_ == kMaxNear) return;  // too many: views search all
    near_[near_count_++] = slot;
  }
  near_radius_m_ = radius_m;
}

SurfaceView TileSurface::view(const Vector3& point_m, SurfaceHint& hint) const noexcept {
  Search search(point_m);
  const auto hinted = static_cast<std::uint32_t>(hint.cell / kMaxTileFacets);
  const std::size_t hinted_facet = hint.cell % kMaxTileFacets;
  if (hinted < held_.size() && held_[hinted].is_held &&
      std::find(near_.begin(), near_.begin() + near_count_, hinted) !=
          near_.begin() + near_count_ &&
      hinted_facet < held_[hinted].facet_count) {
    search.offer(held_[hinted], hinted, hinted_facet);
  }
  for (std::size_t i = 0; i < near_count_; ++i) search.offer_all(held_[near_[i]], near_[i]);
  const double from_near_m = (point_m - near_center_m_).norm();
  if (!(from_near_m + search.best_m <= near_radius_m_)) {
    // an unknown tile may be nearer: once more, over all, within the distance found
    Search all(point_m);
    all.best.squared_distance = search.best.squared_distance;
    if (search.best_m < std::numeric_limits<double>::max()) {
      all.best.squared_distance *= 1.0 + 2.0 * kSameDistance;
      all.best_m = std::sqrt(all.best.squared_distance);
    }
    search = all;
    for (const std::uint32_t slot : slots_) search.offer_all(held_[slot], slot);
  }

  if (!(search.best_m <= unknown_m(point_m))) ++hint.uncovered_views;
  if (!(search.best.squared_distance < std::numeric_limits<double>::max())) {
    SurfaceView view;
    view.distance_m = std::numeric_limits<double>::infinity();
    return view;
  }
  hint.cell = search.cell;
  SurfaceView view = view_of_facet(search.best, search.side, search.face, search.along, point_m);
  view.trust_radius_m = kMinTrustRadiusM;
  return view;
}

}  // namespace palpate
