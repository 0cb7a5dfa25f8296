// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/ports/port_clamp.h"

#include <algorithm>
#include <cmath>

#include "mofc_equations.h"

namespace palpate::controllers {
namespace {

MofcParameters friction_of(const Port& port, double hold_s) {
  return {.f_d = port.f_d, .f_co = port.f_co, .T = hold_s};
}

/// A step of the search that moves the scale by less of it is the last one.
constexpr double kScaleTolerance = 1e-10;

}  // namespace

PortClamp::PortClamp(std::span<const Port> ports, double hold_s)
    : count_(std::min(ports.size(), kMostPorts)), hold_s_(hold_s) {
  std::copy_n(ports.begin(), count_, ports_.begin());
  // how many different priorities are lower
  std::array<int, kMostPorts> sorted{};
  for (std::size_t i = 0; i < count_; ++i) sorted[i] = ports_[i].priority;
  const auto end = sorted.begin() + static_cast<std::ptrdiff_t>(count_);
  std::sort(sorted.begin(), end);
  const auto unique_end = std::unique(sorted.begin(), end);
  for (std::size_t i = 0; i < count_; ++i) {
    const auto at = std::lower_bound(sorted.begin(), unique_end, ports_[i].priority);
    rank_[i] = static_cast<std::size_t>(at - sorted.begin());
  }
  ranks_ = static_cast<std::size_t>(unique_end - sorted.begin());
}

double PortClamp::drain_watt(const PortValues& effort) const noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < count_; ++i) {
    sum += controllers::drain_watt(friction_of(ports_[i], hold_s_), std::abs(effort[i]),
                                   ports_[i].v_max);
  }
  return sum;
}

double PortClamp::most_watt(const PortValues& effort) const noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < count_; ++i) sum += std::abs(effort[i]) * ports_[i].v_max;
  return sum;
}

PortValues PortClamp::clamp(const PortValues& requested, double energy_joule,
                            double gate) const noexcept {
  const double energy = std::max(0.0, energy_joule);
  std::array<double, kMostPorts> full_watt{};
  double rest_watt = 0.0;  // of what is not reduced yet
  for (std::size_t rank = 0; rank < ranks_; ++rank) {
    full_watt[rank] = drain_of(rank, requested, 1.0).watt;
    rest_watt += full_watt[rank];
  }
  std::array<double, kMostPorts> scale{};
  scale.fill(1.0);
  for (std::size_t rank = 0; rank < ranks_; ++rank) {
    const bool is_covered = hold_s_ * rest_watt <= energy;
    if (is_covered && gate >= 1.0) break;
    const double absorbed = absorbed_scale(rank, requested);
    double paid = 1.0;
    if (!is_covered) {
      // once this rank can pay for itself, the higher ones are covered and stay what they are
      rest_watt = 0.0;
      for (std::size_t i = rank + 1; i < ranks_; ++i) rest_watt += full_watt[i];
      paid = paid_scale(rank, requested, absorbed, rest_watt, energy);
    }
    scale[rank] = std::min(1.0, absorbed + gate * (paid - absorbed));
  }
  PortValues effort{};
  for (std::size_t i = 0; i < count_; ++i) effort[i] = scale[rank_[i]] * requested[i];
  return effort;
}

PortValues PortClamp::most_effort(double energy_joule, double gate) const noexcept {
  PortValues most{};
  for (std::size_t i = 0; i < count_; ++i) {
    const double paid =
        maximum_force_newton(friction_of(ports_[i], hold_s_), energy_joule, ports_[i].v_max);
    most[i] = ports_[i].f_co + gate * (paid - ports_[i].f_co);
  }
  return most;
}

PortClamp::Drain PortClamp::drain_of(std::size_t rank, const PortValues& effort,
                                     double s) const noexcept {
  Drain drain;
  for (std::size_t i = 0; i < count_; ++i) {
    if (rank_[i] != rank) continue;
    const Port& port = ports_[i];
    const double full = std::abs(effort[i]);
    const double excess = s * full - port.f_co;
    if (!(excess > 0.0)) continue;
    const double v = excess > 2.0 * port.f_d * port.v_max ? port.v_max : excess / (2.0 * port.f_d);
    drain.watt += (excess - port.f_d * v) * v;
    drain.watt_per_scale += full * v;
  }
  return drain;
}

/// Largest scale at which no port of this rank drains anything.
double PortClamp::absorbed_scale(std::size_t rank, const PortValues& effort) const noexcept {
  double scale = 1.0;
  for (std::size_t i = 0; i < count_; ++i) {
    const double f = std::abs(effort[i]);
    if (rank_[i] == rank && f > ports_[i].f_co) scale = std::min(scale, ports_[i].f_co / f);
  }
  return scale;
}

/// The drain is convex in the scale, so the tangent's root is never below its root: Newton's method
/// comes down to it from above. What it ends with is tried, and counts only where it is paid.
double PortClamp::paid_scale(std::size_t rank, const PortValues& effort, double absorbed,
                             double rest_watt, double energy_joule) const noexcept {
  const auto is_paid = [&](double s) {
    return hold_s_ * (rest_watt + drain_of(rank, effort, s).watt) <= energy_joule;
  };
  if (!is_paid(absorbed)) return absorbed;
  constexpr int kSteps = 60;  // each at least halves what is left
  double s = 1.0;
  for (int i = 0; i < kSteps; ++i) {
    const Drain drain = drain_of(rank, effort, s);
    const double step = (rest_watt + drain.watt - energy_joule / hold_s_) / drain.watt_per_scale;
    if (!(step > 0.0)) break;
    s = std::max(absorbed, s - step);
    if (step <= kScaleTolerance * s) break;
  }
  // the last step was at least as long as what is left, but for rounding
  s = std::max(absorbed, s - 2.0 * kScaleTolerance * s);
  if (is_paid(s)) return s;
  double paid = absorbed;
  double unpaid = s;
  for (int i = 0; i < kSteps; ++i) {
    const double middle = 0.5 * (paid + unpaid);
    (is_paid(middle) ? paid : unpaid) = middle;
  }
  return paid;
}

}  // namespace palpate::controllers
