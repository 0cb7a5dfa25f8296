// SPDX-License-Identifier: Apache-2.0
#include "physics_node/display/display_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <variant>
#include <vector>

#include "physics_node/display/file_surface_mesh.h"
#include "physics_node/surfaces/subdivision.h"

namespace palpate::physics {
namespace {

constexpr double kFinestSpacing_m = 1e-3;   // a dent is a few of these wide
constexpr int kMostCellsPerEdge = 200;      // of long thin boxes
constexpr double kScatter = 1.03;           // a sphere has 10 242 vertices, a quarter of that, …
constexpr double kFarthest_m = 1e3;         // limit of the wire; coordinates are clamped to it
constexpr double kSceneVertices = 3e5;      // 11 MB with triangles; a message has at most 16 MiB
constexpr double kPatchHalfExtent_m = 0.1;  // workspace of the hand, about that of an Omni

std::uint32_t add_vertex(const Vector3& p, SurfaceMesh& mesh) {
  for (const double x : p) {
    mesh.vertices_m.push_back(static_cast<float>(std::clamp(x, -kFarthest_m, kFarthest_m)));
  }
  return static_cast<std::uint32_t>(mesh.vertex_count() - 1);
}

int cells_along(double length_m, double spacing_m) {
  return static_cast<int>(
      std::clamp(std::ceil(length_m / spacing_m), 1.0, static_cast<double>(kMostCellsPerEdge)));
}

/// A parallelogram from `corner` along `u` and `v`; u × v points out of the tissue.
void add_grid(const Vector3& corner, const Vector3& u, const Vector3& v, double spacing_m,
              SurfaceMesh& mesh) {
  const int columns = cells_along(u.norm(), spacing_m);
  const int rows = cells_along(v.norm(), spacing_m);
  const auto first = static_cast<std::uint32_t>(mesh.vertex_count());
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column <= columns; ++column) {
      add_vertex(corner + u * (static_cast<double>(column) / columns) +
                     v * (static_cast<double>(row) / rows),
                 mesh);
    }
  }
  const auto width = static_cast<std::uint32_t>(columns + 1);
  for (std::uint32_t row = 0; row < static_cast<std::uint32_t>(rows); ++row) {
    for (std::uint32_t column = 0; column < static_cast<std::uint32_t>(columns); ++column) {
      const std::uint32_t here = first + row * width + column;
      const std::uint32_t above = here + width;
      mesh.triangles.insert(mesh.triangles.end(),
                            {here, here + 1, above + 1, here, above + 1, above});
    }
  }
}

double spacing_for(double area_m2, const DisplayArea& area) {
  return std::max(kFinestSpacing_m, std::sqrt(area_m2 / area.vertices));
}

}  // namespace

DisplayArea display_area_of(const Session& session) {
  DisplayArea area{.center_m = Vector3::Zero(), .half_extent_m = 0.0};
  area.vertices = std::min(area.vertices,
                           kSceneVertices / static_cast<double>(session.scene.tissues.size() + 1));
  for (const Side& side : session.sides) {
    area.center_m += side.device.workspace.offset_m / static_cast<double>(session.sides.size());
  }
  for (const Side& side : session.sides) {
    const WorkspaceConfig& workspace = side.device.workspace;
    area.half_extent_m = std::max(area.half_extent_m,
                                  kPatchHalfExtent_m * workspace.scale_ratio +
                                      (workspace.offset_m - area.center_m).cwiseAbs().maxCoeff());
  }
  return area;
}

SurfaceMesh display_mesh(const HalfSpaceGeometry& half_space, const DisplayArea& area) {
  // two directions in the plane; u × v = normal
  const Vector3& n = half_space.normal;
  int least = 0;
  n.cwiseAbs().minCoeff(&least);
  const Vector3 u = Vector3::Unit(least).cross(n).normalized();
  const Vector3 v = n.cross(u);

  const Vector3 middle_m = area.center_m - n * n.dot(area.center_m - half_space.point_m);
  const double width_m = 2.0 * area.half_extent_m;
  SurfaceMesh mesh;
  add_grid(middle_m - area.half_extent_m * (u + v), width_m * u, width_m * v,
           spacing_for(width_m * width_m, area), mesh);
  return mesh;
}

