// SPDX-License-Identifier: Apache-2.0
#include "physics_node/display/file_surface_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include "physics_node/surfaces/cloud_surface.h"
#include "physics_node/surfaces/triangle_surface.h"

namespace palpate::physics {
namespace {

/// Approximate limit per surface: 30 frames per second of all its vertices are a few MB/s.
constexpr std::size_t kMostCells = 10'000;
/// Meshes of up to this many vertices are drawn unchanged.
constexpr std::size_t kMostVertices = 50'000;
constexpr double kCoarser = 1.2;

/// A cell, or its lowest corner, of a grid at most a few hundred cells wide.
using Cell = Eigen::Vector3i;
using Key = std::uint64_t;
Key key_of(const Cell& cell) {
  constexpr int kBits = 21;
  constexpr int kMiddle = 1 << (kBits - 1);
  Key key = 0;
  for (const int i : cell) key = key << kBits | static_cast<Key>(i + kMiddle);
  return key;
}

void append_vertex(const Vector3& p, SurfaceMesh& mesh) {
  for (const double x : p) mesh.vertices_m.push_back(static_cast<float>(x));
}

class Grid {
 public:
  Grid(const Bounds& bounds, double spacing_m) : lowest_m_(bounds.lowest_m), h_(spacing_m) {}
  [[nodiscard]] double spacing_m() const { return h_; }
  [[nodiscard]] Cell cell_of(const Vector3& p) const {
    return ((p - lowest_m_) / h_).array().floor().matrix().cast<int>();
  }
  [[nodiscard]] Vector3 corner_m(const Cell& cell) const {
    return lowest_m_ + h_ * cell.cast<double>();
  }

 private:
  Vector3 lowest_m_;
  double h_;
};

/// The occupied cells of the finest grid, not finer than `finest_m`, in which `points` occupy at
/// most `most` cells.
template <class Points, class Place>
std::pair<Grid, std::vector<Cell>> cells_with(const Points& points, const Place& place_m,
                                              const Bounds& bounds, double finest_m,
                                              std::size_t most) {
  for (double h = finest_m;; h *= kCoarser) {
    const Grid grid(bounds, h);
    std::unordered_map<Key, Cell> cells;
    for (const auto& point : points) {
      const Cell cell = grid.cell_of(place_m(point));
      cells.emplace(key_of(cell), cell);
      if (cells.size() > most) break;
    }
    if (cells.size() > most) continue;
    std::vector<Cell> sorted;
    sorted.reserve(cells.size());
    for (const auto& [key, cell] : cells) sorted.push_back(cell);
    std::sort(sorted.begin(), sorted.end(),
              [](const Cell& a, const Cell& b) { return key_of(a) < key_of(b); });
    return {grid, std::move(sorted)};
  }
}

/// A surface net: one vertex in each cell that the surface passes through, one face across each
/// edge of the grid that it crosses.
class SurfaceNet {
 public:
  SurfaceNet(const CloudSurface& surface, const Grid& grid) : surface_(surface), grid_(grid) {}

  SurfaceMesh over(const std::vector<Cell>& cells) {
    SurfaceMesh mesh;
    std::vector<Cell> crossed;
    for (const Cell& cell : cells) {
      const std::optional<Vector3> vertex_m = vertex_in(cell);
      if (!vertex_m) continue;
      vertices_.emplace(key_of(cell), static_cast<std::uint32_t>(crossed.size()));
      crossed.push_back(cell);
      append_vertex(*vertex_m, mesh);
    }
    for (const Cell& cell : crossed) {
      for (int axis = 0; axis < 3; ++axis) add_face(cell, axis, mesh);
    }
    return mesh;
  }

 private:
  double distance_m(const Cell& corner) {
    const auto [it, is_new] = distances_.emplace(key_of(corner), 0.0);
    if (is_new) it->second = surface_.view(grid_.corner_m(corner)).distance_m;
    return it->second;
  }

  /// Where the surface passes between two corners. Where the distance jumps by more than the length
  /// of the edge there is no surface but the border of one.
  std::optional<double> crossing(const Cell& from, const Cell& to) {
    const double a = distance_m(from);
    const double b = distance_m(to);
    if ((a < 0.0) == (b < 0.0) || !(std::abs(a - b) < 1.5 * grid_.spacing_m())) return std::nullopt;
    return a / (a - b);
  }

  std::optional<Vector3> vertex_in(const Cell& cell) {
    Vector3 sum = Vector3::Zero();
    int count = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const Cell along = Cell::Unit(axis);
      const Cell across = Cell::Unit((axis + 1) % 3);
      const Cell up = Cell::Unit((axis + 2) % 3);
      for (const Cell& from :
           {cell, Cell(cell + across), Cell(cell + up), Cell(cell + across + up)}) {
        if (const auto share = crossing(from, from + along)) {
          sum += grid_.corner_m(from) + *share * grid_.spacing_m() * along.cast<double>();
          ++count;
        }
      }
    }
    if (count == 0) return std::nullopt;

