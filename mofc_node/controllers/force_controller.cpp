#include "mofc_node/controllers/force_controller.h"

#include <limits>

namespace palpate::controllers {

ControlOutput PassThrough::step(const ControlInput& input) noexcept {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  return {.force_on_hand_newton = input.asked_force_on_hand_newton,
          .f_max_newton = Vector3::Constant(kNone),
          .ledger_energy_joule = kNone,
          .is_clamped = false};
}

}  // namespace palpate::controllers
