// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/controllers/one_pool_clamp.h"

#include <algorithm>
#include <cmath>

namespace palpate::controllers {

double OnePoolClamp::drain_watt(const Vector3& force_newton) const noexcept {
  if (!per_axis_) return controllers::drain_watt(p_, force_newton.norm(), v_max_m_per_s_);
  double sum = 0.0;
  for (int i = 0; i < 3; ++i) {
    sum += controllers::drain_watt(per_axis_->on_axis(i, p_.T), std::abs(force_newton[i]),
                                   v_max_m_per_s_);
  }
  const Vector3 excess = (force_newton.cwiseAbs() - per_axis_->f_co).cwiseMax(0.0);
  const MofcParameters least{.f_d = per_axis_->f_d.minCoeff(), .f_co = 0.0, .T = p_.T};
  return std::min(sum, controllers::drain_watt(least, excess.norm(), v_max_m_per_s_));
}

ControlOutput OnePoolClamp::clamp(const Vector3& requested, double energy_joule,
                                  double gate) const noexcept {
  const auto granted = [&](double absorbed, double paid) {
    return absorbed + gate * (paid - absorbed);
  };
  if (!per_axis_) {
    return output_within(requested,
                         granted(p_.f_co, maximum_force_newton(p_, energy_joule, v_max_m_per_s_)));
  }
  ControlOutput output;
  const double scale = granted(absorbed_scale(requested), paid_scale(requested, energy_joule));
  output.force_on_hand_newton = scale < 1.0 ? Vector3(scale * requested) : requested;
  output.is_clamped = output.force_on_hand_newton != requested;
  for (int i = 0; i < 3; ++i) {
    // what the whole pool would pay for along this axis
    const MofcParameters axis = per_axis_->on_axis(i, p_.T);
    output.f_max_newton[i] =
        granted(axis.f_co, maximum_force_newton(axis, energy_joule, v_max_m_per_s_));
  }
  return output;
}

/// Largest scale at which no axis drains anything.
double OnePoolClamp::absorbed_scale(const Vector3& force_newton) const noexcept {
  double scale = 1.0;
  for (int i = 0; i < 3; ++i) {
    const double f = std::abs(force_newton[i]);
    if (f > per_axis_->f_co[i]) scale = std::min(scale, per_axis_->f_co[i] / f);
  }
  return scale;
}

double OnePoolClamp::paid_scale(const Vector3& force_newton, double energy_joule) const noexcept {
  const auto is_paid = [&](double scale) {
    return p_.T * drain_watt(scale * force_newton) <= std::max(0.0, energy_joule);
  };
  if (is_paid(1.0)) return 1.0;
  double paid = absorbed_scale(force_newton);
  double unpaid = 1.0;
  constexpr int kHalvings = 60;  // below the last bit of a double
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (paid + unpaid);
    if (!(paid < middle && middle < unpaid)) break;  // no double is between them
    (is_paid(middle) ? paid : unpaid) = middle;
  }
  return paid;
}

}  // namespace palpate::controllers
