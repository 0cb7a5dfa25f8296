// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <vector>

#include "deploy/scan/organ_mesh.h"
#include "deploy/scan/stuffing.h"
#include "physics_node/elastic/mesh.h"

namespace palpate::scan {
namespace {

using physics::TetrahedralMesh;

constexpr double kWanted_rad = 8.0 * std::numbers::pi / 180.0;
constexpr int kMostRounds = 10;

std::array<std::uint32_t, 3> face_of(const TetrahedralMesh& mesh, std::size_t element,
                                     std::size_t face) {
  std::array<std::uint32_t, 3> nodes{};
  for (std::size_t i = 0; i < 3; ++i) {
    nodes[i] = mesh.tetrahedra[element][static_cast<std::size_t>(elastic::kFaces[face][i])];
  }
  return nodes;
}

Vector3 twice_area(const TetrahedralMesh& mesh, const std::array<std::uint32_t, 3>& face) {
  const Vector3& a = mesh.nodes_m[face[0]];
  return (mesh.nodes_m[face[1]] - a).cross(mesh.nodes_m[face[2]] - a);
}

/// Between two faces of an element; 0 if it is inside out.
double least_angle_rad(const TetrahedralMesh& mesh, std::size_t element) {
  if (!(physics::six_volumes_m3(mesh.nodes_m, mesh.tetrahedra[element]) > 0.0)) return 0.0;
  const std::array<double, 6> angles_rad = face_angles_rad(mesh, element);
  return *std::min_element(angles_rad.begin(), angles_rad.end());
}

class Opener {
 public:
  explicit Opener(TetrahedralMesh& mesh) : mesh_(mesh), elements_of_(mesh.nodes_m.size()) {
    for (std::size_t e = 0; e < mesh.tetrahedra.size(); ++e) {
      for (const std::uint32_t node : mesh.tetrahedra[e]) elements_of_[node].push_back(e);
    }
  }

  /// Moves the node towards the middle of those beside it, one of the surface along the surface.
  /// False: no element there would be better for it.
  bool move(std::uint32_t node) {
    Vector3 sum = Vector3::Zero();
    double count = 0.0;
    for (const std::size_t element : elements_of_[node]) {
      for (const std::uint32_t other : mesh_.tetrahedra[element]) {
        if (other == node) continue;
        sum += mesh_.nodes_m[other];
        count += 1.0;
      }
    }
    const Vector3 from_m = mesh_.nodes_m[node];
    const Vector3 normal = surface_normal(node);
    Vector3 way_m = sum / count - from_m;
    way_m -= normal * normal.dot(way_m);
    const double before_rad = least_around_rad(node);
    for (const double share : {0.6, 0.3, 0.15, 0.07}) {
      mesh_.nodes_m[node] = from_m + share * way_m;
      if (least_around_rad(node) > before_rad) return true;
    }
    mesh_.nodes_m[node] = from_m;
    return false;
  }

 private:
  [[nodiscard]] double least_around_rad(std::uint32_t node) const {
    double least = std::numeric_limits<double>::infinity();
    for (const std::size_t element : elements_of_[node]) {
      least = std::min(least, least_angle_rad(mesh_, element));
    }
    return least;
  }
  /// Of the faces there that belong to one element only; zero: the node is inside.
  [[nodiscard]] Vector3 surface_normal(std::uint32_t node) const {
    Vector3 sum = Vector3::Zero();
    for (const std::size_t element : elements_of_[node]) {
      for (std::size_t k = 0; k < 4; ++k) {
        const std::array<std::uint32_t, 3> face = face_of(mesh_, element, k);
        if (std::find(face.begin(), face.end(), node) == face.end()) continue;
        const auto has_face = [&](std::size_t other) {
          const auto& corners = mesh_.tetrahedra[other];
          return std::all_of(face.begin(), face.end(), [&](std::uint32_t corner) {
            return std::find(corners.begin(), corners.end(), corner) != corners.end();
          });
        };
        const auto& around = elements_of_[node];
        if (std::count_if(around.begin(), around.end(), has_face) == 1) {
          sum += twice_area(mesh_, face);
        }
      }
    }
    return sum.isZero(0.0) ? sum : Vector3(sum.normalized());
  }

  TetrahedralMesh& mesh_;
  std::vector<std::vector<std::size_t>> elements_of_;
};

}  // namespace

void open_slivers(TetrahedralMesh& mesh) {
  Opener opener(mesh);
  for (int round = 0; round < kMostRounds; ++round) {
    bool has_moved = false;
    for (std::size_t e = 0; e < mesh.tetrahedra.size(); ++e) {
      if (least_angle_rad(mesh, e) >= kWanted_rad) continue;
      for (const std::uint32_t node : mesh.tetrahedra[e]) has_moved |= opener.move(node);
    }
    if (!has_moved) return;
  }
}

}  // namespace palpate::scan
