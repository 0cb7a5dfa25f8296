// SPDX-License-Identifier: Apache-2.0
// mesh.h — tetrahedral meshes of elastic bodies: linear and quadratic, their faces, their quality.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace palpate::elastic {

using Eigen::Vector3d;

/// Tetrahedra of 4 nodes (linear), or of 10 with straight edges (quadratic). Node 4 + k of a
/// quadratic element lies in the middle of edge kEdges[k], the order of Gmsh and of CalculiX C3D10
/// but for the last two of Gmsh, which are exchanged.
struct Mesh {
  std::vector<Vector3d> nodes_m;
  int nodes_per_element = 4;            ///< 4 or 10
  std::vector<std::uint32_t> elements;  ///< nodes_per_element indices each
  std::vector<std::uint8_t> regions;    ///< material of each element; empty: all 0

  [[nodiscard]] std::size_t element_count() const noexcept {
    return elements.size() / static_cast<std::size_t>(nodes_per_element);
  }
  [[nodiscard]] std::span<const std::uint32_t> element(std::size_t e) const noexcept {
    const auto n = static_cast<std::size_t>(nodes_per_element);
    return std::span(elements).subspan(e * n, n);
  }
};

inline constexpr std::array<std::array<int, 2>, 6> kEdges = {
    {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}}};

/// Corners of the face opposite to corner k, counter-clockwise seen from outside.
inline constexpr std::array<std::array<int, 3>, 4> kFaces = {
    {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

/// A box cut along the given planes (ascending, at least two per axis) [m] into cells, and each
/// cell into five tetrahedra, mirrored from cell to cell so that faces match.
[[nodiscard]] Mesh box_mesh(std::span<const double> xs_m, std::span<const double> ys_m,
                            std::span<const double> zs_m);

/// `cells` + 1 equidistant planes from `from_m` to `to_m`.
[[nodiscard]] std::vector<double> equal_planes(double from_m, double to_m, int cells);

/// `cells` + 1 planes from 0 to `length_m`, the first cell `first_m` long, the others growing by a
/// constant ratio; equidistant if that would need a ratio below 1.
[[nodiscard]] std::vector<double> graded_planes(double length_m, int cells, double first_m);

/// The beam of the benchmark, 0.1 × 0.025 × 0.025 m along x.
[[nodiscard]] Mesh beam_mesh(int cells_along, int cells_across);

/// The block of the benchmark, 0.1 × 0.1 × 0.05 m, graded towards the middle of its top: `cells`
/// from there to each side and `cells_deep` down, the first `first_m` long.
[[nodiscard]] Mesh block_mesh(int cells, int cells_deep, double first_m);

/// The same body with 10 nodes per element; edges share their node. @pre mesh is linear
[[nodiscard]] Mesh quadratic(const Mesh& mesh);

/// Indices of the nodes for which `is_inside(position_m)` holds.
template <class Predicate>
[[nodiscard]] std::vector<std::uint32_t> nodes_where(const Mesh& mesh, Predicate is_inside) {
  std::vector<std::uint32_t> found;
  for (std::uint32_t i = 0; i < mesh.nodes_m.size(); ++i) {
    if (is_inside(mesh.nodes_m[i])) found.push_back(i);
  }
  return found;
}

/// A face that belongs to one element only: 3 or 6 nodes, counter-clockwise seen from outside;
/// the last three in the middle of the edges 01, 12 and 20.
struct Face {
  std::array<std::uint32_t, 6> nodes{};
  std::uint32_t element = 0;
};
[[nodiscard]] std::vector<Face> surface_of(const Mesh& mesh);

/// Shape of an element, 1 for the regular tetrahedron, 0 for a flat one, below 0 if it is inverted:
/// 6 √2 V / l³ with l the root mean square of the edges.
[[nodiscard]] double element_quality(const Mesh& mesh, std::size_t element);

/// What a user should know of a mesh before a run.
struct MeshQuality {
  std::size_t nodes = 0;
  std::size_t elements = 0;
  std::size_t inverted = 0;      ///< volume ≤ 0
  std::size_t slivers = 0;       ///< quality < kSliver, not inverted
  std::size_t unused_nodes = 0;  ///< in no element
  double least_quality = 0.0;
  std::size_t worst_element = 0;
  double volume_m3 = 0.0;
  double shortest_edge_m = 0.0;
  double longest_edge_m = 0.0;
  double extent_m = 0.0;  ///< diagonal of the bounding box

  [[nodiscard]] bool is_usable() const noexcept {
    return elements > 0 && inverted == 0 && unused_nodes == 0;
  }
  /// No organ is below 1 mm or above 10 m: the file is in another unit than metres.
  [[nodiscard]] bool is_scale_doubtful() const noexcept {
    return extent_m < 1e-3 || extent_m > 10.0;
  }
};
inline constexpr double kSliver = 0.1;
[[nodiscard]] MeshQuality quality_of(const Mesh& mesh);

/// From a straight line between two ends.
[[nodiscard]] double distance_to_edge_m(const Vector3d& at_m,
                                        const std::array<Vector3d, 2>& edge_m);

}  // namespace palpate::elastic
