// SPDX-License-Identifier: Apache-2.0
// An elastic tissue that blades cut.
#include "physics_node/elastic_tissue/blade/blade_sweep.h"
#include "physics_node/elastic_tissue/elastic_tissue.h"

namespace palpate::physics {

bool ElasticTissue::can_be_cut() const noexcept {
  return gripper_ && gripper_->is_blade() && whole_->pierced.has_value();
}

/// A blade of which nothing is in the body any more.
bool ElasticTissue::is_blade_through(const Tool& own, const GripModel& model) const noexcept {
  return gripper_->is_blade() && own.jaw.holds(model) && !(model.edge.length_m > 0.0);
}

/// The edge is in front of the tip. Where it has left the body, the tip follows through what the
/// edge has cut, and touches nothing until it is out.
bool ElasticTissue::is_leaving(Tool& own) const noexcept {
  if (!own.is_leaving) return false;
  own.is_leaving = own.side.view().distance_m < tip_radius_m_;
  if (own.is_leaving) own.side = {};
  return own.is_leaving;
}

/// Of the edge, until a full solution has found how much of it is in.
EdgeInTissue ElasticTissue::entering() const noexcept {
  const double length_m = gripper_->needle_width_m;
  return {.length_m = length_m, .newton = whole_->pierced->toughness_joule_per_m2 * length_m};
}

/// Before a full solution, on the slow thread.
void ElasticTissue::sweep_blades() {
  if (!can_be_cut()) return;
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    Tool& tool = *tools_[i];
    EdgeInTissue edge;
    sweep_with(tool.held, tips_[i] ? tips_[i]->slip_m : Vector3::Zero(), *gripper_, *whole_, i,
               *ablation_, tool.sweep, edge);
    tool.held.set_edge(edge);
  }
}

}  // namespace palpate::physics
