// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/ports/port_guard.h"

#include <algorithm>
#include <cmath>

namespace palpate::controllers {
namespace {

/// A reading that takes more than so many times v_max is none.
constexpr double kImpossible = 2.0;

/// The request, or none where a part of it is no effort.
PortValues plausible(const PortValues& values, std::size_t count) {
  PortValues taken{};
  for (std::size_t i = 0; i < count; ++i) {
    if (!is_plausible(values[i])) return {};
    taken[i] = values[i];
  }
  return taken;
}

}  // namespace

PortGuardParameters raised_for_one_hold(PortGuardParameters parameters,
                                        const PortValues& peak_effort) {
  const PortClamp clamp(parameters.used(), parameters.times.hold_s);
  const double hold_joule = parameters.times.hold_s * clamp.drain_watt(peak_effort);
  if (hold_joule > parameters.credit_cap_joule) {
    parameters.contact_credit_joule = std::max(parameters.contact_credit_joule, hold_joule);
  }
  parameters.credit_cap_joule = std::max(parameters.credit_cap_joule, 0.25 * hold_joule);
  parameters.gate_joule = std::max(parameters.gate_joule, hold_joule);
  return parameters;
}

PortGuard::PortGuard(const PortGuardParameters& parameters)
    : credit_cap_joule_(parameters.credit_cap_joule),
      contact_credit_joule_(parameters.contact_credit_joule),
      pool_(parameters.used(), parameters.times),
      gate_(parameters.gate_joule, parameters.gate_recovery_s) {}

void PortGuard::reset() noexcept {
  pool_.reset();
  gate_.open();
  has_begun_ = false;
  contact_work_joule_ = 0.0;
  moved_since_fresh_ = {};
  requested_ = {};
}

PortOutput PortGuard::step(const PortInput& reported) noexcept {
  const std::size_t count = pool_.clamp().count();
  const Motion motion = follow(reported);
  PortInput input = reported;
  input.has_gap = input.has_gap || motion.is_impossible;
  const auto [elapsed_s, work_joule] = pool_.book(input);
  note_motion(input, motion, elapsed_s);
  const PortValues requested = plausible(input.requested_effort_on_hand, count);

  // the cap, the gate
  const bool is_requested = requested != PortValues{};
  contact_work_joule_ = is_requested ? contact_work_joule_ + work_joule : 0.0;
  pool_.limit(credit_cap_joule_ + std::max({0.0, input.stored_energy_joule,
                                            std::min(contact_work_joule_, contact_credit_joule_)}));
  update_gate(input, requested, elapsed_s);

  // the bound, closed by the gate
  PortOutput output = pool_.grant(input, requested, gate_.gate());
  for (std::size_t i = 0; i < count; ++i) {
    // true for NaN
    output.is_clamped =
        output.is_clamped || output.effort_on_hand[i] != input.requested_effort_on_hand[i];
  }
  output.is_too_fast = motion.is_too_fast;
  return output;
}

/// How the hand moved from reading to reading; of a gap that is not known. A reading that no hand
/// explains is found where it comes: two of them may cancel.
PortGuard::Motion PortGuard::follow(const PortInput& input) const noexcept {
  Motion motion;
  if (!has_begun_ || input.has_gap) return motion;
  const std::size_t count = pool_.clamp().count();
  PortValues from = position_;
  PortValues doubt{};
  double since_s = 0.0;
  double elapsed_s = 0.0;
  const auto moves_to = [&](const PortValues& to) {
    for (std::size_t i = 0; i < count; ++i) {
      const Port& port = pool_.clamp().port(i);
      const double surely = std::abs(to[i] - from[i]) - port.q - doubt[i];
      motion.is_impossible = motion.is_impossible || surely > kImpossible * port.v_max * since_s;
    }
    from = to;
    doubt = {};
    since_s = 0.0;
  };
  for (const PortStretch& stretch : input.applied) {
    since_s += stretch.duration_s;
    elapsed_s += stretch.duration_s;
    for (std::size_t i = 0; i < count; ++i) doubt[i] += stretch.doubt[i];
    if (stretch.has_position_at_end) moves_to(stretch.position_at_end);
  }
  moves_to(input.position);
  for (std::size_t i = 0; i < count; ++i) {
    const Port& port = pool_.clamp().port(i);
    const double moved = elapsed_s > 0.0 ? input.position[i] - position_[i] : 0.0;
    const double surely = std::abs(moved) - port.q;
    const double most = port.v_max * elapsed_s;
    motion.is_too_fast = motion.is_too_fast || motion.is_impossible || surely > most;
    motion.is_impossible = motion.is_impossible || surely > kImpossible * most;
  }
  return motion;
}

void PortGuard::note_motion(const PortInput& input, const Motion& motion,
                            double elapsed_s) noexcept {
  if (input.has_gap || motion.is_impossible) {
    requested_ = {};
    moved_since_fresh_ = {};
  } else if (elapsed_s > 0.0) {
    for (std::size_t i = 0; i < pool_.clamp().count(); ++i) {
      moved_since_fresh_[i] += input.position[i] - position_[i];
    }
  }
  position_ = input.position;
  has_begun_ = true;
}

void PortGuard::update_gate(const PortInput& input, const PortValues& requested,
                            double elapsed_s) noexcept {
  gate_.dissipated(pool_.dissipated_joule());

  // what holding the effort while the hand moved has leaked, booked when the next one is known
  if (input.is_request_fresh) {
    const double before = pool_.clamp().most_watt(requested_);
    const double share =
        before > 0.0 ? std::min(1.0, pool_.clamp().most_watt(input.acting_effort_on_hand) / before)
                     : 1.0;
    double leak_joule = 0.0;
    for (std::size_t i = 0; i < pool_.clamp().count(); ++i) {
      leak_joule += (requested[i] - requested_[i]) * moved_since_fresh_[i];
    }
    gate_.held(0.5 * share * leak_joule);
    requested_ = requested;
    moved_since_fresh_ = {};
  }
  gate_.recover(elapsed_s);
}

}  // namespace palpate::controllers
