// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/leased_pool.h"

#include <algorithm>
#include <cmath>

namespace palpate::controllers {

Booked LeasedPool::book(const ControlInput& input) noexcept {
  if (!has_started_) {
    has_started_ = true;
    ledger_.restart(input.hand_position_m);
    return {};
  }
  if (input.has_gap) {
    ledger_.forfeit(input.hand_position_m);
    return {};
  }
  Booked booked;
  for (std::size_t i = 0; i < input.applied.size();) {
    const AppliedStretch& stretch = input.applied[i];
    if (!stretch.has_position_at_end) {
      double unread_s = 0.0;
      for (const std::size_t end = book_unread(input, i); i < end; ++i) {
        booked.elapsed_s += input.applied[i].duration_s;
        unread_s += input.applied[i].duration_s;
      }
      holes_.note(unread_s, p_.mofc.T);
      continue;
    }
    booked.elapsed_s += stretch.duration_s;
    holes_.note(stretch.duration_s, p_.mofc.T);
    booked.work_joule -= stretch.force_on_hand_newton.dot(stretch.hand_position_at_end_m -
                                                          ledger_.hand_position_m());
    ledger_.book(stretch.duration_s, stretch.force_on_hand_newton, stretch.hand_position_at_end_m);
    ++i;
  }
  return booked;
}

/// Books the stretches from `first`, whose end was not read, up to the next reading: at the latest
/// x(k), where the echo ends.
/// @return the first one that is left
std::size_t LeasedPool::book_unread(const ControlInput& input, std::size_t first) noexcept {
  Release release{.force_on_hand_newton = input.applied[first].force_on_hand_newton,
                  .acted_s = input.applied[first].duration_s,
                  .hand_position_at_end_m = input.hand_position_m,
                  .v_max_m_per_s = p_.v_max_m_per_s};
  has_ended_unread_ = has_ended_unread_ || !release.force_on_hand_newton.isZero(0.0);
  bool is_release = true;  // one force, then none
  std::size_t i = first;
  for (bool is_read = false; !is_read && i < input.applied.size(); ++i) {
    const AppliedStretch& stretch = input.applied[i];
    release.duration_s += stretch.duration_s;
    release.most_drawn_joule +=
        stretch.duration_s * clamp_.drain_watt(stretch.force_on_hand_newton);
    is_release = is_release && (i == first || stretch.force_on_hand_newton.isZero(0.0));
    is_read = stretch.has_position_at_end;
    if (is_read) release.hand_position_at_end_m = stretch.hand_position_at_end_m;
  }
  if (!std::isfinite(release.most_drawn_joule)) {
    ledger_.forfeit(release.hand_position_at_end_m);
  } else if (is_release && std::isfinite(p_.v_max_m_per_s)) {
    ledger_.book_release(release);
  } else {
    ledger_.book_unread(release.most_drawn_joule, release.hand_position_at_end_m);
  }
  return i;
}

ControlOutput LeasedPool::grant(const ControlInput& input, double gate) const noexcept {
  // what the force that acts now can still drain before this answer replaces it
  const LeaseRule::Reserve reserve =
      rule_.reserve(std::min(ledger_.energy_joule(), input.energy_limit_joule),
                    input.acting_lease_s, clamp_.drain_watt(input.acting_force_on_hand_newton),
                    p_.bridges_holes && has_ended_unread_ ? holes_.longest_s() : 0.0);
  ControlOutput output =
      clamp_.clamp(input.requested_force_on_hand_newton, rule_.credit_joule(reserve), gate);
  output.ledger_energy_joule = reserve.energy_joule;
  output.counted_energy_joule = ledger_.energy_joule();
  const LeaseRule::Lease lease =
      rule_.lease(reserve, clamp_.drain_watt(output.force_on_hand_newton));
  output.begins_within_s = lease.begins_within_s;
  output.lease_s = lease.lease_s;
  return output;
}

}  // namespace palpate::controllers
