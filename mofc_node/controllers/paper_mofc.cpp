// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/paper_mofc.h"

namespace palpate::controllers {

void PaperMofc::reset() noexcept {
  energy_joule_.setZero();
  has_position_ = false;
}

ControlOutput PaperMofc::step(const ControlInput& input) noexcept {
  // the energy of what acted since the last step: (8)–(11) with the echoed force and measured time
  if (has_position_) {
    bool is_known = !input.has_gap;
    for (const AppliedStretch& stretch : input.applied) {
      is_known = is_known && stretch.has_position_at_end;
      if (!is_known) break;
      const Vector3 d = stretch.hand_position_at_end_m - position_m_;
      const Vector3 f_s = -stretch.force_on_hand_newton;
      for (int axis = 0; axis < 3; ++axis) {
        energy_joule_[axis] += interval_energy_joule(friction_.f_d[axis], friction_.f_co[axis],
                                                     stretch.duration_s, d[axis], f_s[axis]);
      }
      position_m_ = stretch.hand_position_at_end_m;
    }
    // not known: no credit from before
    if (!is_known) energy_joule_ = energy_joule_.cwiseMin(0.0);
  }
  position_m_ = input.hand_position_m;
  has_position_ = true;

  // the bound (13) and the output (14), axis by axis
  ControlOutput output;
  for (int axis = 0; axis < 3; ++axis) {
    const double f_max = maximum_force_newton(friction_.on_axis(axis, T_), energy_joule_[axis]);
    const double requested = input.requested_force_on_hand_newton[axis];
    output.f_max_newton[axis] = f_max;
    output.force_on_hand_newton[axis] = output_force_newton(requested, f_max);
    output.is_clamped = output.is_clamped || std::abs(requested) > f_max;
  }
  output.ledger_energy_joule = energy_joule_.sum();
  return output;
}

}  // namespace palpate::controllers
