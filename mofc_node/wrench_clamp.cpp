// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/wrench_clamp.h"

#include <algorithm>
#include <cmath>

namespace palpate::mofc {
namespace {

using controllers::PortGuardParameters;
using controllers::PortValues;

PortValues ports_of(const Vector3& axes, const Vector3& joints) noexcept {
  return {axes.x(), axes.y(), axes.z(), joints.x(), joints.y(), joints.z()};
}
Vector3 axes_of(const PortValues& ports) noexcept { return {ports[0], ports[1], ports[2]}; }
Vector3 joints_of(const PortValues& ports) noexcept { return {ports[3], ports[4], ports[5]}; }

PortGuardParameters parameters_of(const MofcConfig& mofc, const ClampedDevice& device,
                                  const WristProfile& wrist) {
  const double sqrt3 = std::sqrt(3.0);
  const DeviceProfile& profile = device.profile;
  const FrictionPerAxis friction = profile.per_axis.value_or(
      FrictionPerAxis{.viscous_newton_s_per_m = Vector3::Constant(profile.viscous_newton_s_per_m),
                      .coulomb_newton = Vector3::Constant(profile.coulomb_newton / sqrt3)});
  PortGuardParameters parameters{.count = 6,
                                 .times = {.hold_s = to_seconds(device.lease),
                                           .delta_max_s = to_seconds(device.reply),
                                           .prompt_s = to_seconds(device.prompt),
                                           .longest_lease_s = to_seconds(device.longest_lease)},
                                 .credit_cap_joule = mofc.guard.credit_cap_joule,
                                 .gate_joule = mofc.guard.gate_joule,
                                 .gate_recovery_s = to_seconds(mofc.guard.gate_recovery)};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    parameters.ports[i] = {.f_d = friction.viscous_newton_s_per_m[axis],
                           .f_co = friction.coulomb_newton[axis],
                           .q = profile.position_resolution_m,
                           .v_max = mofc.guard.v_max_m_per_s};
    parameters.ports[3 + i] = {.f_d = wrist.viscous_newton_m_s_per_rad,
                               .f_co = wrist.coulomb_newton_m,
                               .q = wrist.angle_resolution_rad,
                               .v_max = wrist.v_max_rad_per_s};
  }
  return raised_for_one_hold(parameters,
                             ports_of(Vector3::Constant(device.peak_force_newton / sqrt3),
                                      Vector3::Constant(wrist.peak_torque_newton_m)));
}

}  // namespace

WrenchClamp::WrenchClamp(const MofcConfig& mofc, const ClampedDevice& device,
                         const WristProfile& wrist)
    : guard_(parameters_of(mofc, device, wrist)) {}

WrenchClamp::Output WrenchClamp::step(const controllers::ControlInput& input,
                                      const DeviceState& state,
                                      std::span<const AppliedForce> applied,
                                      const Vector3& requested_newton_m) noexcept {
  const std::size_t count = std::min(applied.size(), stretches_.size());
  for (std::size_t i = 0; i < count; ++i) {
    const AppliedForce& one = applied[i];
    stretches_[i] = {
        .duration_s = to_seconds(one.until - one.from),
        .effort_on_hand = ports_of(one.force_on_hand_newton, one.wrist_torque_newton_m),
        .position_at_end = ports_of(one.hand_position_at_end_m, one.wrist_angle_at_end_rad),
        .has_position_at_end = one.has_position_at_end};
  }
  const controllers::PortOutput granted =
      guard_.step({.position = ports_of(state.hand_position_m, state.wrist->pose.angle_rad),
                   .applied = {stretches_.data(), count},
                   .has_gap = input.has_gap,
                   .acting_effort_on_hand = ports_of(state.acting_force_on_hand_newton,
                                                     state.wrist->acting_torque_newton_m),
                   .acting_lease_s = input.acting_lease_s,
                   .energy_limit_joule = input.energy_limit_joule,
                   .requested_effort_on_hand =
                       ports_of(input.requested_force_on_hand_newton, requested_newton_m),
                   .is_request_fresh = input.is_request_fresh,
                   .stored_energy_joule = input.stored_energy_joule});
  return {.force = {.force_on_hand_newton = axes_of(granted.effort_on_hand),
                    .f_max_newton = axes_of(granted.most_effort),
                    .ledger_energy_joule = granted.ledger_energy_joule,
                    .counted_energy_joule = granted.counted_energy_joule,
                    .lease_s = granted.lease_s,
                    .begins_within_s = granted.begins_within_s,
                    .is_clamped = granted.is_clamped,
                    .is_too_fast = granted.is_too_fast},
          .wrist_torque_newton_m = joints_of(granted.effort_on_hand)};
}

}  // namespace palpate::mofc
