// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/rivals/input_to_state.h"

#include <limits>

namespace palpate::controllers {

ControlOutput InputToState::step(const ControlInput& input) noexcept {
  const Interval interval = interval_.read(input);
  const Vector3& requested = input.requested_force_on_hand_newton;
  since_evaluation_s_ += interval.duration_s;
  if (input.is_request_fresh) {
    lead_newton_.setZero();
    if (has_evaluation_ && since_evaluation_s_ > 0.0) {
      lead_newton_ = tau_s_ / since_evaluation_s_ * (requested - evaluated_newton_);
    }
    evaluated_newton_ = requested;
    since_evaluation_s_ = 0.0;
    has_evaluation_ = true;
  }
  const Vector3 force = requested.isZero(0.0) ? requested : Vector3(requested + lead_newton_);
  return unbounded_output(input, force, std::numeric_limits<double>::quiet_NaN());
}

}  // namespace palpate::controllers
