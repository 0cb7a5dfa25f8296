// SPDX-License-Identifier: Apache-2.0
// solve_speed.h — how often this machine can solve an elastic body while a hand presses on it.
#pragma once

#include <cstddef>
#include <string>

#include "physics_node/elastic_tissue/elastic_body.h"

namespace palpate {

struct SolveSpeed {
  double solution_s = 0.0;   ///< of one full solution, processor time
  double rate_hz = 25.0;     ///< 50, 25, 10 or 5: at most half of one processor
  bool is_too_slow = false;  ///< even at 5 Hz it takes more than that
};

/// Bodies of more nodes are not timed: a solution of them takes seconds. 10,000 quadratic elements
/// have as many, and 80,000 linear ones.
inline constexpr std::size_t kMostTimedNodes = 16'000;

/// The mean of some full solutions under a tip that goes in at the origin of W, along −z.
[[nodiscard]] SolveSpeed solve_speed_of(const physics::ElasticBody& body, double tip_radius_m,
                                        double depth_m);

/// Lines of a report, with a warning and a remedy where it is too slow.
[[nodiscard]] std::string speed_report(const SolveSpeed& speed, std::size_t tetrahedra);

}  // namespace palpate
