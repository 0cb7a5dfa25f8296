// SPDX-License-Identifier: Apache-2.0
#include "device_node/identification/hands_off_check.h"

#include <algorithm>

#include "common/core/check.h"

namespace palpate::device {
namespace {

// What so short a measurement is good for, with masses up to 0.1 kg: the whole friction at a speed
// to a few percent, its viscous part alone to a factor of 2.
constexpr double kSpeed_m_per_s = 0.05;
constexpr double kContradicted = 0.95;
constexpr double kViscousContradicted = 0.5;

}  // namespace

SweepPlan hands_off_plan(const DeviceSpecification& specification) {
  SweepPlan plan = default_sweep_plan(specification);
  plan.lines.clear();
  for (const Vector3& axis : axes_with_motors(specification)) {
    plan.lines.push_back({.middle_m = Vector3::Zero(), .direction = axis});
  }
  plan.repeats = 2;
  return plan;
}

void refuse_hands_off_check(const DeviceSpecification& specification) {
  if (specification.has_motor_watchdog) return;
  throw SetupError("device.hands_off_check: device \"" + specification.model_name +
                   "\" has no motor-side watchdog: it would go on pushing, with up to 1 N, if "
                   "device_node stopped; leave the field out, and measure it with a hand at its "
                   "power switch by `palpate identify --without-watchdog`");
}

CheckedProfile checked_profile(const DeviceProfile& profile, const FrictionReport& report) {
  CheckedProfile checked{.profile = profile};
  // lowers the pair if the line contradicts it
  const auto check = [&](const FrictionFit& fit, double& viscous, double& coulomb) {
    const double claimed = coulomb + viscous * kSpeed_m_per_s;
    const double measured = fit.coulomb_newton + fit.viscous_newton_s_per_m * kSpeed_m_per_s;
    if (measured >= kContradicted * claimed &&
        fit.viscous_newton_s_per_m >= kViscousContradicted * viscous) {
      return;
    }
    viscous = std::min(viscous, fit.viscous_bound_newton_s_per_m);
    coulomb = std::min(coulomb, fit.coulomb_bound_newton);
    checked.ratio = std::min(checked.ratio, std::max(0.01 * claimed, measured) / claimed);
    checked.is_lowered = true;
  };
  for (const auto& [line, fit] : report.lines) {
    DeviceProfile& lower = checked.profile;
    if (lower.per_axis) {
      Eigen::Index axis = 0;
      line.direction.cwiseAbs().maxCoeff(&axis);
      check(fit, lower.per_axis->viscous_newton_s_per_m[axis],
            lower.per_axis->coulomb_newton[axis]);
      // the fallback relies on |F| ≤ f_co
      lower.coulomb_newton = std::min(lower.coulomb_newton, lower.per_axis->coulomb_newton[axis]);
    } else {
      check(fit, lower.viscous_newton_s_per_m, lower.coulomb_newton);
    }
  }
  return checked;
}

}  // namespace palpate::device
