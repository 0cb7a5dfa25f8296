// SPDX-License-Identifier: Apache-2.0
// triangle_grid.h — the triangles of a surface in cubic cells: which are near a place.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/core/vector.h"

namespace palpate {

using Corners = std::array<Vector3, 3>;

[[nodiscard]] inline double area_of(const Corners& triangle) {
  return 0.5 * (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).norm();
}

/// Of the indices of a cubic cell.
struct CellHash {
  template <class Index>
  std::size_t operator()(const std::array<Index, 3>& cell) const {
    return static_cast<std::size_t>(cell[0]) * 73856093U ^
           static_cast<std::size_t>(cell[1]) * 19349663U ^
           static_cast<std::size_t>(cell[2]) * 83492791U;
  }
};

/// Which edge is the longest, from corner i to the next, and its squared length.
[[nodiscard]] inline std::pair<std::size_t, double> longest_edge(const Corners& triangle) {
  std::pair<std::size_t, double> longest{0, 0.0};
  for (std::size_t i = 0; i < 3; ++i) {
    const double squared = (triangle[(i + 1) % 3] - triangle[i]).squaredNorm();
    if (squared > longest.second) longest = {i, squared};
  }
  return longest;
}

/// Two halves of a triangle, on both sides of the middle of an edge.
[[nodiscard]] inline std::array<Corners, 2> halves(const Corners& triangle, std::size_t edge) {
  const Vector3& a = triangle[edge];
  const Vector3& b = triangle[(edge + 1) % 3];
  const Vector3& c = triangle[(edge + 2) % 3];
  const Vector3 middle = 0.5 * (a + b);
  return {Corners{a, middle, c}, Corners{middle, b, c}};
}

class TriangleGrid {
 public:
  TriangleGrid() = default;
  explicit TriangleGrid(const std::vector<Corners>& triangles) {
    if (triangles.empty()) return;
    Vector3 lowest_m = triangles[0][0];
    Vector3 highest_m = lowest_m;
    double area_m2 = 0.0;
    for (const Corners& one : triangles) {
      for (const Vector3& corner : one) {
        lowest_m = lowest_m.cwiseMin(corner);
        highest_m = highest_m.cwiseMax(corner);
      }
      area_m2 += area_of(one);
    }
    const double count = std::clamp(static_cast<double>(triangles.size()), 1e3, 1e5);
    cell_m_ = std::max(std::sqrt(area_m2 / count), (highest_m - lowest_m).maxCoeff() / kMostAcross);
    for (std::size_t i = 0; i < triangles.size(); ++i) {
      insert(static_cast<std::uint32_t>(i), triangles[i]);
    }
  }

  /// Calls visit(triangle) for every triangle with a place within that distance, and others; for
  /// some more than once.
  template <class Visit>
  void for_near(const Vector3& place_m, double within_m, const Visit& visit) const {
    const Cell first = cell_of(place_m - Vector3::Constant(within_m));
    const Cell last = cell_of(place_m + Vector3::Constant(within_m));
    for_box(
        first, last, [](const Cell& /*cell*/) { return true; }, visit);
  }

  /// Calls visit(triangle) for triangles, nearer cells first. `visit` returns the least distance so
  /// far, beyond which nothing is visited.
  template <class Visit>
  void for_nearest(const Vector3& place_m, double within_m, const Visit& visit) const {
    const Cell middle = cell_of(place_m);
    const std::int64_t farthest = farthest_shell(middle);
    for (std::int64_t shell = nearest_shell(middle);
         static_cast<double>(shell - 1) * cell_m_ <= within_m && shell <= farthest; ++shell) {
      Cell first = middle;
      Cell last = middle;
      for (std::size_t i = 0; i < 3; ++i) {
        first[i] -= shell;
        last[i] += shell;
      }
      for_box(
          first, last, [&](const Cell& cell) { return distance(cell, middle) == shell; },
          [&](std::uint32_t one) { within_m = std::min(within_m, visit(one)); });
    }
  }

 private:
  static constexpr double kMostAcross = 24.0;  // cells
  static constexpr double kFarthestCell = 1e9;

  using Cell = std::array<std::int64_t, 3>;

  [[nodiscard]] Cell cell_of(const Vector3& place_m) const {
    Cell cell{};
    for (std::size_t i = 0; i < 3; ++i) {
      const double index = std::floor(place_m[static_cast<Eigen::Index>(i)] / cell_m_);
      cell[i] = static_cast<std::int64_t>(std::clamp(index, -kFarthestCell, kFarthestCell));
    }
    return cell;
  }

  /// Pieces of at most a cell's size, each in the cells that its box meets.
  void insert(std::uint32_t triangle, const Corners& piece) {
    const auto [edge, squared] = longest_edge(piece);
    if (squared > cell_m_ * cell_m_) {
      for (const Corners& half : halves(piece, edge)) insert(triangle, half);
      return;
    }
    const Cell first = cell_of(piece[0].cwiseMin(piece[1]).cwiseMin(piece[2]));
    const Cell last = cell_of(piece[0].cwiseMax(piece[1]).cwiseMax(piece[2]));
    for (std::int64_t x = first[0]; x <= last[0]; ++x) {
      for (std::int64_t y = first[1]; y <= last[1]; ++y) {
        for (std::int64_t z = first[2]; z <= last[2]; ++z) {
          std::vector<std::uint32_t>& cell = cells_[{x, y, z}];
          if (cell.empty() || cell.back() != triangle) cell.push_back(triangle);
        }
      }
    }
    for (std::size_t i = 0; i < 3; ++i) {
      first_[i] = std::min(first_[i], first[i]);
      last_[i] = std::max(last_[i], last[i]);
    }
  }

  /// Calls visit(triangle) for those of the cells of a box that are wanted.
  template <class Wanted, class Visit>
  void for_box(Cell first, Cell last, const Wanted& is_wanted, const Visit& visit) const {
    for (std::size_t i = 0; i < 3; ++i) {
      first[i] = std::max(first[i], first_[i]);
      last[i] = std::min(last[i], last_[i]);
    }
    for (std::int64_t x = first[0]; x <= last[0]; ++x) {
      for (std::int64_t y = first[1]; y <= last[1]; ++y) {
        for (std::int64_t z = first[2]; z <= last[2]; ++z) {
          if (!is_wanted({x, y, z})) continue;
          const auto cell = cells_.find({x, y, z});
          if (cell == cells_.end()) continue;
          for (const std::uint32_t one : cell->second) visit(one);
        }
      }
    }
  }

  /// In cells, along the axis of which it is largest.
  [[nodiscard]] static std::int64_t distance(const Cell& a, const Cell& b) {
    std::int64_t most = 0;
    for (std::size_t i = 0; i < 3; ++i) most = std::max(most, std::abs(a[i] - b[i]));
    return most;
  }
  [[nodiscard]] std::int64_t nearest_shell(const Cell& middle) const {
    std::int64_t nearest = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      nearest = std::max({nearest, first_[i] - middle[i], middle[i] - last_[i]});
    }
    return nearest;
  }
  [[nodiscard]] std::int64_t farthest_shell(const Cell& middle) const {
    return std::max(distance(middle, first_), distance(middle, last_));
  }

  double cell_m_ = 1.0;
  std::unordered_map<Cell, std::vector<std::uint32_t>, CellHash> cells_;
  static constexpr std::int64_t kNowhere = 4'000'000'000;
  Cell first_{kNowhere, kNowhere, kNowhere};  // that has triangles
  Cell last_{-kNowhere, -kNowhere, -kNowhere};
};

}  // namespace palpate
