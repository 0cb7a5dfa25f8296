// elastic_problems.h — the bodies that elastic_bench, elastic_stress and elastic_test share.
#pragma once

#include <cmath>
#include <cstdint>
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