SurfaceMesh display_mesh(const SphereGeometry& sphere, const DisplayArea& area) {
  DirectionMesh unit_sphere = icosahedron();
  // each division halves the edges
  const double wanted = std::max(kFinestSpacing_m, sphere.radius_m / 30.0) / sphere.radius_m;
  const auto& corners = unit_sphere.directions;
  const auto& first = unit_sphere.triangles.front();
  double length = (corners[first[1]] - corners[first[0]]).norm();
  const auto may_divide = [&] {
    return length > wanted && 4.0 * static_cast<double>(corners.size()) < kScatter * area.vertices;
  };
  for (; may_divide(); length /= 2.0) subdivide(unit_sphere);

  SurfaceMesh mesh;
  for (const Vector3& corner : corners) {
    add_vertex(sphere.center_m + sphere.radius_m * corner, mesh);
  }
  for (const auto& face : unit_sphere.triangles) {
    mesh.triangles.insert(mesh.triangles.end(), face.begin(), face.end());
  }
  return mesh;
}

SurfaceMesh display_mesh(const BoxGeometry& box, const DisplayArea& area) {
  const Vector3& size = box.size_m;
  const double spacing_m =
      spacing_for(2.0 * (size.x() * size.y() + size.y() * size.z() + size.z() * size.x()), area);
  const Vector3 lowest = box.center_m - 0.5 * size;
  SurfaceMesh mesh;
  for (int axis = 0; axis < 3; ++axis) {
    const int next = (axis + 1) % 3;
    const int last = (axis + 2) % 3;
    const Vector3 u = size[next] * Vector3::Unit(next);
    const Vector3 v = size[last] * Vector3::Unit(last);
    add_grid(lowest, v, u, spacing_m, mesh);
    add_grid(lowest + size[axis] * Vector3::Unit(axis), u, v, spacing_m, mesh);
  }
  return mesh;
}

SurfaceMesh display_mesh(const CapsuleGeometry& capsule, const DisplayArea& area) {
  const double r = capsule.radius_m;
  const Vector3 axis = capsule.to_m - capsule.from_m;
  const double length_m = axis.norm();
  const Vector3 along = length_m > 0.0 ? Vector3(axis / length_m) : Vector3::UnitZ();
  int least = 0;
  along.cwiseAbs().minCoeff(&least);
  const Vector3 u = Vector3::Unit(least).cross(along).normalized();
  const Vector3 v = along.cross(u);
  constexpr double kPi = std::numbers::pi;
  const double spacing_m = spacing_for(2.0 * kPi * r * (length_m + 2.0 * r), area);
  const int columns = std::max(8, cells_along(2.0 * kPi * r, spacing_m));
  const int rows_of_end = std::max(2, cells_along(0.5 * kPi * r, spacing_m));
  const int rows_of_side = length_m > 0.0 ? cells_along(length_m, spacing_m) : 0;

  // rings from one end to the other
  SurfaceMesh mesh;
  const std::uint32_t first_pole = add_vertex(capsule.from_m - r * along, mesh);
  const auto add_ring = [&](const Vector3& center_m, double ring_radius_m) {
    for (int column = 0; column < columns; ++column) {
      const double angle = 2.0 * kPi * column / columns;
      add_vertex(center_m + ring_radius_m * (std::cos(angle) * u + std::sin(angle) * v), mesh);
    }
  };
  const auto add_end_ring = [&](const Vector3& center_m, double outwards, int row) {
    const double angle = 0.5 * kPi * row / rows_of_end;
    add_ring(center_m + outwards * r * std::cos(angle) * along, r * std::sin(angle));
  };
  for (int row = 1; row <= rows_of_end; ++row) add_end_ring(capsule.from_m, -1.0, row);
  for (int row = 1; row <= rows_of_side; ++row) {
    add_ring(capsule.from_m + axis * (static_cast<double>(row) / rows_of_side), r);
  }
  for (int row = rows_of_end - 1; row >= 1; --row) add_end_ring(capsule.to_m, 1.0, row);
  const std::uint32_t last_pole = add_vertex(capsule.to_m + r * along, mesh);

  const auto width = static_cast<std::uint32_t>(columns);
  const std::uint32_t rings = (last_pole - 1) / width;
  for (std::uint32_t column = 0; column < width; ++column) {
    const std::uint32_t next = (column + 1) % width;
    mesh.triangles.insert(mesh.triangles.end(), {first_pole, 1 + next, 1 + column});
    for (std::uint32_t ring = 0; ring + 1 < rings; ++ring) {
      const std::uint32_t here = 1 + ring * width;
      mesh.triangles.insert(mesh.triangles.end(),
                            {here + column, here + next, here + width + next, here + column,
                             here + width + next, here + width + column});
    }
    const std::uint32_t last_ring = 1 + (rings - 1) * width;
    mesh.triangles.insert(mesh.triangles.end(), {last_ring + column, last_ring + next, last_pole});
  }
  return mesh;
}

