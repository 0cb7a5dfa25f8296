// SPDX-License-Identifier: Apache-2.0
#include "common/task/searched_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <variant>

namespace palpate {
namespace {

using Corners = std::array<Vector3, 3>;

constexpr double kPointsPerRadius = 24.0;
constexpr double kPointsAcross = 100.0;  // of a square as large as the area: its rim costs 0.1 %
constexpr double kPiecesAcross = 16.0;
constexpr double kMostAcrossCell = 32.0;  // points
constexpr double kPointsOutside = 6.0;    // of the area: only to know where a tip is
constexpr std::size_t kMostOutside = 100'000;
// Of points at random, one in each piece, one within 3 spacings is nearer to any place beyond 2.
constexpr double kNeighbourSpacings = 3.0;
constexpr double kSameSide = 0.5;      // cosine between the normals
constexpr double kAroundEdge = -0.5;   // likewise, to a side that the tip is outside of
constexpr double kFarthestCell = 1e9;  // differences fit 32 bits

double area_of(const Corners& triangle) {
  return 0.5 * (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).norm();
}

/// Calls visit(piece) for equal parts of a triangle, each of at most the square of the spacing.
template <class Visit>
void for_pieces(const Corners& corners, double spacing_m, const Visit& visit) {
  const auto parts = static_cast<int>(std::ceil(std::sqrt(area_of(corners)) / spacing_m));
  const auto at = [&](int i, int j) -> Vector3 {
    return corners[0] + (i * (corners[1] - corners[0]) + j * (corners[2] - corners[0])) / parts;
  };
  for (int i = 0; i < parts; ++i) {
    for (int j = 0; i + j < parts; ++j) {
      visit(Corners{at(i, j), at(i + 1, j), at(i, j + 1)});
      if (i + j + 1 < parts) visit(Corners{at(i + 1, j + 1), at(i, j + 1), at(i + 1, j)});
    }
  }
}

/// Of a small piece: whether some of it is to be searched.
bool is_near(const std::optional<RegionGeometry>& area, const Corners& piece) {
  if (!area) return true;
  const Vector3 middle = (piece[0] + piece[1] + piece[2]) / 3.0;
  return contains(*area, middle) || contains(*area, piece[0]) || contains(*area, piece[1]) ||
         contains(*area, piece[2]);
}

double near_area(const std::vector<Corners>& triangles, double spacing_m,
                 const std::optional<RegionGeometry>& area) {
  double near_m2 = 0.0;
  for (const Corners& triangle : triangles) {
    for_pieces(triangle, spacing_m, [&](const Corners& piece) {
      if (is_near(area, piece)) near_m2 += area_of(piece);
    });
  }
  return near_m2;
}

constexpr double kNowhere_m = 1e9;

bool is_nowhere(const RegionGeometry& area) {
  const auto* sphere = std::get_if<SphereGeometry>(&area);
  return sphere != nullptr && sphere->center_m.x() == kNowhere_m;
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
  std::vector<Corners> triangles;
  double whole_m2 = 0.0;
  for (std::size_t i = 0; i + 2 < mesh.triangles.size(); i += 3) {
    const Corners corners{mesh.vertex_m(mesh.triangles[i]), mesh.vertex_m(mesh.triangles[i + 1]),
                          mesh.vertex_m(mesh.triangles[i + 2])};
    const Vector3 normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    if (!(normal.norm() > 0.0)) continue;
    triangles.push_back(corners);
    normals_.push_back(normal.normalized());
    whole_m2 += 0.5 * normal.norm();
  }
  coarse_m_ = coarse_spacing(triangles, whole_m2, area);
  const double near_m2 = near_area(triangles, coarse_m_, area);
  spacing_m_ = std::min(radius_m / kPointsPerRadius,
                        near_m2 > 0.0 ? std::sqrt(near_m2) / kPointsAcross : coarse_m_);
  spacing_m_ = std::max(spacing_m_, std::sqrt(near_m2 / static_cast<double>(kMostPoints)));
  slide_m_ = kNeighbourSpacings * (area ? coarse_m_ : spacing_m_);
  cell_m_ = std::clamp(radius_m, 3.0 * spacing_m_, kMostAcrossCell * spacing_m_);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    for_pieces(triangles[i], coarse_m_, [&](const Corners& piece) {
      const double spacing_m = is_near(area, piece) ? spacing_m_ : coarse_m_;
      for_pieces(piece, spacing_m,
                 [&](const Corners& one) { sample(static_cast<std::uint32_t>(i), one, area); });
    });
  }
  sort_into_cells();
}

/// Of the points outside the area, and of the pieces that are told to be in it or not.
double SearchedSurface::coarse_spacing(const std::vector<Corners>& triangles, double whole_m2,
                                       const std::optional<RegionGeometry>& area) const {
  const double least_m = std::sqrt(whole_m2 / static_cast<double>(kMostOutside));
  const double most_m = std::max(radius_m_ / kPointsOutside, least_m);
  if (!area || is_nowhere(*area)) return most_m;
  // a small area may lie between the corners of large pieces
  for (double coarse_m = most_m; coarse_m > least_m; coarse_m *= 0.5) {
    const double near_m2 = near_area(triangles, coarse_m, area);
    if (coarse_m <= std::sqrt(near_m2) / kPiecesAcross) return coarse_m;
  }
  return near_area(triangles, least_m, area) > 0.0 ? least_m : most_m;
}

SearchedSurface SearchedSurface::of_no_area(const SurfaceMesh& mesh, double radius_m) {
  return {mesh, SphereGeometry{.center_m = Vector3::Constant(kNowhere_m), .radius_m = 0.0},
          radius_m};
}

void SearchedSurface::sample(std::uint32_t triangle, const Corners& piece,
                             const std::optional<RegionGeometry>& area) {
  const std::uint64_t number = 2 * points_.size();
  double a = uniform(number);
  double b = uniform(number + 1);
  if (a + b > 1.0) {
    a = 1.0 - a;
    b = 1.0 - b;
  }
  const Vector3 place_m = piece[0] + a * (piece[1] - piece[0]) + b * (piece[2] - piece[0]);
  const double piece_m2 = !area || contains(*area, place_m) ? area_of(piece) : 0.0;
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
  const Cell middle = cell_of(place_m);
  double least2 = within_m * within_m;
  const Point* nearest = nullptr;
  for (std::int32_t shell = 0; (shell - 1) * cell_m_ <= std::sqrt(least2); ++shell) {
    for_shell(middle, shell, [&](std::uint32_t i) {
      const Point& point = points_[i];
      const double distance2 = (point.place_m.cast<double>() - place_m).squaredNorm();
      if (distance2 > least2) return;
      least2 = distance2;
      nearest = &point;
    });
  }
  if (nearest == nullptr) return std::nullopt;
  return foot_at(static_cast<std::uint32_t>(nearest - points_.data()), place_m);
}

SearchedSurface::Foot SearchedSurface::foot_at(std::uint32_t nearest,
                                               const Vector3& place_m) const {
  const Point& point = points_[nearest];
  const Vector3 point_m = point.place_m.cast<double>();
  const Vector3& normal = normals_[point.triangle];
  const Vector3 foot_m = place_m - normal.dot(place_m - point_m) * normal;
  // beside an edge the plane of the nearest point goes on where the surface does not
  const double spacing_m = point.area_m2 > 0.0F ? spacing_m_ : coarse_m_;
  const bool is_beside = (foot_m - point_m).norm() > 2.0 * spacing_m;
  return Foot{.point_m = is_beside ? point_m : foot_m, .normal = normal, .nearest = nearest};
}

SearchedSurface::Foot SearchedSurface::followed(const Foot& last, const Vector3& place_m) const {
  std::uint32_t at = last.nearest;
  for (;;) {
    const std::uint32_t next = nearer_neighbour(at, place_m);
    if (next == at) return foot_at(at, place_m);
    at = next;
  }
}

/// Of the points near one that the foot may slide to that which is nearest to the place.
std::uint32_t SearchedSurface::nearer_neighbour(std::uint32_t at, const Vector3& place_m) const {
  const Vector3 from_m = points_[at].place_m.cast<double>();
  const Vector3& normal = normals_[points_[at].triangle];
  double least2 = (from_m - place_m).squaredNorm();
  const Cell first = cell_of(from_m - Vector3::Constant(slide_m_));
  const Cell last = cell_of(from_m + Vector3::Constant(slide_m_));
  const auto visit = [&](std::uint32_t i) {
    const Vector3 point_m = points_[i].place_m.cast<double>();
    const double distance2 = (point_m - place_m).squaredNorm();
    if (!(distance2 < least2) || (point_m - from_m).squaredNorm() > slide_m_ * slide_m_) return;
    const Vector3& other = normals_[points_[i].triangle];
    const double agreement = normal.dot(other);
    const bool is_outside = other.dot(place_m - point_m) >= 0.0;
    if (agreement < (is_outside ? kAroundEdge : kSameSide)) return;
    least2 = distance2;
    at = i;
  };
  for (std::int32_t x = first[0]; x <= last[0]; ++x) {
    for (std::int32_t y = first[1]; y <= last[1]; ++y) {
      for (std::int32_t z = first[2]; z <= last[2]; ++z) {
        const auto cell = cells_.find({x, y, z});
        if (cell == cells_.end()) continue;
        for (std::uint32_t i = cell->second.first; i < cell->second.second; ++i) visit(i);
      }
    }
  }
  return at;
}

TaskMap SearchedSurface::map(std::size_t most) const {
  const auto in_area = [](const Point& point) { return point.area_m2 > 0.0F; };
  const auto count =
      static_cast<std::size_t>(std::count_if(points_.begin(), points_.end(), in_area));
  const std::size_t step = std::max<std::size_t>(1, (count + most - 1) / most);
  TaskMap map;
  std::size_t number = 0;
  for (const Point& point : points_) {
    if (!in_area(point) || number++ % step != 0) continue;
    map.places_m.push_back({point.place_m.x(), point.place_m.y(), point.place_m.z()});
    map.is_searched.push_back(point.is_searched ? 1 : 0);
  }
  return map;
}

void SearchedSurface::search(const Vector3& place_m) {
  const Cell middle = cell_of(place_m);
  const auto last = static_cast<std::int32_t>(std::ceil(radius_m_ / cell_m_));
  for (std::int32_t shell = 0; shell <= last; ++shell) {
    for_shell(middle, shell, [&](std::uint32_t i) {
      Point& point = points_[i];
      if (point.is_searched || point.area_m2 == 0.0F) return;
      const Vector3 at_m = point.place_m.cast<double>();
      if ((at_m - place_m).squaredNorm() > radius_m_ * radius_m_) return;
      point.is_searched = true;
      searched_m2_ += static_cast<double>(point.area_m2);
    });
  }
}

}  // namespace palpate
