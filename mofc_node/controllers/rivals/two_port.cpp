// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/rivals/two_port.h"

#include <algorithm>

namespace palpate::controllers {

ControlOutput TwoPort::step(const ControlInput& input) noexcept {
  const Interval interval = interval_.read(input);
  const Vector3& requested = input.requested_force_on_hand_newton;
  hand_.add(interval.work_joule);
  if (input.is_request_fresh) {
    if (has_evaluation_) {
      physics_.add(-0.5 *
                   (requested + evaluated_newton_).dot(input.evaluated_at_m - evaluated_at_m_));
    }
    evaluated_at_m_ = input.evaluated_at_m;
    evaluated_newton_ = requested;
    has_evaluation_ = true;
  }
  const double lost_joule =
      std::max(0.0, physics_.towards_physics_joule - hand_.towards_physics_joule);
  const double missing_joule = physics_.towards_hand_joule - lost_joule - hand_.towards_hand_joule;
  return unbounded_output(input,
                          inject_damping(requested, interval.velocity_m_per_s(), missing_joule, p_)
                              .force_on_hand_newton,
                          missing_joule);
}

}  // namespace palpate::controllers
