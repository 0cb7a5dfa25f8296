// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/rivals/bounding.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::controllers {

namespace {

constexpr double kLeastXi = 1e-9;  // √ξ stays far from underflow

}  // namespace

ControlOutput EnergyBounding::step(const ControlInput& input) noexcept {
  const Interval interval = interval_.read(input);
  const double B = p_.f_d / p_.T;
  const double bound = interval.duration_s > 0.0
                           ? (2.0 * B * interval.moved_m - interval.force_on_hand_newton).norm()
                           : 0.0;
  ControlOutput output = output_within(input.requested_force_on_hand_newton, bound);
  output.ledger_energy_joule = B > 0.0 ? bound * bound / (4.0 * B) : 0.0;
  return output;
}

void LessConservativeBounding::reset() noexcept {
  interval_.reset();
  energy_joule_ = 0.0;
}

ControlOutput LessConservativeBounding::step(const ControlInput& input) noexcept {
  const Interval interval = interval_.read(input);
  const double B = p_.f_d / p_.T;
  energy_joule_ += B * interval.moved_m.squaredNorm() + interval.work_joule;
  // after a gap nothing is known; where no force is requested the next contact begins
  const bool is_known =
      interval.duration_s > 0.0 && !input.requested_force_on_hand_newton.isZero(0.0);
  if (!is_known) energy_joule_ = 0.0;
  const double bound = 2.0 * std::sqrt(B * std::max(0.0, energy_joule_));
  ControlOutput output = output_within(input.requested_force_on_hand_newton, bound);
  output.ledger_energy_joule = energy_joule_;
  return output;
}

void MoreConservativeBounding::reset() noexcept {
  interval_.reset();
  xi_ = 1.0;
}

ControlOutput MoreConservativeBounding::step(const ControlInput& input) noexcept {
  const Interval interval = interval_.read(input);
  const double B = p_.f_d / p_.T;
  if (!(interval.duration_s > 0.0) || !(B > 0.0)) {
    xi_ = 1.0;
    return output_within(input.requested_force_on_hand_newton, 0.0);
  }
  const double C = std::sqrt(B);
  const double phi = (2.0 * xi_ * C * interval.moved_m - interval.force_on_hand_newton / C).norm();
  const double requested = input.requested_force_on_hand_newton.norm();
  const double before = xi_;
  if (requested > 0.0 && phi > 0.0) {
    const double ratio = requested / (C * phi);
    xi_ = std::clamp(before * ratio * ratio, kLeastXi, 1.0);
  }
  // E ≥ |F|²/(4 B ξ) before the step is |φ|²/(4 ξ) ≤ E after it
  const double energy = phi * phi / (4.0 * before);
  ControlOutput output =
      output_within(input.requested_force_on_hand_newton, 2.0 * C * std::sqrt(xi_ * energy));
  output.ledger_energy_joule = energy;
  return output;
}

}  // namespace palpate::controllers
