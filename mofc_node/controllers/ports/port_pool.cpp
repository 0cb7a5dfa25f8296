// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/ports/port_pool.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::controllers {
namespace {

using detail::kRounding;
using detail::less_rounding;

EnergyCount<1>::Vector scalar(double value) { return EnergyCount<1>::Vector::Constant(value); }

bool is_zero(const PortValues& values, std::size_t count) {
  return std::all_of(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(count),
                     [](double value) { return value == 0.0; });
}

}  // namespace

// --- ledger -------------------------------------------------------------------------------------

PortLedger::PortLedger(std::span<const Port> ports) : count_(std::min(ports.size(), kMostPorts)) {
  std::copy_n(ports.begin(), count_, ports_.begin());
  for (std::size_t i = 0; i < count_; ++i) {
    const Port& port = ports_[i];
    counts_[i] = Count(port.f_d, port.f_co, port.q, port.q);
  }
}

void PortLedger::restart(const PortValues& position) noexcept {
  carried_joule_ = 0.0;
  position_ = position;
  for (std::size_t i = 0; i < count_; ++i) counts_[i].restart(scalar(position[i]));
}

void PortLedger::book(const PortStretch& stretch) noexcept {
  const double doubt = doubt_joule(stretch);
  if (!std::isfinite(doubt)) return forfeit(stretch.position_at_end);
  position_ = stretch.position_at_end;
  for (std::size_t i = 0; i < count_; ++i) {
    counts_[i].book(stretch.duration_s, scalar(-stretch.effort_on_hand[i]), scalar(position_[i]));
  }
  if (doubt > 0.0) carried_joule_ = less_rounding(carried_joule_, doubt);
}

double PortLedger::doubt_joule(const PortStretch& stretch) const noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < count_; ++i) {
    const double doubt = stretch.doubt[i];
    if (!(doubt > 0.0)) continue;
    const Port& port = ports_[i];
    if (!(stretch.duration_s > 0.0)) return std::numeric_limits<double>::infinity();
    sum += (std::abs(stretch.effort_on_hand[i]) + port.f_co +
            port.f_d * (2.0 * port.v_max + doubt / stretch.duration_s)) *
           doubt;
  }
  return sum * (1.0 + kRounding);
}

/// Lower bound of the energy of a release on one port, h·Δx apart. Symbols as in docs/theory.md
/// §2.5, where one axis has c = q/2 and w = q.
double PortLedger::release_joule(std::size_t i, const Release& release) const noexcept {
  const Port& port = ports_[i];
  const double newton = std::abs(release.effort_on_hand[i]);
  if (newton == 0.0) return 0.0;
  const double moved = release.position_at_end[i] - position_[i];
  const double along = std::copysign(1.0, release.effort_on_hand[i]) * moved;
  const double c = 0.5 * port.q;
  const double b = std::min(port.v_max * release.acted_s,
                            along + port.v_max * (release.duration_s - release.acted_s));
  double energy = -newton * (b + c);
  if (newton >= 2.0 * port.f_co) {
    energy += port.f_co * std::max(0.0, 2.0 * b - along - std::abs(moved) - port.q);
  }
  return energy - kRounding * newton * (c + std::abs(moved) + port.v_max * release.duration_s);
}

void PortLedger::book_release(const Release& release) noexcept {
  const double before = energy_joule();
  double energy = 0.0;
  double magnitude = 0.0;
  for (std::size_t i = 0; i < count_; ++i) {
    const double joule = release_joule(i, release);
    energy += joule;
    magnitude += std::abs(joule);
    counts_[i].book_release(release.duration_s, scalar(-release.effort_on_hand[i]),
                            scalar(release.position_at_end[i]));
  }
  position_ = release.position_at_end;
  carried_joule_ = less_rounding(carried_joule_, kRounding * magnitude - energy);
  const double least = less_rounding(before, release.most_drawn_joule);
  if (energy_joule() < least) {
    restart(position_);
    carried_joule_ = least;
  }
}

void PortLedger::book_unread(double most_drawn_joule, const PortValues& position_at_end) noexcept {
  const double before = energy_joule();
  restart(position_at_end);
  carried_joule_ = less_rounding(before, most_drawn_joule);
}

