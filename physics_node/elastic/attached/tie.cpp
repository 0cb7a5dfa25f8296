// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/attached/tie.h"

namespace palpate::elastic {

double Tie::add_gradient(const double* x_m, double* gradient) const noexcept {
  const CohesiveSpring::Pull pull = spring.pull(separation(x_m));
  const Vector3d in_body = point.position_m(x_m) - in_body_m;
  const Vector3d slope_newton = pull.slope_newton - in_body_newton_per_m * in_body;
  for (std::size_t a = 0; a < static_cast<std::size_t>(point.count); ++a) {
    Eigen::Map<Vector3d>(gradient + 3 * std::size_t{point.nodes[a]}) +=
        point.weights[a] * slope_newton;
  }
  return pull.joule - 0.5 * in_body_newton_per_m * in_body.squaredNorm();
}

void Tie::add_stiffness(const double* x_m, const BlockPattern& pattern, BlockValues& values) const {
  const Eigen::Matrix3d more = spring.stiffness(separation(x_m), in_body_newton_per_m);
  if (!more.isZero(0.0)) point.add_stiffness(more, pattern, values);
}

}  // namespace palpate::elastic
