// SPDX-License-Identifier: Apache-2.0
#include "common/task/searched_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <variant>

#include "common/contact/facet.h"

namespace palpate {
namespace {

constexpr double kPointsPerRadius = 24.0;
constexpr double kPointsAcross = 100.0;  // of a square as large as the area: its rim costs 0.1 %
constexpr double kLargest = 1.5;         // area of a piece, in squares of the spacing: 1 on average
constexpr double kLongest = 3.0;         // edge of a piece, in spacings
constexpr double kMostAcrossCell = 32.0;  // points
constexpr double kFinest_m = 1e-6;        // an area that only touches the surface has no points
constexpr double kSameSide = 0.5;         // cosine between the normals
constexpr double kAroundEdge = -0.5;      // likewise, to a side that the tip is outside of
constexpr double kFacing = -0.5;          // likewise, of what counts as one side
constexpr double kFarthestCell = 1e9;     // differences fit 32 bits
constexpr double kSamePlace_m = 1e-9;     // far below what vertices in 32 bits tell
constexpr double kJoint_m = 1e-6;         // triangles so near to each other are joined
constexpr double kSameFoot_m = 1e-4;      // a smaller motion has the same place on the surface
constexpr double kFarthestMove_m =
    0.02;  // of a tip between two ticks: what lies between is missing

/// From a place to the part of space; infinite of a MeshTag.
struct DistanceTo {
  const Vector3& place_m;
  double operator()(const HalfSpaceGeometry& h) const {
    return std::max(0.0, h.normal.dot(place_m - h.point_m));
  }
  double operator()(const SphereGeometry& s) const {
    return std::max(0.0, (place_m - s.center_m).norm() - s.radius_m);
  }
  double operator()(const BoxGeometry& b) const {
    return ((place_m - b.center_m).cwiseAbs() - 0.5 * b.size_m).cwiseMax(0.0).norm();
  }
  double operator()(const MeshTag& /*tag*/) const {
    return std::numeric_limits<double>::infinity();
  }
};

/// False: no place of the piece is in the area.
bool may_meet(const std::optional<RegionGeometry>& area, const Corners& piece) {
  if (!area) return true;
  const Vector3 middle = (piece[0] + piece[1] + piece[2]) / 3.0;
  double reach2 = 0.0;
  for (const Vector3& corner : piece) reach2 = std::max(reach2, (corner - middle).squaredNorm());
  return std::visit(DistanceTo{middle}, *area) <= std::sqrt(reach2);
}

/// Calls visit(piece) for the pieces of a triangle that may have a part of the area, each of at
/// most the square of the spacing.
template <class Visit>
void for_pieces(const Corners& triangle, double spacing_m,
                const std::optional<RegionGeometry>& area, const Visit& visit) {
  if (!may_meet(area, triangle)) return;
  const auto [edge, squared] = longest_edge(triangle);
  const double most_m = kLongest * spacing_m;
  if (area_of(triangle) <= kLargest * spacing_m * spacing_m && squared <= most_m * most_m) {
    visit(triangle);
    return;
  }
  for (const Corners& half : halves(triangle, edge)) for_pieces(half, spacing_m, area, visit);
}

/// Uniform in [0, 1), always the same for the same number [splitmix64].
double uniform(std::uint64_t number) {
  std::uint64_t z = (number + 1) * 0x9E3779B97F4A7C15U;
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9U;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBU;
  return static_cast<double>((z ^ (z >> 31U)) >> 11U) * 0x1p-53;
}

}  // namespace

SearchedSurface::SearchedSurface(const SurfaceMesh& mesh, const std::optional<RegionGeometry>& area,
                                 double radius_m)
    : radius_m_(radius_m), cell_m_(radius_m) {
  double whole_m2 = 0.0;
  for (std::size_t i = 0; i + 2 < mesh.triangles.size(); i += 3) {
    const Corners corners{mesh.vertex_m(mesh.triangles[i]), mesh.vertex_m(mesh.triangles[i + 1]),
                          mesh.vertex_m(mesh.triangles[i + 2])};
    const Vector3 normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    if (!(normal.norm() > 0.0)) continue;
    triangles_.push_back(corners);
    normals_.push_back(normal.normalized());
    whole_m2 += 0.5 * normal.norm();
  }
  grid_ = TriangleGrid(triangles_);
  spacing_m_ = spacing_of(area, whole_m2);
  cell_m_ = std::clamp(radius_m, 3.0 * spacing_m_, kMostAcrossCell * spacing_m_);
  for (std::size_t i = 0; i < triangles_.size(); ++i) {
    for_pieces(triangles_[i], spacing_m_, area,
               [&](const Corners& piece) { sample(static_cast<std::uint32_t>(i), piece, area); });
  }
  sort_into_cells();
}

/// The pieces that may have a part of the area are more than the area, the less the smaller they
/// are: divided until they are small enough for what they are.
double SearchedSurface::spacing_of(const std::optional<RegionGeometry>& area,
                                   double whole_m2) const {
  const double finest_m = radius_m_ / kPointsPerRadius;
  const auto least_m = [](double area_m2) {
    return std::sqrt(area_m2 / static_cast<double>(kMostPoints));
  };
  double spacing_m = std::max(finest_m, least_m(whole_m2));
  for (;;) {
    double near_m2 = area ? 0.0 : whole_m2;
    for (std::size_t i = 0; area && i < triangles_.size(); ++i) {
      for_pieces(triangles_[i], spacing_m, area,
                 [&](const Corners& piece) { near_m2 += area_of(piece); });
    }
    if (!(near_m2 > 0.0)) return spacing_m;
    const double wanted_m = std::max(
        {std::min(finest_m, std::sqrt(near_m2) / kPointsAcross), least_m(near_m2), kFinest_m});
    if (spacing_m <= wanted_m) return spacing_m;
    spacing_m = area ? std::max(wanted_m, 0.5 * spacing_m) : wanted_m;
  }
}

SearchedSurface SearchedSurface::of_no_area(const SurfaceMesh& mesh, double radius_m) {
  constexpr double kNowhere_m = 1e9;
  return {mesh, SphereGeometry{.center_m = Vector3::Constant(kNowhere_m), .radius_m = 0.0},
          radius_m};
}

void SearchedSurface::sample(std::uint32_t triangle, const Corners& piece,
                             const std::optional<RegionGeometry>& area) {
  const std::uint64_t number = 2 * drawn_++;
  double a = uniform(number);
  double b = uniform(number + 1);
  if (a + b > 1.0) {
    a = 1.0 - a;
    b = 1.0 - b;
  }
  const Vector3 place_m = piece[0] + a * (piece[1] - piece[0]) + b * (piece[2] - piece[0]);
  if (area && !contains(*area, place_m)) return;
  const double piece_m2 = area_of(piece);
  points_.push_back({.place_m = place_m.cast<float>(),
                     .triangle = triangle,
                     .area_m2 = static_cast<float>(piece_m2),
                     .is_searched = false});
  area_m2_ += piece_m2;
}

SearchedSurface::Cell SearchedSurface::cell_of(const Vector3& place_m) const {
  const auto index = [&](double x) {
    return static_cast<std::int32_t>(
        std::clamp(std::floor(x / cell_m_), -kFarthestCell, kFarthestCell));
  };
  return {index(place_m.x()), index(place_m.y()), index(place_m.z())};
}

void SearchedSurface::sort_into_cells() {
  const auto range_of = [&](const Point& point) -> auto& {
    return cells_[cell_of(point.place_m.cast<double>())];
  };
  for (const Point& point : points_) ++range_of(point).second;
  std::uint32_t first = 0;
  for (auto& [cell, range] : cells_) {
    const std::uint32_t count = range.second;
    range = {first, first};
    first += count;
    for (std::size_t i = 0; i < 3; ++i) {
      first_cell_[i] = std::min(first_cell_[i], cell[i]);
      last_cell_[i] = std::max(last_cell_[i], cell[i]);
    }
  }
  std::vector<Point> sorted(points_.size());
  for (const Point& point : points_) sorted[range_of(point).second++] = point;
  points_ = std::move(sorted);
}

template <class Visit>
void SearchedSurface::for_shell(const Cell& middle, std::int32_t distance,
                                const Visit& visit) const {
  Cell first;  // of the cube that has points
  Cell last;
  for (std::size_t i = 0; i < 3; ++i) {
    first[i] = std::max(-distance, first_cell_[i] - middle[i]);
    last[i] = std::min(distance, last_cell_[i] - middle[i]);
  }
  const auto go = [&](std::int32_t x, std::int32_t y, std::int32_t z) {
    const auto cell = cells_.find({middle[0] + x, middle[1] + y, middle[2] + z});
    if (cell == cells_.end()) return;
    for (std::uint32_t i = cell->second.first; i < cell->second.second; ++i) visit(i);
  };
  for (std::int32_t x = first[0]; x <= last[0]; ++x) {
    for (std::int32_t y = first[1]; y <= last[1]; ++y) {
      if (std::abs(x) == distance || std::abs(y) == distance) {
        for (std::int32_t z = first[2]; z <= last[2]; ++z) go(x, y, z);
      } else {
        if (first[2] == -distance) go(x, y, -distance);
        if (last[2] == distance) go(x, y, distance);
      }
    }
  }
}

std::optional<SearchedSurface::Foot> SearchedSurface::foot_of(const Vector3& place_m,
                                                              double within_m) const {
  std::optional<Foot> best;
  double least_m = within_m;
  double front_m = 0.0;
  grid_.for_nearest(place_m, within_m, [&](std::uint32_t i) {
    const Corners& triangle = triangles_[i];
    const FacetFoot foot = foot_on_facet(triangle[0], triangle[1], triangle[2], place_m);
    const double distance_m = std::sqrt(foot.squared_distance);
    // of triangles that meet at an edge it is on the side of the one that it is in front of
    const double in_front_m = normals_[i].dot(place_m - foot.point_m);
    const bool is_nearer = distance_m < least_m - kSamePlace_m;
    const bool is_as_near = distance_m <= least_m + kSamePlace_m;
    if (is_nearer || (is_as_near && (!best || in_front_m > front_m))) {
      best = Foot{.point_m = foot.point_m, .normal = normals_[i], .triangle = i};
      front_m = in_front_m;
    }
    least_m = std::min(least_m, distance_m);
    return least_m;
  });
  return best;
}

SearchedSurface::Foot SearchedSurface::followed(const Foot& last, const Vector3& place_m) const {
  const auto on = [&](std::uint32_t triangle, const Vector3& point_m) {
    const Corners& corners = triangles_[triangle];
    return foot_on_facet(corners[0], corners[1], corners[2], point_m);
  };
  Foot at = last;
  FacetFoot foot = on(at.triangle, place_m);
  for (;;) {
    at.point_m = foot.point_m;
    double least_m = std::sqrt(foot.squared_distance) - kSamePlace_m;
    std::optional<std::uint32_t> next;
    grid_.for_near(at.point_m, kJoint_m, [&](std::uint32_t i) {
      const FacetFoot other = on(i, place_m);
      const double distance_m = std::sqrt(other.squared_distance);
      if (!(distance_m < least_m)) return;
      const bool is_outside = normals_[i].dot(place_m - other.point_m) >= 0.0;
      if (at.normal.dot(normals_[i]) < (is_outside ? kAroundEdge : kSameSide)) return;
      if (on(i, at.point_m).squared_distance > kJoint_m * kJoint_m) return;
      least_m = distance_m;
      next = i;
    });
    if (!next) return at;
    foot = on(*next, place_m);
    at.triangle = *next;
    at.normal = normals_[*next];
  }
}

TaskMap SearchedSurface::map(std::size_t most) const {
  const std::size_t step = std::max<std::size_t>(1, (points_.size() + most - 1) / most);
  TaskMap map;
  for (std::size_t i = 0; i < points_.size(); i += step) {
    const Point& point = points_[i];
    map.places_m.push_back({point.place_m.x(), point.place_m.y(), point.place_m.z()});
    map.is_searched.push_back(point.is_searched ? 1 : 0);
  }
  return map;
}

bool SearchedSurface::is_same_side(const Vector3& normal, const Vector3& other) {
  return normal.dot(other) >= kFacing;
}

void SearchedSurface::search(const Vector3& place_m, const Vector3& normal) {
  const Cell middle = cell_of(place_m);
  const auto last = static_cast<std::int32_t>(std::ceil(radius_m_ / cell_m_));
  for (std::int32_t shell = 0; shell <= last; ++shell) {
    for_shell(middle, shell, [&](std::uint32_t i) {
      Point& point = points_[i];
      if (point.is_searched) return;
      const Vector3 at_m = point.place_m.cast<double>();
      if ((at_m - place_m).squaredNorm() > radius_m_ * radius_m_) return;
      if (!is_same_side(normals_[point.triangle], normal)) return;
      point.is_searched = true;
      searched_m2_ += static_cast<double>(point.area_m2);
    });
  }
}

void TipFoot::follow(const SearchedSurface& surface, const Vector3& tip_m, bool is_touch) {
  const double moved_m = (tip_m - tip_m_).norm();  // NaN: it was not followed
  if (moved_m < kSameFoot_m && (foot_ || !is_touch)) {
    was_pressed_ = was_pressed_ || is_touch;
    return;
  }
  const bool is_inside =
      foot_ && moved_m < kFarthestMove_m && foot_->normal.dot(tip_m - foot_->point_m) < 0.0;
  if (is_inside && (is_touch || !has_left(surface, tip_m))) {
    foot_ = surface.followed(*foot_, tip_m);
  } else {
    // a free one matters only so near that it can be inside at the next tick
    foot_ = surface.foot_of(tip_m, is_touch ? SearchedSurface::kFar_m : kFarthestMove_m);
    was_pressed_ = false;
  }
  was_pressed_ = was_pressed_ || is_touch;
  tip_m_ = tip_m;
}

/// Of one on which no force acts. Until it was pressed no tissue has given way: then all that
/// matters is whether its centre is outside.
bool TipFoot::has_left(const SearchedSurface& surface, const Vector3& tip_m) const {
  const auto nearest = surface.foot_of(tip_m, SearchedSurface::kFar_m);
  if (!nearest) return true;
  const Vector3 from_m = tip_m - nearest->point_m;
  return nearest->normal.dot(from_m) >= 0.0 && (!was_pressed_ || from_m.norm() > tip_radius_m_);
}

}  // namespace palpate
