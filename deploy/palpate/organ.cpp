// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/organ.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "physics_node/elastic/mesh.h"
#include "physics_node/surfaces/subdivision.h"

namespace palpate {
namespace {

const Vector3 kStretch(1.0, 0.8, 0.5);

double radius_m(const Vector3& n) {
  const Vector3 dent = Vector3(0.2, -0.9, -0.3).normalized();
  return 0.052 * (1.0 + 0.18 * n.x() + 0.12 * (n.x() * n.x() - n.y() * n.y()) +
                  0.06 * std::sin(3.0 * n.x() + 2.0 * n.y()) -
                  0.22 * std::exp(-(n - dent).squaredNorm() / 0.18));
}

/// The point of the surface in a direction (unit) from the centre, before it is stretched.
Vector3 surface_at(const Vector3& n) { return radius_m(n) * n.cwiseProduct(kStretch); }

Vector3 normal_at(const Vector3& n) {
  constexpr double kStep = 1e-5;
  const Vector3 first = n.unitOrthogonal();
  const Vector3 second = n.cross(first);
  const auto slope = [&](const Vector3& along) {
    return Vector3(surface_at((n + kStep * along).normalized()) -
                   surface_at((n - kStep * along).normalized()));
  };
  return slope(first).cross(slope(second)).normalized();
}

double stiffness_ratio_at(const Vector3& point_m) {
  const Vector3 lump_m(0.02, 0.005, 0.022);
  constexpr double kRadius_m = 0.008;
  return 1.0 + 3.0 * std::exp(-(point_m - lump_m).squaredNorm() / (kRadius_m * kRadius_m));
}

}  // namespace

bool is_in_organ(const Vector3& place_m) {
  const Vector3 unstretched_m = place_m.cwiseQuotient(kStretch);
  const double distance_m = unstretched_m.norm();
  return distance_m < 1e-9 || distance_m < radius_m(unstretched_m / distance_m);
}

physics::PointCloud organ_cloud(std::uint32_t points,
                                const std::function<void(double)>& on_progress) {
  physics::PointCloud cloud;
  // a spiral from pole to pole in steps of the golden angle
  constexpr double kGoldenAngle = 2.0 * std::numbers::pi * (1.0 - 1.0 / std::numbers::phi);
  for (std::uint32_t i = 0; i < points; ++i) {
    if (on_progress) on_progress(static_cast<double>(i) / points);
    const double z = 1.0 - (2.0 * i + 1.0) / points;
    const double r = std::sqrt(1.0 - z * z);
    const Vector3 n(r * std::cos(kGoldenAngle * i), r * std::sin(kGoldenAngle * i), z);
    cloud.points_m.push_back(surface_at(n));
    cloud.normals.push_back(normal_at(n));
    cloud.stiffness_ratios.push_back(stiffness_ratio_at(cloud.points_m.back()));
  }
  return cloud;
}

physics::TetrahedralMesh organ_mesh(std::uint32_t subdivisions) {
  physics::DirectionMesh directions = physics::icosahedron();
  for (std::uint32_t i = 0; i < subdivisions; ++i) physics::subdivide(directions);

  constexpr std::array<double, 3> kShells{0.4, 0.75, 1.0};
  physics::TetrahedralMesh mesh;
  for (const double shell : kShells) {
    for (const Vector3& n : directions.directions) mesh.nodes_m.push_back(shell * surface_at(n));
  }
  const auto center = static_cast<std::uint32_t>(mesh.nodes_m.size());
  mesh.nodes_m.push_back(Vector3::Zero());

  const auto add = [&](std::array<std::uint32_t, 4> corners) {
    if (physics::six_volumes_m3(mesh.nodes_m, corners) < 0.0) std::swap(corners[0], corners[1]);
    mesh.tetrahedra.push_back(corners);
  };
  const auto per_shell = static_cast<std::uint32_t>(directions.directions.size());
  for (std::array<std::uint32_t, 3> triangle : directions.triangles) {
    // neighbouring prisms divide their common side along the same diagonal: from the lower corner
    // index to the higher one
    std::sort(triangle.begin(), triangle.end());
    const auto& [a, b, c] = triangle;
    add({center, a, b, c});
    for (std::uint32_t shell = 0; shell + 1 < kShells.size(); ++shell) {
      const std::uint32_t low = shell * per_shell;
      const std::uint32_t high = low + per_shell;
      add({low + a, low + b, low + c, high + c});
      add({low + a, low + b, high + b, high + c});
      add({low + a, high + a, high + b, high + c});
    }
  }
  return mesh;
}

physics::TetrahedralMesh block_mesh(std::uint32_t cells) {
  constexpr double kFirst_m = 0.028;  // over the number of cells
  const auto count = static_cast<int>(cells);
  const elastic::Mesh block = elastic::block_mesh(count, count, kFirst_m / count);
  physics::TetrahedralMesh mesh;
  for (const Vector3& node_m : block.nodes_m) {
    mesh.nodes_m.emplace_back(node_m - Vector3(0.05, 0.05, 0.05));
  }
  for (std::size_t e = 0; e < block.element_count(); ++e) {
    const auto corners = block.element(e);
    mesh.tetrahedra.push_back({corners[0], corners[1], corners[2], corners[3]});
  }
  return mesh;
}

}  // namespace palpate
