// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/leased_pool.h"

#include <algorithm>
#include <cmath>

namespace palpate::controllers {
namespace {

constexpr double kSpan_s = 1.0;
constexpr int kLeastHoles = 3;
/// Most pauses of a machine are shorter: to last through them is worth more than to begin late.
constexpr double kKeptLease_s = 8e-3;

}  // namespace

void HoleLengths::note(double duration_s, double hold_s) noexcept {
  span_s_ += duration_s;
  if (span_s_ > kSpan_s) {
    spans_ = {Span{}, span_s_ > 2.0 * kSpan_s ? Span{} : spans_[0]};
    span_s_ = 0.0;
  }
  if (duration_s <= hold_s) return;
  spans_[0].longest_s = std::max(spans_[0].longest_s, duration_s);
  ++spans_[0].count;
}

double HoleLengths::longest_s() const noexcept {
  if (spans_[0].count + spans_[1].count < kLeastHoles) return 0.0;
  return std::max(spans_[0].longest_s, spans_[1].longest_s);
}

LeasedPool::Booked LeasedPool::book(const ControlInput& input) noexcept {
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
  const double energy = std::min(ledger_.energy_joule(), input.energy_limit_joule);
  const double acting_s = std::max(0.0, input.acting_lease_s);
  const double acting_watt = clamp_.drain_watt(input.acting_force_on_hand_newton);
  const auto spent_within = [&](double within_s) {
    const double left_s = std::min(acting_s, within_s);
    return left_s > 0.0 ? left_s * acting_watt : 0.0;
  };
  double delta_s = p_.prompt_s > 0.0 ? std::min(p_.prompt_s, p_.delta_max_s) : p_.delta_max_s;
  double spent = spent_within(delta_s);

  // in holes that keep coming no force is worth more than one that lasts to their end
  const double longest_s = std::max(p_.mofc.T, p_.longest_lease_s);
  const double hole_s = p_.bridges_holes && has_ended_unread_ ? holes_.longest_s() : 0.0;
  const double covered_s = hole_s <= longest_s ? std::max(p_.mofc.T, hole_s) : p_.mofc.T;

  ControlOutput output = clamp_.clamp(input.requested_force_on_hand_newton,
                                      (energy - spent) * (p_.mofc.T / covered_s), gate);
  output.ledger_energy_joule = energy;
  output.counted_energy_joule = ledger_.energy_joule();

  // for as long as it is paid, and as late
  const double drain = clamp_.drain_watt(output.force_on_hand_newton);
  const double kept_s = std::max(covered_s, std::min(longest_s, kKeptLease_s));
  const double spare = energy - spent - kept_s * drain;
  if (acting_watt > 0.0) delta_s += std::max(0.0, spare) / acting_watt;
  // beyond the rest of its lease the acting force costs no more
  if (acting_watt == 0.0 || delta_s >= std::min(acting_s, p_.delta_max_s)) delta_s = p_.delta_max_s;
  spent = spent_within(delta_s);
  const double paid_s = drain > 0.0 ? std::max(0.0, energy - spent) / drain : longest_s;
  output.begins_within_s = delta_s;
  // what was kept is paid, but for rounding
  const double least_s = spare > 0.0 ? kept_s : p_.mofc.T;
  output.lease_s = paid_s > least_s ? std::min(paid_s, longest_s) : least_s;
  return output;
}

}  // namespace palpate::controllers
