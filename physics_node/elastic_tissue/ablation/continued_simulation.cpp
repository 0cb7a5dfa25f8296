// SPDX-License-Identifier: Apache-2.0
// An elastic body in motion of which something has vanished: the rest moves on. Or all of it is
// back: it begins anew.
#include <algorithm>

#include "physics_node/elastic_tissue/ablation/ablated_body.h"
#include "physics_node/elastic_tissue/elastic_simulation.h"

namespace palpate::physics {

ElasticSimulation::ElasticSimulation(const ElasticBody& body, const ElasticSimulation& before,
                                     bool is_folded)
    : ElasticSimulation(body, before.touches_.size(), before.tip_radius_m_, before.step_s_,
                        is_folded) {
  failed_steps_ = before.failed_steps_;
  repaired_steps_ = before.repaired_steps_;
  appeared_ = before.appeared_;
  tips_.tearing.count_on(before.tips_.tearing);
}

ElasticSimulation::ElasticSimulation(const ElasticBody& body, const ElasticSimulation& before,
                                     const BodyChange& change, bool is_folded)
    : ElasticSimulation(body, before, is_folded) {
  elastic::VectorXd x_m(body.start_m.size());
  elastic::VectorXd v_m_per_s(body.start_m.size());
  for (std::size_t i = 0; i < change.old_nodes.size(); ++i) {
    const auto to = 3 * static_cast<Eigen::Index>(i);
    const auto from = 3 * Eigen::Index{change.old_nodes[i]};
    x_m.segment<3>(to) = before.x_m().segment<3>(from);
    v_m_per_s.segment<3>(to) = before.v_m_per_s().segment<3>(from);
  }
  dynamics_.set_relaxation(before.relaxation().of(change.old_nodes));
  dynamics_.set_state(x_m, v_m_per_s);
  dynamics_.search().update_rotations(x_m);
  time_s_ = before.time_s_;
  carried_s_ = before.carried_s_;
  if (carried_s_) tips_.rigid.move_to(*carried_s_);
  report_ = before.report_;
  last_tips_ = before.last_tips_;
  failed_in_a_row_ = before.failed_in_a_row_;
  elsewhere_joule_ = before.elsewhere_joule_;
  touches_ = before.touches_;
  tips_.tearing.continue_as(before.tips_.tearing);
  for (std::size_t i = 0; i < touches_.size(); ++i) {
    tips_.contacts[i].continue_as(before.tips_.contacts[i], change.old_points);
    tips_.held[i].continue_as(before.tips_.held[i], body.points, change.old_points);
    const std::vector<elastic::Vector3d>& old = before.touches_[i].forces_on_body_newton;
    if (old.empty()) continue;
    std::vector<elastic::Vector3d>& now = touches_[i].forces_on_body_newton;
    now.assign(body.points.size(), elastic::Vector3d::Zero());
    for (std::size_t p = 0; p < now.size(); ++p) {
      if (change.old_points[p] >= 0) now[p] = old[static_cast<std::size_t>(change.old_points[p])];
    }
  }
}

}  // namespace palpate::physics
