// SPDX-License-Identifier: Apache-2.0
// elastic_problems.h — the bodies that elastic_bench, elastic_stress and elastic_test share.
#pragma once

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "physics_node/elastic/body.h"
#include "physics_node/elastic/sphere_contact.h"

namespace palpate::bench {

/// A beam clamped at x = 0 under gravity along −z.
inline elastic::BodyDescription hanging_beam(const elastic::Mesh& mesh, elastic::Law law,
                                             double young_modulus_pa, double poisson_ratio) {
  return {.mesh = mesh,
          .materials = {{.young_modulus_pa = young_modulus_pa, .poisson_ratio = poisson_ratio}},
          .law = law,
          .fixed_nodes =
              elastic::nodes_where(mesh, [](const elastic::Vector3d& x) { return x.x() < 1e-9; }),
          .gravity_m_per_s2 = {0.0, 0.0, -9.81}};
}

/// Index of the z coordinate of the middle of the beam's free end.
inline Eigen::Index tip_of(const elastic::Mesh& mesh) {
  Eigen::Index nearest = 0;
  double least = INFINITY;
  for (std::size_t i = 0; i < mesh.nodes_m.size(); ++i) {
    const double away = (mesh.nodes_m[i] - elastic::Vector3d(0.1, 0.0125, 0.0125)).norm();
    if (away < least) {
      least = away;
      nearest = static_cast<Eigen::Index>(3 * i + 2);
    }
  }
  return nearest;
}

/// A block that stands on its fixed bottom, without gravity.
inline elastic::BodyDescription standing_block(const elastic::Mesh& mesh, elastic::Law law) {
  return {.mesh = mesh,
          .materials = {{.young_modulus_pa = 10e3, .poisson_ratio = 0.45}},
          .law = law,
          .fixed_nodes =
              elastic::nodes_where(mesh, [](const elastic::Vector3d& x) { return x.z() < 1e-9; })};
}

/// The block of standing_block() as cubes nested around the middle of its top: the innermost
/// reaches `inner_m` to each side and down and has `cells` cells on each half edge, each further
/// one is larger by the same ratio, the last is the block. Its cells are nowhere stretched, so that
/// it needs fewer nodes than one graded along each axis.
inline elastic::Mesh nested_block(int cells, double inner_m, int shells) {
  elastic::Mesh mesh;
  std::map<std::array<int, 4>, std::uint32_t> places;
  const double ratio = std::pow(0.05 / inner_m, 1.0 / shells);
  // grid point of the innermost cube, i, j = −cells…cells, k = −cells…0, moved out to a shell
  const auto node = [&](const std::array<int, 3>& at, int shell) {
    const auto [entry, is_new] = places.try_emplace(
        {at[0], at[1], at[2], shell}, static_cast<std::uint32_t>(mesh.nodes_m.size()));
    if (is_new) {
      const double scale_m = inner_m * std::pow(ratio, shell) / cells;
      mesh.nodes_m.emplace_back(0.05 + scale_m * at[0], 0.05 + scale_m * at[1],
                                0.05 + scale_m * at[2]);
    }
    return entry->second;
  };
  // Five tetrahedra. Which diagonals they have depends on whether corner 0 is an even grid point,
  // so that those of neighbours meet.
  using Corners = std::array<std::uint32_t, 8>;  // bit 0, 1, 2 of the index: along which edge
  const auto add = [&](const Corners& corners, bool is_even) {
    constexpr int kCuts[2][5][4] = {
        // NOLINT
        {{0, 3, 5, 6}, {1, 0, 3, 5}, {2, 0, 3, 6}, {4, 0, 5, 6}, {7, 3, 5, 6}},
        {{1, 2, 4, 7}, {0, 1, 2, 4}, {3, 1, 2, 7}, {5, 1, 4, 7}, {6, 2, 4, 7}}};
    for (const auto& cut : kCuts[is_even ? 0 : 1]) {
      std::array<std::uint32_t, 4> nodes{};
      for (std::size_t i = 0; i < 4; ++i) nodes[i] = corners[static_cast<std::size_t>(cut[i])];
      Eigen::Matrix3d edges;
      for (Eigen::Index i = 0; i < 3; ++i) {
        edges.col(i) =
            mesh.nodes_m[nodes[static_cast<std::size_t>(i) + 1]] - mesh.nodes_m[nodes[0]];
      }
      if (edges.determinant() < 0.0) std::swap(nodes[2], nodes[3]);
      mesh.elements.insert(mesh.elements.end(), nodes.begin(), nodes.end());
    }
  };
  const auto is_even = [](int number) { return number % 2 == 0; };
  for (int i = -cells; i < cells; ++i) {
    for (int j = -cells; j < cells; ++j) {
      for (int k = -cells; k < 0; ++k) {
        Corners corners{};
        for (int c = 0; c < 8; ++c) {
          corners[static_cast<std::size_t>(c)] =
              node({i + (c & 1), j + ((c >> 1) & 1), k + (c >> 2)}, 0);
        }
        add(corners, is_even(i + j + k));
      }
    }
  }
  for (int shell = 0; shell < shells; ++shell) {
    // a face of the grid and the same face one shell further out
    const auto add_between = [&](auto at) {
      Corners corners{};
      for (int c = 0; c < 8; ++c) {
        corners[static_cast<std::size_t>(c)] = node(at(c & 1, (c >> 1) & 1), shell + (c >> 2));
      }
      const std::array<int, 3> first = at(0, 0);
      add(corners, is_even(first[0] + first[1] + first[2] + shell));
    };
    for (int i = -cells; i < cells; ++i) {
      for (int j = -cells; j < cells; ++j) {
        add_between([&](int u, int v) { return std::array{i + u, j + v, -cells}; });
      }
      for (int k = -cells; k < 0; ++k) {
        for (const int side : {-cells, cells}) {
          add_between([&](int u, int v) { return std::array{i + u, side, k + v}; });
          add_between([&](int u, int v) { return std::array{side, i + u, k + v}; });
        }
      }
    }
  }
  return mesh;
}

/// Points of the block's top within `radius_m` of its middle.
inline std::vector<elastic::SurfacePoint> top_points(const elastic::Mesh& mesh, double radius_m,
                                                     int per_edge) {
  std::vector<elastic::Face> faces;
  for (const elastic::Face& face : elastic::surface_of(mesh)) {
    bool is_top = true;
    double nearest = INFINITY;
    for (std::size_t k = 0; k < 3; ++k) {
      const elastic::Vector3d& x = mesh.nodes_m[face.nodes[k]];
      is_top = is_top && x.z() > 0.05 - 1e-9;
      nearest = std::min(nearest, std::hypot(x.x() - 0.05, x.y() - 0.05));
    }
    if (is_top && nearest < radius_m) faces.push_back(face);
  }
  return elastic::surface_points(mesh, faces, per_edge);
}

}  // namespace palpate::bench
