// SPDX-License-Identifier: Apache-2.0
#include "common/task/searched_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate {
namespace {

constexpr double kPointsPerRadius = 24.0;

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
  std::vector<std::array<Vector3, 3>> triangles;
  double whole_m2 = 0.0;
  for (std::size_t i = 0; i + 2 < mesh.triangles.size(); i += 3) {
    const std::array<Vector3, 3> corners{mesh.vertex_m(mesh.triangles[i]),
                                         mesh.vertex_m(mesh.triangles[i + 1]),
                                         mesh.vertex_m(mesh.triangles[i + 2])};
    const Vector3 normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    if (!(normal.norm() > 0.0)) continue;
    triangles.push_back(corners);
    normals_.push_back(normal.normalized());
    whole_m2 += 0.5 * normal.norm();
  }
  spacing_m_ =
      std::max(radius_m / kPointsPerRadius, std::sqrt(whole_m2 / static_cast<double>(kMostPoints)));
  cell_m_ = std::max(radius_m, 3.0 * spacing_m_);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    sample(static_cast<std::uint32_t>(i), triangles[i], area);
  }
  sort_into_cells();
}

void SearchedSurface::sample(std::uint32_t triangle, const std::array<Vector3, 3>& corners,
                             const std::optional<RegionGeometry>& area) {
  const Vector3 along = corners[1] - corners[0];
  const Vector3 across = corners[2] - corners[0];
  const double whole_m2 = 0.5 * along.cross(across).norm();
  const auto parts = static_cast<int>(std::ceil(std::sqrt(whole_m2) / spacing_m_));
  const double piece_m2 = whole_m2 / (static_cast<double>(parts) * parts);
  const auto add = [&](double u, double v, double side) {
    const std::uint64_t number = 2 * points_.size();
    double a = uniform(number);
    double b = uniform(number + 1);
    if (a + b > 1.0) {
      a = 1.0 - a;
      b = 1.0 - b;
    }
    const Vector3 place_m = corners[0] + ((u + side * a) * along + (v + side * b) * across) /
                                             static_cast<double>(parts);
    const bool is_searched_for = !area || contains(*area, place_m);
    points_.push_back({.place_m = {static_cast<float>(place_m.x()), static_cast<float>(place_m.y()),
                                   static_cast<float>(place_m.z())},
                       .triangle = triangle,
                       .area_m2 = is_searched_for ? static_cast<float>(piece_m2) : 0.0F,
                       .is_searched = false});
    if (is_searched_for) area_m2_ += piece_m2;
  };
  for (int i = 0; i < parts; ++i) {
    for (int j = 0; i + j < parts; ++j) {
      add(i, j, 1.0);
      if (i + j + 1 < parts) add(i + 1, j + 1, -1.0);
    }
  }
}

SearchedSurface::Cell SearchedSurface::cell_of(const Vector3& place_m) const {
  const auto index = [&](double x) { return static_cast<std::int32_t>(std::floor(x / cell_m_)); };
  return {index(place_m.x()), index(place_m.y()), index(place_m.z())};
}

void SearchedSurface::sort_into_cells() {
  const auto cell = [&](const Point& point) {
    return cell_of({point.place_m[0], point.place_m[1], point.place_m[2]});
  };
  std::sort(points_.begin(), points_.end(),
            [&](const Point& a, const Point& b) { return cell(a) < cell(b); });
  for (std::uint32_t i = 0; i < points_.size(); ++i) {
    const auto [it, is_new] = cells_.try_emplace(cell(points_[i]), i, i);
    it->second.second = i + 1;
  }
}

template <class Visit>
void SearchedSurface::for_shell(const Cell& middle, std::int32_t distance,
                                const Visit& visit) const {
  for (std::int32_t x = -distance; x <= distance; ++x) {
    for (std::int32_t y = -distance; y <= distance; ++y) {
      const bool is_edge = std::abs(x) == distance || std::abs(y) == distance;
      const std::int32_t step = is_edge ? 1 : std::max(2 * distance, 1);
      for (std::int32_t z = -distance; z <= distance; z += step) {
        const auto cell = cells_.find({middle[0] + x, middle[1] + y, middle[2] + z});
        if (cell == cells_.end()) continue;
        for (std::uint32_t i = cell->second.first; i < cell->second.second; ++i) visit(i);
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
      const double distance2 =
          (Vector3(point.place_m[0], point.place_m[1], point.place_m[2]) - place_m).squaredNorm();
      if (distance2 > least2) return;
      least2 = distance2;
      nearest = &point;
    });
  }
  if (nearest == nullptr) return std::nullopt;
  const Vector3 point_m(nearest->place_m[0], nearest->place_m[1], nearest->place_m[2]);
  const Vector3& normal = normals_[nearest->triangle];
  const Vector3 foot_m = place_m - normal.dot(place_m - point_m) * normal;
  // beside an edge the plane of the nearest point goes on where the surface does not
  const bool is_beside = (foot_m - point_m).norm() > 2.0 * spacing_m_;
  return Foot{is_beside ? point_m : foot_m, normal};
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
    map.places_m.push_back(point.place_m);
    map.is_searched.push_back(point.is_searched ? 1 : 0);
  }
  return map;
}

void SearchedSurface::search(const Vector3& place_m) {
  const Cell middle = cell_of(place_m);
  for (std::int32_t shell = 0; shell <= 1; ++shell) {
    for_shell(middle, shell, [&](std::uint32_t i) {
      Point& point = points_[i];
      if (point.is_searched || point.area_m2 == 0.0F) return;
      const Vector3 at_m(point.place_m[0], point.place_m[1], point.place_m[2]);
      if ((at_m - place_m).squaredNorm() > radius_m_ * radius_m_) return;
      point.is_searched = true;
      searched_m2_ += static_cast<double>(point.area_m2);
    });
  }
}

}  // namespace palpate
