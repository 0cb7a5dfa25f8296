// SPDX-License-Identifier: Apache-2.0
// An elastic tissue that leans on others.
#include <utility>

#include "physics_node/elastic/contact/plane_contact.h"
#include "physics_node/elastic_tissue/elastic_tissue.h"

namespace palpate::physics {

/// The slow modes are those of a body that leans on nothing.
void ElasticTissue::lean_or_swing(elastic::CondensedContact& contact,
                                  const Vector3& centre_m) const {
  std::vector<elastic::Support> supports =
      elastic::supports_of(simulation_->rigid().pressed(), simulation_->x_m().data());
  supports.insert(supports.end(), leaning_.begin(), leaning_.end());
  if (supports.empty() && ties_.empty()) {
    contact.swing(body_->slow_modes, body_->points, body_->start_m, simulation_->x_m(),
                  simulation_->v_m_per_s(), simulation_->acceleration_m_per_s2());
  } else {
    contact.lean_on(std::move(supports), body_->points, simulation_->x_m(), centre_m, ties_);
  }
}

/// While a tool presses it is known from where the surface would have gone without.
Carried ElasticTissue::carried_now(std::size_t tool, const elastic::CondensedContact& contact,
                                   const Carried& before) const {
  Carried now;
  if (!body_->can_be_carried()) return now;
  now.time_s = solved_s_;
  now.motions = contact.carried();
  const bool is_pressed =
      !is_alone(tool) || !simulation_->touch(tool).force_on_tool_newton.isZero(0.0);
  if (is_pressed) {
    now.way_m = before.at_m(solved_s_);
  } else {
    const elastic::SurfacePoint& at = body_->points[contact.chosen().front()];
    now.way_m = at.position_m(simulation_->x_m().data()) - at.position_m(body_->start_m.data());
  }
  return now;
}

}  // namespace palpate::physics