void PortLedger::forfeit(const PortValues& position) noexcept {
  const double before = energy_joule();
  restart(position);
  carried_joule_ = std::min(before, 0.0);
}

void PortLedger::limit(double joule) noexcept {
  carried_joule_ -= std::max(0.0, energy_joule() - joule);
}

double PortLedger::energy_joule() const noexcept {
  double sum = carried_joule_;
  double magnitude = std::abs(carried_joule_);
  for (std::size_t i = 0; i < count_; ++i) {
    const double energy = counts_[i].energy_joule();
    sum += energy;
    magnitude += std::abs(energy);
  }
  // each addition rounds
  return sum - 2.0 * kRounding * magnitude;
}

double PortLedger::dissipated_joule() const noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < count_; ++i) sum += counts_[i].dissipated_joule();
  return sum;
}

// --- pool ---------------------------------------------------------------------------------------

Booked PortPool::book(const PortInput& input) noexcept {
  if (!has_started_) {
    has_started_ = true;
    ledger_.restart(input.position);
    return {};
  }
  if (input.has_gap) {
    ledger_.forfeit(input.position);
    return {};
  }
  Booked booked;
  for (std::size_t i = 0; i < input.applied.size();) {
    const PortStretch& stretch = input.applied[i];
    if (!stretch.has_position_at_end) {
      double unread_s = 0.0;
      for (const std::size_t end = book_unread(input, i); i < end; ++i) {
        unread_s += input.applied[i].duration_s;
      }
      booked.elapsed_s += unread_s;
      holes_.note(unread_s, hold_s_);
      continue;
    }
    booked.elapsed_s += stretch.duration_s;
    holes_.note(stretch.duration_s, hold_s_);
    for (std::size_t p = 0; p < clamp_.count(); ++p) {
      booked.work_joule -=
          stretch.effort_on_hand[p] * (stretch.position_at_end[p] - ledger_.position()[p]);
    }
    ledger_.book(stretch);
    ++i;
  }
  return booked;
}

/// Books the stretches from `first`, whose end was not read, up to the next reading: at the latest
/// x(k), where the echo ends.
/// @return the first one that is left
std::size_t PortPool::book_unread(const PortInput& input, std::size_t first) noexcept {
  PortLedger::Release release{.effort_on_hand = input.applied[first].effort_on_hand,
                              .acted_s = input.applied[first].duration_s,
                              .position_at_end = input.position};
  has_ended_unread_ = has_ended_unread_ || !is_zero(release.effort_on_hand, clamp_.count());
  bool is_release = true;  // one effort, then none
  std::size_t i = first;
  for (bool is_read = false; !is_read && i < input.applied.size(); ++i) {
    const PortStretch& stretch = input.applied[i];
    release.duration_s += stretch.duration_s;
    release.most_drawn_joule += stretch.duration_s * clamp_.drain_watt(stretch.effort_on_hand);
    is_release = is_release && is_zero(stretch.doubt, clamp_.count()) &&
                 (i == first || is_zero(stretch.effort_on_hand, clamp_.count()));
    is_read = stretch.has_position_at_end;
    if (is_read) release.position_at_end = stretch.position_at_end;
  }
  if (is_release) {
    ledger_.book_release(release);
  } else {
    ledger_.book_unread(release.most_drawn_joule, release.position_at_end);
  }
  return i;
}

PortOutput PortPool::grant(const PortInput& input, const PortValues& requested,
                           double gate) const noexcept {
  const LeaseRule::Reserve reserve = rule_.reserve(
      std::min(ledger_.energy_joule(), input.energy_limit_joule), input.acting_lease_s,
      clamp_.drain_watt(input.acting_effort_on_hand), has_ended_unread_ ? holes_.longest_s() : 0.0);
  const double credit_joule = rule_.credit_joule(reserve);
  PortOutput output;
  output.effort_on_hand = clamp_.clamp(requested, credit_joule, gate);
  output.most_effort = clamp_.most_effort(credit_joule, gate);
  output.ledger_energy_joule = reserve.energy_joule;
  output.counted_energy_joule = ledger_.energy_joule();
  const LeaseRule::Lease lease = rule_.lease(reserve, clamp_.drain_watt(output.effort_on_hand));
  output.lease_s = lease.lease_s;
  output.begins_within_s = lease.begins_within_s;
  return output;
}

}  // namespace palpate::controllers
