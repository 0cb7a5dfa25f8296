#include "mofc_node/controllers/guard_mofc.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate::controllers {

GuardMofc::GuardMofc(const GuardParameters& parameters)
    : p_(parameters),
      clamp_(parameters.mofc, parameters.per_axis, parameters.v_max_m_per_s),
      ledger_(parameters.mofc, parameters.per_axis, parameters.resolution_m),
      gate_store_joule_(parameters.gate_joule) {}

void GuardMofc::reset() noexcept {
  has_started_ = false;
  gate_store_joule_ = p_.gate_joule;
}

ControlOutput GuardMofc::step(const ControlInput& input) noexcept {
  const double elapsed_s = book(input);
  ledger_.limit(std::max(0.0, input.stored_energy_joule) + p_.credit_cap_joule);
  update_gate(input, elapsed_s);

  // what the force that acts now can still drain before this answer replaces it
  const double energy = ledger_.energy_joule();
  const double spent = p_.delta_max_s * clamp_.drain_watt(acting_force_newton(input));

  // the bound, closed by the gate
  const double gate =
      gate_store_joule_ > 0.0 ? std::min(1.0, gate_store_joule_ / p_.gate_joule) : 0.0;
  ControlOutput output = clamp_.clamp(input.asked_force_on_hand_newton, energy - spent, gate);
  output.ledger_energy_joule = energy;
  output.is_too_fast = is_too_fast_;
  return output;
}

double GuardMofc::book(const ControlInput& input) noexcept {
  is_too_fast_ = false;
  if (!has_started_ || input.has_gap || input.applied.empty()) {
    // nothing is known of the time since: no credit is left
    if (has_started_) {
      ledger_.forfeit(input.hand_position_m);
    } else {
      ledger_.restart(input.hand_position_m);
    }
    has_started_ = true;
    position_m_ = input.hand_position_m;
    asked_newton_.setZero();
    moved_since_fresh_m_.setZero();
    return 0.0;
  }
  double elapsed_s = 0.0;
  double unread_s = 0.0;      // of the stretches whose end nobody read
  double unread_joule = 0.0;  // most that may have been drawn in them
  for (const AppliedStretch& stretch : input.applied) {
    elapsed_s += stretch.duration_s;
    if (!stretch.has_position_at_end || unread_s > 0.0) {
      unread_s += stretch.duration_s;
      unread_joule += stretch.duration_s * clamp_.drain_watt(stretch.force_on_hand_newton);
    }
    if (!stretch.has_position_at_end) continue;
    if (unread_s > 0.0) {
      ledger_.book_unread(unread_joule, stretch.hand_position_at_end_m);
      unread_s = 0.0;
      unread_joule = 0.0;
    } else {
      ledger_.book(stretch.duration_s, stretch.force_on_hand_newton,
                   stretch.hand_position_at_end_m);
    }
  }

  const Vector3 moved = input.hand_position_m - position_m_;
  const double surely_moved_m = moved.norm() - std::numbers::sqrt3 * p_.resolution_m;
  is_too_fast_ = surely_moved_m > p_.v_max_m_per_s * elapsed_s;
  moved_since_fresh_m_ += moved;
  position_m_ = input.hand_position_m;
  return elapsed_s;
}

void GuardMofc::update_gate(const ControlInput& input, double elapsed_s) noexcept {
  const double dissipated = ledger_.dissipated_joule();
  gate_store_joule_ += std::max(0.0, dissipated - dissipated_joule_);
  dissipated_joule_ = dissipated;

  // what holding the force while the hand moved has leaked, booked when the next force is known
  if (input.is_asked_fresh) {
    const double before = asked_newton_.norm();
    const double share =
        before > 0.0 ? std::min(1.0, acting_force_newton(input).norm() / before) : 1.0;
    gate_store_joule_ +=
        0.5 * share * (input.asked_force_on_hand_newton - asked_newton_).dot(moved_since_fresh_m_);
    asked_newton_ = input.asked_force_on_hand_newton;
    moved_since_fresh_m_.setZero();
  }

  gate_store_joule_ +=
      (p_.gate_joule - gate_store_joule_) * (1.0 - std::exp(-elapsed_s / p_.gate_recovery_s));
  gate_store_joule_ = std::clamp(gate_store_joule_, -p_.gate_joule, p_.gate_joule);
}

}  // namespace palpate::controllers
