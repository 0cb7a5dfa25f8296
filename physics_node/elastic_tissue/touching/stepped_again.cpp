// SPDX-License-Identifier: Apache-2.0
// A step of an elastic body that is made once more, because what it touches has moved.
#include "physics_node/elastic_tissue/elastic_simulation.h"

namespace palpate::physics {

void ElasticSimulation::step_again() {
  if (!can_step_again_) return;
  const elastic::VectorXd x_m = dynamics_.x_m();
  const elastic::VectorXd v_m_per_s = dynamics_.v_m_per_s();
  const elastic::Relaxation relaxation = dynamics_.relaxation();
  const elastic::RigidContact rigid = tips_.rigid;
  const std::vector<Touch> touches = touches_;
  const std::vector<elastic::SphereContact> contacts = tips_.contacts;
  const elastic::StepReport report = report_;
  if (step_once(true)) return;
  // as it was
  can_step_again_ = false;
  set_body(x_m, relaxation);
  dynamics_.set_state(x_m, v_m_per_s);
  tips_.rigid = rigid;
  touches_ = touches;
  tips_.contacts = contacts;
  report_ = report;
}

}  // namespace palpate::physics
