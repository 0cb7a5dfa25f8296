// SPDX-License-Identifier: Apache-2.0
// bullet_rows.h — the beam of elastic_bench computed by Bullet, where libbullet-dev is installed:
// the same mesh, masses and material, float, no damping but that of backward Euler.
#pragma once

#include <span>
#include <vector>

#include "physics_node/elastic/body.h"
#include "tests/bench/elastic/elastic_rows.h"

namespace palpate::bench {

/// The beam is let go; steps of 1 ms, as many as `converged_m` has: z of the tip [m] after each, of
/// the same body with every step converged.
[[nodiscard]] Row bullet_step_row(const BeamSize& size, const elastic::Body& body,
                                  std::span<const double> converged_m);

/// The beam gets its weight at once; steps of 20 ms until the tip stays within 1 % of where it
/// ends.
/// @param reference_m  how far it sags in truth
[[nodiscard]] Row bullet_static_row(const BeamSize& size, const elastic::Body& body,
                                    double reference_m);

}  // namespace palpate::bench
