// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

namespace palpate::elastic {
namespace {

using Tetrahedron = std::array<std::uint32_t, 4>;

double six_volumes(const std::vector<Vector3d>& x, std::span<const std::uint32_t> t) {
  return (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).dot(x[t[3]] - x[t[0]]);
}

// Corners of a cell: 0..3 counter-clockwise at the bottom, 4..7 above them.
constexpr std::array<Tetrahedron, 5> kEven = {
    {{0, 1, 3, 4}, {1, 2, 3, 6}, {1, 4, 6, 5}, {3, 4, 7, 6}, {1, 3, 4, 6}}};
constexpr std::array<Tetrahedron, 5> kOdd = {
    {{0, 1, 2, 5}, {0, 2, 3, 7}, {0, 5, 7, 4}, {2, 5, 6, 7}, {0, 2, 7, 5}}};

std::uint64_t edge_key(std::uint32_t a, std::uint32_t b) {
  return (std::uint64_t{std::min(a, b)} << 32) | std::max(a, b);
}

}  // namespace

Mesh box_mesh(std::span<const double> xs_m, std::span<const double> ys_m,
              std::span<const double> zs_m) {
  Mesh mesh;
  for (const double z : zs_m) {
    for (const double y : ys_m) {
      for (const double x : xs_m) mesh.nodes_m.emplace_back(x, y, z);
    }
  }
  const std::size_t nx = xs_m.size();
  const std::size_t ny = ys_m.size();
  const auto index = [&](std::size_t i, std::size_t j, std::size_t k) {
    return static_cast<std::uint32_t>((k * ny + j) * nx + i);
  };
  for (std::size_t k = 0; k + 1 < zs_m.size(); ++k) {
    for (std::size_t j = 0; j + 1 < ny; ++j) {
      for (std::size_t i = 0; i + 1 < nx; ++i) {
        const std::array<std::uint32_t, 8> c = {index(i, j, k),
                                                index(i + 1, j, k),
                                                index(i + 1, j + 1, k),
                                                index(i, j + 1, k),
                                                index(i, j, k + 1),
                                                index(i + 1, j, k + 1),
                                                index(i + 1, j + 1, k + 1),
                                                index(i, j + 1, k + 1)};
        for (const Tetrahedron& corners : (i + j + k) % 2 == 0 ? kEven : kOdd) {
          Tetrahedron t = {c[corners[0]], c[corners[1]], c[corners[2]], c[corners[3]]};
          if (six_volumes(mesh.nodes_m, t) < 0.0) std::swap(t[2], t[3]);
          mesh.elements.insert(mesh.elements.end(), t.begin(), t.end());
        }
      }
    }
  }
  return mesh;
}

std::vector<double> equal_planes(double from_m, double to_m, int cells) {
  std::vector<double> planes;
  for (int i = 0; i <= cells; ++i) planes.push_back(from_m + (to_m - from_m) * i / cells);
  return planes;
}

std::vector<double> graded_planes(double length_m, int cells, double first_m) {
  if (first_m * cells >= length_m) return equal_planes(0.0, length_m, cells);
  const auto length = [&](double ratio) {
    return ratio > 1.0 + 1e-12 ? first_m * (std::pow(ratio, cells) - 1.0) / (ratio - 1.0)
                               : first_m * cells;
  };
  double low = 1.0;
  double high = 10.0;
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    (length(middle) > length_m ? high : low) = middle;
  }
  std::vector<double> planes = {0.0};
  double cell_m = first_m;
  for (int i = 0; i < cells; ++i) {
    planes.push_back(planes.back() + cell_m);
    cell_m *= low;
  }
  const double scale = length_m / planes.back();
  for (double& plane : planes) plane *= scale;
  return planes;
}

Mesh beam_mesh(int cells_along, int cells_across) {
  const std::vector<double> across = equal_planes(0.0, 0.025, cells_across);
  return box_mesh(equal_planes(0.0, 0.1, cells_along), across, across);
}

Mesh block_mesh(int cells, int cells_deep, double first_m) {
  const std::vector<double> half = graded_planes(0.05, cells, first_m);
  std::vector<double> across;
  for (auto plane = half.rbegin(); plane != half.rend(); ++plane) across.push_back(0.05 - *plane);
  for (std::size_t i = 1; i < half.size(); ++i) across.push_back(0.05 + half[i]);
  const std::vector<double> down = graded_planes(0.05, cells_deep, first_m);
  std::vector<double> deep;
  for (auto plane = down.rbegin(); plane != down.rend(); ++plane) deep.push_back(0.05 - *plane);
  deep.front() = 0.0;
  return box_mesh(across, across, deep);
}

