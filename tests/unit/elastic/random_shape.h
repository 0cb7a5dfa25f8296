// SPDX-License-Identifier: Apache-2.0
// random_shape.h — deformed bodies for tests.
#pragma once

#include <random>

#include "physics_node/elastic/body.h"

namespace palpate::elastic {

/// Every free node moved by up to `most_m` along each axis.
inline VectorXd random_shape(const Body& body, double most_m, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> anywhere(-most_m, most_m);
  VectorXd x = body.rest_m();
  for (const std::uint32_t node : body.pattern().nodes) {
    for (Eigen::Index k = 0; k < 3; ++k) x[3 * Eigen::Index{node} + k] += anywhere(random);
  }
  return x;
}

inline constexpr Law kAllLaws[] = {Law::kCorotational, Law::kStVenantKirchhoff,
                                   Law::kStableNeoHookean};

}  // namespace palpate::elastic
