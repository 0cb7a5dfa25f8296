// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/verdict/remedies.h"

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <utility>

#include "common/telemetry/verdict/causes.h"

namespace palpate {

std::string path_remedy(const RunFacts& facts) {
  return fmt::format("the recorded path {} at {:.3f} s: smooth it there",
                     std::isfinite(facts.path_m_per_s)
                         ? fmt::format("moves at {:.3g} m/s", facts.path_m_per_s)
                         : std::string("jumps from its end to its beginning"),
                     facts.path_at_s);
}

std::string disagreement_remedy(const RunFacts& facts) {
  const double friction = facts.device.checked_friction_ratio;
  if (!facts.is_limited) {
    return "the controller `" + facts.controller +
           "` does not limit itself; use mofc, or mofc.safety_net=true";
  }
  if (friction > 0.0 && friction < 1.0) {
    return fmt::format("the device has {} of the friction of its profile: `palpate identify`",
                       percent(friction));
  }
  return "the clamp and the device disagree: check device.profile (`palpate identify`)";
}

std::string nodes_left_out(const RunFacts& facts) {
  std::string nodes;
  for (const auto& [name, node] : {std::pair{"device_node", &facts.device_node},
                                   {"mofc_node", &facts.mofc_node},
                                   {"physics_node", &facts.physics_node}}) {
    if (!node->is_recorded) nodes += (nodes.empty() ? "" : ", ") + std::string(name);
  }
  return nodes;
}

}  // namespace palpate
