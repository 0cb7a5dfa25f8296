#include "device_node/hands_off_check.h"

#include <algorithm>

namespace palpate::device {
namespace {

/// The most likely value of so short a measurement is right to a few percent.
constexpr double kContradicted = 0.9;

}  // namespace

SweepPlan hands_off_plan(const DeviceSpecification& specification) {
  SweepPlan plan = default_sweep_plan(specification);
  plan.lines.clear();
  for (int i = 0; i < 3; ++i) {
    plan.lines.push_back({.middle_m = Vector3::Zero(), .direction = Vector3::Unit(i)});
  }
  plan.repeats = 2;
  return plan;
}

CheckedProfile checked_profile(const DeviceProfile& profile, const FrictionReport& report) {
  CheckedProfile checked{.profile = profile};
  const auto lower = [&](double& value, double likely, double bound) {
    if (!(likely < kContradicted * value)) return;
    checked.ratio = std::min(checked.ratio, bound / value);
    value = std::min(value, bound);
  };
  for (std::size_t i = 0; i < report.lines.size(); ++i) {
    const FrictionFit& fit = report.lines[i].fit;
    if (profile.per_axis) {
      const auto axis = static_cast<int>(i);
      FrictionPerAxis& friction = *checked.profile.per_axis;
      lower(friction.viscous_newton_s_per_m[axis], fit.viscous_newton_s_per_m,
            fit.viscous_bound_newton_s_per_m);
      lower(friction.coulomb_newton[axis], fit.coulomb_newton, fit.coulomb_bound_newton);
    } else {
      lower(checked.profile.viscous_newton_s_per_m, fit.viscous_newton_s_per_m,
            fit.viscous_bound_newton_s_per_m);
    }
    // the fallback relies on the isotropic value in either case
    lower(checked.profile.coulomb_newton, fit.coulomb_newton, fit.coulomb_bound_newton);
  }
  return checked;
}

}  // namespace palpate::device
