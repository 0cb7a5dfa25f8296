#include "mofc_node/controllers/vector_mofc.h"

namespace palpate::controllers {

void VectorMofc::reset() noexcept { has_started_ = false; }

ControlOutput VectorMofc::step(const ControlInput& input) noexcept {
  // book what acted since the last step, or start again where that is not known
  bool is_known = has_started_ && !input.has_gap && !input.applied.empty();
  for (const AppliedStretch& stretch : input.applied) {
    is_known = is_known && stretch.has_position_at_end;
  }
  if (is_known) {
    for (const AppliedStretch& stretch : input.applied) {
      ledger_.book(stretch.duration_s, stretch.force_on_hand_newton,
                   stretch.hand_position_at_end_m);
    }
  } else {
    ledger_.restart(input.hand_position_m);
    has_started_ = true;
  }

  // what the force that acts now can still drain before this answer replaces it
  const double energy = ledger_.energy_joule();
  const double spent =
      delta_max_s_ > 0.0 ? delta_max_s_ * clamp_.drain_watt(acting_force_newton(input)) : 0.0;

  // the bound (13) and the output (14)
  ControlOutput output = clamp_.clamp(input.asked_force_on_hand_newton, energy - spent);
  output.ledger_energy_joule = energy;
  return output;
}

}  // namespace palpate::controllers
