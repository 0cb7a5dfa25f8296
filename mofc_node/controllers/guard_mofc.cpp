// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/guard_mofc.h"

#include <algorithm>
#include <numbers>

namespace palpate::controllers {

GuardMofc::GuardMofc(const GuardParameters& parameters)
    : p_(parameters),
      pool_({.mofc = parameters.mofc,
             .per_axis = parameters.per_axis,
             .resolution_m = parameters.resolution_m,
             .delta_max_s = parameters.delta_max_s,
             .prompt_s = parameters.prompt_s,
             .longest_lease_s = parameters.longest_lease_s,
             .v_max_m_per_s = parameters.v_max_m_per_s,
             .bridges_holes = true}),
      gate_(parameters.gate_joule, parameters.gate_recovery_s) {}

void GuardMofc::reset() noexcept {
  pool_.reset();
  gate_.open();
  contact_work_joule_ = 0.0;
  moved_since_fresh_m_.setZero();
  requested_newton_.setZero();
}

ControlOutput GuardMofc::step(const ControlInput& input) noexcept {
  const auto [elapsed_s, work_joule] = pool_.book(input);

  // how the hand moved; after a gap that is not known
  const Vector3 moved =
      elapsed_s > 0.0 ? Vector3(input.hand_position_m - position_m_) : Vector3(Vector3::Zero());
  position_m_ = input.hand_position_m;
  moved_since_fresh_m_ += moved;
  if (input.has_gap) {
    requested_newton_.setZero();
    moved_since_fresh_m_.setZero();
  }
  const double surely_moved_m = moved.norm() - std::numbers::sqrt3 * p_.resolution_m;
  const bool is_too_fast = surely_moved_m > p_.v_max_m_per_s * elapsed_s;

  // the cap, the gate
  const bool is_requested = !input.requested_force_on_hand_newton.isZero(0.0);
  contact_work_joule_ = is_requested ? contact_work_joule_ + work_joule : 0.0;
  pool_.limit(p_.credit_cap_joule +
              std::max({0.0, input.stored_energy_joule,
                        std::min(contact_work_joule_, p_.contact_credit_joule)}));
  update_gate(input, elapsed_s);

  // the bound, closed by the gate
  ControlOutput output = pool_.grant(input, gate_.gate());
  output.is_too_fast = is_too_fast;
  return output;
}

void GuardMofc::update_gate(const ControlInput& input, double elapsed_s) noexcept {
  gate_.dissipated(pool_.dissipated_joule());

  // what holding the force while the hand moved has leaked, booked when the next force is known
  if (input.is_request_fresh) {
    const double before = requested_newton_.norm();
    const double share =
        before > 0.0 ? std::min(1.0, input.acting_force_on_hand_newton.norm() / before) : 1.0;
    gate_.held(
        0.5 * share *
        (input.requested_force_on_hand_newton - requested_newton_).dot(moved_since_fresh_m_));
    requested_newton_ = input.requested_force_on_hand_newton;
    moved_since_fresh_m_.setZero();
  }

  gate_.recover(elapsed_s);
}

}  // namespace palpate::controllers