    // from the mean of the crossings onto the surface
    Vector3 place_m = sum / count;
    for (int i = 0; i < 2; ++i) {
      const SurfaceView seen = surface_.view(place_m);
      if (!(std::abs(seen.distance_m) < grid_.spacing_m())) return std::nullopt;
      place_m -= seen.distance_m * seen.normal;
    }
    return place_m;
  }

  void add_face(const Cell& corner, int axis, SurfaceMesh& mesh) {
    const Cell along = Cell::Unit(axis);
    const Cell across = Cell::Unit((axis + 1) % 3);
    const Cell up = Cell::Unit((axis + 2) % 3);
    if (!crossing(corner, corner + along)) return;
    // the four cells around the edge, counter-clockwise seen from its far end
    std::array<std::uint32_t, 4> corners{};
    std::size_t i = 0;
    for (const Cell& cell :
         {corner, Cell(corner - across), Cell(corner - across - up), Cell(corner - up)}) {
      const auto it = vertices_.find(key_of(cell));
      if (it == vertices_.end()) return;
      corners[i++] = it->second;
    }
    if (distance_m(corner) >= 0.0) std::swap(corners[1], corners[3]);
    mesh.triangles.insert(mesh.triangles.end(),
                          {corners[0], corners[1], corners[2], corners[0], corners[2], corners[3]});
  }

  const CloudSurface& surface_;
  const Grid& grid_;
  std::unordered_map<Key, double> distances_;        // of corners
  std::unordered_map<Key, std::uint32_t> vertices_;  // of cells
};

SurfaceMesh mesh_of(const CloudSurface& surface) {
  const std::span<const Octree::Point> points = surface.tree().points();
  const Bounds bounds = surface.bounds();
  double reach_m = 0.0;
  for (const Octree::Point& point : points) reach_m += static_cast<double>(point.reach);
  reach_m /= static_cast<double>(points.size());
  const double finest_m = std::max(0.5 * reach_m, bounds.longest_side_m() / 200.0);
  const auto place_m = [&](const Octree::Point& point) -> Vector3 {
    return surface.origin_m() + Vector3(point.x, point.y, point.z);
  };
  const auto [grid, cells] = cells_with(points, place_m, bounds, finest_m, kMostCells);

  // the surface may lie in a cell beside those of its points
  std::vector<Cell> around;
  std::unordered_map<Key, bool> known;
  for (const Cell& cell : cells) {
    for (int i = 0; i < 27; ++i) {
      const Cell near = cell + Cell(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
      if (known.emplace(key_of(near), true).second) around.push_back(near);
    }
  }
  return SurfaceNet(surface, grid).over(around);
}

SurfaceMesh mesh_of(const TriangleSurface& surface) {
  const TriangleMesh& given = surface.mesh();
  const std::size_t count = given.vertices_m.size();
  SurfaceMesh mesh;
  std::vector<std::uint32_t> becomes(count);
  if (count <= kMostVertices) {
    for (std::size_t i = 0; i < count; ++i) {
      append_vertex(given.vertices_m[i], mesh);
      becomes[i] = static_cast<std::uint32_t>(i);
    }
  } else {
    // the first vertex of each cell replaces the others
    const auto same = [](const Vector3& p) -> const Vector3& { return p; };
    const Grid grid = cells_with(given.vertices_m, same, surface.bounds(),
                                 surface.bounds().longest_side_m() / 1e3, kMostVertices)
                          .first;
    std::unordered_map<Key, std::uint32_t> kept;
    for (std::size_t i = 0; i < count; ++i) {
      const auto [it, is_new] = kept.emplace(key_of(grid.cell_of(given.vertices_m[i])),
                                             static_cast<std::uint32_t>(mesh.vertex_count()));
      if (is_new) append_vertex(given.vertices_m[i], mesh);
      becomes[i] = it->second;
    }
  }
  for (const auto& [a, b, c] : given.triangles) {
    if (becomes[a] == becomes[b] || becomes[b] == becomes[c] || becomes[c] == becomes[a]) continue;
    mesh.triangles.insert(mesh.triangles.end(), {becomes[a], becomes[b], becomes[c]});
  }
  return mesh;
}

}  // namespace

SurfaceMesh display_mesh(const FileSurface& surface) {
  if (const auto* cloud = dynamic_cast<const CloudSurface*>(&surface)) return mesh_of(*cloud);
  if (const auto* mesh = dynamic_cast<const TriangleSurface*>(&surface)) return mesh_of(*mesh);
  return {};
}

}  // namespace palpate::physics
