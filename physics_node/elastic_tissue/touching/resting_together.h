// SPDX-License-Identifier: Apache-2.0
// resting_together.h — where elastic bodies that lie on each other rest, before anything moves.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "physics_node/elastic_tissue/elastic_body.h"

namespace palpate::physics {

/// Of a body that leans on another elastic one.
struct RestAmongOthers {
  elastic::VectorXd x_m;          ///< of all nodes, W
  elastic::RigidContact resting;  ///< how it lies on what does not give way
  bool has_torn = false;          ///< it does not hold what it is tied to
};

/// By body; none: it leans on no other one, or no common rest was found. Each begins at its own
/// start_m. Takes up to seconds.
[[nodiscard]] std::vector<std::optional<RestAmongOthers>> rests_among_others(
    std::span<const std::shared_ptr<const ElasticBody>> bodies);

}  // namespace palpate::physics