Mesh quadratic(const Mesh& mesh) {
  Mesh fine;
  fine.nodes_m = mesh.nodes_m;
  fine.nodes_per_element = 10;
  fine.regions = mesh.regions;
  fine.elements.reserve(mesh.element_count() * 10);
  std::unordered_map<std::uint64_t, std::uint32_t> middles;
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    const auto corners = mesh.element(e);
    fine.elements.insert(fine.elements.end(), corners.begin(), corners.end());
    for (const auto& edge : kEdges) {
      const std::uint32_t a = corners[static_cast<std::size_t>(edge[0])];
      const std::uint32_t b = corners[static_cast<std::size_t>(edge[1])];
      const auto [entry, is_new] =
          middles.try_emplace(edge_key(a, b), static_cast<std::uint32_t>(fine.nodes_m.size()));
      if (is_new) fine.nodes_m.emplace_back(0.5 * (mesh.nodes_m[a] + mesh.nodes_m[b]));
      fine.elements.push_back(entry->second);
    }
  }
  return fine;
}

std::vector<Face> surface_of(const Mesh& mesh) {
  struct Side {
    std::array<std::uint32_t, 3> sorted;
    Face face;
  };
  std::vector<Side> sides;
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    const auto element = mesh.element(e);
    for (const auto& corners : kFaces) {
      Side side;
      side.face.element = static_cast<std::uint32_t>(e);
      for (std::size_t i = 0; i < 3; ++i) {
        const int a = corners[i];
        const int b = corners[(i + 1) % 3];
        side.face.nodes[i] = element[static_cast<std::size_t>(a)];
        side.sorted[i] = side.face.nodes[i];
        for (std::size_t k = 0; mesh.nodes_per_element == 10 && k < 6; ++k) {
          if (std::minmax(a, b) == std::minmax(kEdges[k][0], kEdges[k][1])) {
            side.face.nodes[3 + i] = element[4 + k];
          }
        }
      }
      std::sort(side.sorted.begin(), side.sorted.end());
      sides.push_back(side);
    }
  }
  std::stable_sort(sides.begin(), sides.end(),
                   [](const Side& a, const Side& b) { return a.sorted < b.sorted; });
  std::vector<Face> faces;
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t end = i + 1;
    while (end < sides.size() && sides[end].sorted == sides[i].sorted) ++end;
    if (end == i + 1) faces.push_back(sides[i].face);
    i = end;
  }
  return faces;
}

double element_quality(const Mesh& mesh, std::size_t element) {
  const auto t = mesh.element(element);
  double squares = 0.0;
  for (const auto& edge : kEdges) {
    squares += (mesh.nodes_m[t[static_cast<std::size_t>(edge[0])]] -
                mesh.nodes_m[t[static_cast<std::size_t>(edge[1])]])
                   .squaredNorm();
  }
  const double length = std::sqrt(squares / 6.0);
  if (!(length > 0.0)) return 0.0;
  return std::sqrt(2.0) * six_volumes(mesh.nodes_m, t) / (length * length * length);
}

MeshQuality quality_of(const Mesh& mesh) {
  MeshQuality quality{.nodes = mesh.nodes_m.size(), .elements = mesh.element_count()};
  quality.least_quality = std::numeric_limits<double>::infinity();
  quality.shortest_edge_m = std::numeric_limits<double>::infinity();
  std::vector<bool> is_used(mesh.nodes_m.size(), false);
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    const auto element = mesh.element(e);
    for (const std::uint32_t node : element) is_used[node] = true;
    const double volume = six_volumes(mesh.nodes_m, element) / 6.0;
    const double shape = element_quality(mesh, e);
    quality.volume_m3 += volume;
    if (!(volume > 0.0)) {
      ++quality.inverted;
    } else if (shape < kSliver) {
      ++quality.slivers;
    }
    if (shape < quality.least_quality) {
      quality.least_quality = shape;
      quality.worst_element = e;
    }
    for (const auto& edge : kEdges) {
      const double length = (mesh.nodes_m[element[static_cast<std::size_t>(edge[0])]] -
                             mesh.nodes_m[element[static_cast<std::size_t>(edge[1])]])
                                .norm();
      quality.shortest_edge_m = std::min(quality.shortest_edge_m, length);
      quality.longest_edge_m = std::max(quality.longest_edge_m, length);
    }
  }
  quality.unused_nodes =
      static_cast<std::size_t>(std::count(is_used.begin(), is_used.end(), false));
  Vector3d low = Vector3d::Constant(std::numeric_limits<double>::infinity());
  Vector3d high = -low;
  for (const Vector3d& node : mesh.nodes_m) {
    low = low.cwiseMin(node);
    high = high.cwiseMax(node);
  }
  quality.extent_m = mesh.nodes_m.empty() ? 0.0 : (high - low).norm();
  return quality;
}

double distance_to_edge_m(const Vector3d& at_m, const std::array<Vector3d, 2>& edge_m) {
  const Vector3d way_m = edge_m[1] - edge_m[0];
  const Vector3d from_m = at_m - edge_m[0];
  const double length2 = std::max(way_m.squaredNorm(), 1e-18);
  const double share = std::clamp(from_m.dot(way_m) / length2, 0.0, 1.0);
  return (from_m - share * way_m).norm();
}

}  // namespace palpate::elastic
