// SPDX-License-Identifier: Apache-2.0
// What viewers see of an elastic body besides its shape.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "physics_node/elastic_tissue/elastic_simulation.h"

namespace palpate::physics {

void ElasticSimulation::shown_strain(std::vector<float>& strain) const {
  const elastic::Mesh& mesh = body_.body->mesh();
  const elastic::VectorXd& x = dynamics_.x_m();
  std::vector<double> sum(mesh.nodes_m.size(), 0.0);
  std::vector<double> weight(mesh.nodes_m.size(), 0.0);
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    const auto nodes = mesh.element(e);
    Eigen::Matrix3d rest;
    Eigen::Matrix3d now;
    for (Eigen::Index k = 0; k < 3; ++k) {
      const std::uint32_t corner = nodes[static_cast<std::size_t>(k) + 1];
      rest.col(k) = mesh.nodes_m[corner] - mesh.nodes_m[nodes[0]];
      now.col(k) =
          x.segment<3>(3 * Eigen::Index{corner}) - x.segment<3>(3 * Eigen::Index{nodes[0]});
    }
    const Eigen::Matrix3d F = now * rest.inverse();
    Eigen::Matrix3d E = 0.5 * (F.transpose() * F - Eigen::Matrix3d::Identity());
    E.diagonal().array() -= E.trace() / 3.0;
    const double equivalent = std::sqrt(2.0 / 3.0 * E.squaredNorm());
    const double volume = rest.determinant();
    for (const std::uint32_t node : nodes) {
      sum[node] += volume * equivalent;
      weight[node] += volume;
    }
  }
  strain.clear();
  for (const std::uint32_t node : body_.shown_nodes) {
    const double mean = sum[node] / weight[node];
    strain.push_back(std::isfinite(mean) ? static_cast<float>(std::min(mean, 1e6)) : 0.0F);
  }
}

}  // namespace palpate::physics