SurfaceMesh display_mesh(const PlacedSurface& placed, const DisplayArea& /*area*/) {
  const SurfaceMesh own = display_mesh(*placed.surface);
  SurfaceMesh mesh;
  mesh.vertices_m.reserve(own.vertices_m.size());
  for (std::size_t i = 0; i < own.vertices_m.size(); i += 3) {
    const Vector3 at_m(own.vertices_m[i], own.vertices_m[i + 1], own.vertices_m[i + 2]);
    add_vertex(placed.position_m + placed.rotation * at_m, mesh);
  }
  mesh.triangles = own.triangles;
  return mesh;
}

SurfaceMesh display_mesh(const Shape& shape, const DisplayArea& area) {
  return std::visit([&](const auto& form) { return display_mesh(form, area); }, shape.form());
}

namespace {

SurfaceMesh mesh_of(const ElasticBody& body, std::span<const std::uint32_t> nodes,
                    const std::vector<elastic::Face>& faces) {
  SurfaceMesh mesh;
  std::vector<std::uint32_t> vertex_of(body.body->node_count(), 0);
  for (const std::uint32_t node : nodes) {
    vertex_of[node] = static_cast<std::uint32_t>(mesh.vertex_count());
    for (Eigen::Index i = 0; i < 3; ++i) {
      mesh.vertices_m.push_back(static_cast<float>(body.start_m[3 * Eigen::Index{node} + i]));
    }
  }
  for (const auto& corners : triangles_of(body.body->mesh(), faces)) {
    for (const std::uint32_t node : corners) mesh.triangles.push_back(vertex_of[node]);
  }
  return mesh;
}

}  // namespace

SurfaceMesh display_mesh(const ElasticBody& body) {
  return mesh_of(body, body.surface_nodes, body.faces);
}

SurfaceMesh display_mesh(const ElasticBody& body, const BodyPart& part) {
  return mesh_of(body, std::span(body.shown_nodes).subspan(part.first_node, part.node_count),
                 part.faces);
}

std::vector<float> display_stiffness_newton_per_m(const ElasticBody& body) {
  const elastic::BodyDescription& description = body.body->description();
  std::vector<double> sum(body.body->node_count(), 0.0);
  std::vector<double> faces(sum.size(), 0.0);
  const auto per_face = static_cast<std::size_t>(description.mesh.nodes_per_element == 4 ? 3 : 6);
  for (const elastic::Face& face : body.faces) {
    const double slope = hertz_slope_newton_per_m(
        description.materials[description.mesh.regions[face.element]], body.tip_radius_m);
    for (std::size_t i = 0; i < per_face; ++i) {
      sum[face.nodes[i]] += slope;
      faces[face.nodes[i]] += 1.0;
    }
  }
  std::vector<float> stiffness;
  for (const std::uint32_t node : body.surface_nodes) {
    stiffness.push_back(static_cast<float>(sum[node] / faces[node]));
  }
  return stiffness;
}

TissueShape shape_of(const Geometry& geometry) {
  struct Shapes {
    TissueShape operator()(const HalfSpaceGeometry&) const { return TissueShape::kHalfSpace; }
    TissueShape operator()(const SphereGeometry&) const { return TissueShape::kSphere; }
    TissueShape operator()(const BoxGeometry&) const { return TissueShape::kBox; }
    TissueShape operator()(const CapsuleGeometry&) const { return TissueShape::kCapsule; }
    TissueShape operator()(const FileGeometry& file) const {
      switch (file.kind) {
        case FileGeometry::Kind::kPointCloud:
          return TissueShape::kPointCloud;
        case FileGeometry::Kind::kTriangleSurface:
          return TissueShape::kTriangleSurface;
        case FileGeometry::Kind::kTetrahedralMesh:
          return TissueShape::kTetrahedra;
      }
      return TissueShape::kUnknown;
    }
  };
  return std::visit(Shapes{}, geometry);
}

}  // namespace palpate::physics
