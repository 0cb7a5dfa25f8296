// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/force_controller.h"

#include <limits>

namespace palpate::controllers {

ControlOutput PassThrough::step(const ControlInput& input) noexcept {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  return {.force_on_hand_newton = input.requested_force_on_hand_newton,
          .f_max_newton = Vector3::Constant(kNone),
          .ledger_energy_joule = kNone,
          .is_clamped = false};
}

ControlOutput output_within(const Vector3& requested_force_on_hand_newton,
                            double f_max_newton) noexcept {
  const double requested = requested_force_on_hand_newton.norm();
  ControlOutput output;
  output.f_max_newton = Vector3::Constant(f_max_newton);
  output.is_clamped = requested > f_max_newton;
  output.force_on_hand_newton =
      output.is_clamped ? Vector3(requested_force_on_hand_newton * (f_max_newton / requested))
                        : requested_force_on_hand_newton;
  return output;
}

}  // namespace palpate::controllers
