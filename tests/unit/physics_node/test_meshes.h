// SPDX-License-Identifier: Apache-2.0
// test_meshes.h — small closed meshes.
#pragma once

#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "physics_node/surfaces/tetrahedral_mesh.h"
#include "physics_node/surfaces/triangle_surface.h"

namespace palpate::physics {

/// Six tetrahedra round the diagonal of a cube about the origin.
inline TetrahedralMesh cube_of_tetrahedra(double edge_m) {
  TetrahedralMesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.nodes_m.push_back(edge_m *
                           (Vector3(i & 1, i >> 1 & 1, i >> 2 & 1) - Vector3::Constant(0.5)));
  }
  // each goes from corner 0 to corner 7 over one axis after the other
  mesh.tetrahedra = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7},
                     {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
  return mesh;
}

/// Twelve triangles.
inline TriangleMesh cube_mesh(double edge_m) { return surface_of(cube_of_tetrahedra(edge_m)); }

/// A ball about the origin with `rings` rings of 2·rings corners, and two poles.
inline TriangleMesh ball_mesh(double radius_m, std::uint32_t rings) {
  TriangleMesh mesh;
  const std::uint32_t around = 2 * rings;
  mesh.vertices_m.push_back({0, 0, radius_m});
  for (std::uint32_t ring = 1; ring <= rings; ++ring) {
    const double polar = std::numbers::pi * ring / (rings + 1);
    for (std::uint32_t i = 0; i < around; ++i) {
      const double azimuth = 2 * std::numbers::pi * i / around;
      mesh.vertices_m.push_back(radius_m * Vector3(std::sin(polar) * std::cos(azimuth),
                                                   std::sin(polar) * std::sin(azimuth),
                                                   std::cos(polar)));
    }
  }
  mesh.vertices_m.push_back({0, 0, -radius_m});
  const auto corner = [&](std::uint32_t ring, std::uint32_t i) {
    return 1 + (ring - 1) * around + i % around;
  };
  const auto last = static_cast<std::uint32_t>(mesh.vertices_m.size() - 1);
  for (std::uint32_t i = 0; i < around; ++i) {
    mesh.triangles.push_back({0, corner(1, i), corner(1, i + 1)});
    for (std::uint32_t ring = 1; ring < rings; ++ring) {
      mesh.triangles.push_back({corner(ring, i), corner(ring + 1, i), corner(ring + 1, i + 1)});
      mesh.triangles.push_back({corner(ring, i), corner(ring + 1, i + 1), corner(ring, i + 1)});
    }
    mesh.triangles.push_back({corner(rings, i), last, corner(rings, i + 1)});
  }
  return mesh;
}

/// A square in the plane z = 0 that faces up, `cells` by `cells` cells of two triangles; open.
inline TriangleMesh sheet_mesh(double half_edge_m, std::uint32_t cells) {
  TriangleMesh mesh;
  const std::uint32_t row = cells + 1;
  for (std::uint32_t i = 0; i < row * row; ++i) {
    const std::uint32_t x = i % row;
    const std::uint32_t y = i / row;
    mesh.vertices_m.push_back(half_edge_m *
                              Vector3(2.0 * x / cells - 1.0, 2.0 * y / cells - 1.0, 0.0));
  }
  for (std::uint32_t y = 0; y < cells; ++y) {
    for (std::uint32_t x = 0; x < cells; ++x) {
      const std::uint32_t at = y * row + x;
      mesh.triangles.push_back({at, at + 1, at + row + 1});
      mesh.triangles.push_back({at, at + row + 1, at + row});
    }
  }
  return mesh;
}

/// A bar along y whose section in x and z is this polygon, clockwise with x to the
/// right and z up; its first corner sees all others.
inline TriangleMesh bar_mesh(const std::vector<std::pair<double, double>>& section_m,
                             double half_length_m) {
  TriangleMesh mesh;
  const auto count = static_cast<std::uint32_t>(section_m.size());
  for (const double y : {-half_length_m, half_length_m}) {
    for (const auto& [x, z] : section_m) mesh.vertices_m.push_back({x, y, z});
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t next = (i + 1) % count;
    mesh.triangles.push_back({i, next, count + next});
    mesh.triangles.push_back({i, count + next, count + i});
    if (i == 0 || next == 0) continue;
    mesh.triangles.push_back({0, next, i});
    mesh.triangles.push_back({count, count + i, count + next});
  }
  return mesh;
}

inline std::string obj_text(const TriangleMesh& mesh) {
  std::string text;
  for (const Vector3& v : mesh.vertices_m) {
    text += "v " + std::to_string(v.x()) + " " + std::to_string(v.y()) + " " +
            std::to_string(v.z()) + "\n";
  }
  for (const auto& [a, b, c] : mesh.triangles) {
    text += "f " + std::to_string(a + 1) + " " + std::to_string(b + 1) + " " +
            std::to_string(c + 1) + "\n";
  }
  return text;
}

}  // namespace palpate::physics
