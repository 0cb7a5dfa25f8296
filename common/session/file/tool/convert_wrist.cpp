// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <variant>

#include "common/session/file/convert.h"

namespace palpate {
namespace {

WristProfile to_wrist(const Fields& fields) {
  return {.viscous_newton_m_s_per_rad = fields.number("viscous_newton_m_s_per_rad"),
          .coulomb_newton_m = fields.number("coulomb_newton_m"),
          .angle_resolution_rad = fields.number("angle_resolution_rad"),
          .peak_torque_newton_m = fields.number("peak_torque_newton_m"),
          .v_max_rad_per_s = fields.number("v_max_rad_per_s")};
}

SimulatedWristConfig to_true_wrist(const Fields& fields, const WristProfile& profile) {
  return {
      .inertia_kg_m2 = fields.number("inertia_kg_m2"),
      .viscous_newton_m_s_per_rad =
          fields.number("viscous_newton_m_s_per_rad", profile.viscous_newton_m_s_per_rad),
      .coulomb_newton_m = fields.number("coulomb_newton_m", profile.coulomb_newton_m),
      .angle_resolution_rad = fields.number("angle_resolution_rad", profile.angle_resolution_rad),
      .peak_torque_newton_m = profile.peak_torque_newton_m};
}

PathConfig to_turning(const Fields& wrist) {
  const std::string kind = wrist.given_member("path");
  if (kind == "sinusoid") {
    const Fields fields = wrist.message("sinusoid");
    return SinusoidPath{.center_m = fields.vector("center_rad"),
                        .amplitude_m = fields.vector("amplitude_rad"),
                        .frequency_hz = fields.vector("frequency_hz"),
                        .phase_rad = fields.vector("phase_rad")};
  }
  if (kind == "hostile") {
    const Fields fields = wrist.message("hostile");
    return HostilePath{.center_m = fields.vector("center_rad"),
                       .radius_m = fields.number("radius_rad"),
                       .v_max_m_per_s = fields.number("v_max_rad_per_s")};
  }
  return HoldPath{wrist.message("hold").vector("angle_rad")};
}

HandWristConfig to_hand_wrist(const Fields& wrist) {
  return {.inertia_kg_m2 = wrist.number("inertia_kg_m2"),
          .stiffness_newton_m_per_rad = wrist.number("stiffness_newton_m_per_rad"),
          .damping_newton_m_s_per_rad = wrist.number("damping_newton_m_s_per_rad"),
          .path = to_turning(wrist)};
}

}  // namespace

void add_wrist(const Fields& device, const Fields& hand, const Fields& mofc, Side& side) {
  const Fields simulated = device.message("simulated");
  if (!device.has("wrist")) {
    if (simulated.has("wrist")) {
      simulated.problem("wrist", "needs device.wrist; give device { wrist {} }");
    }
    if (hand.has("wrist")) hand.problem("wrist", "needs device.wrist; give device { wrist {} }");
    return;
  }
  auto* const plugin = std::get_if<PluginConfig>(&side.driver);
  if (plugin != nullptr) {
    plugin->uses_wrist = true;
  } else if (is_real(side.driver)) {
    device.problem("wrist",
                   "only the simulated device and that of a plug-in have one; leave it out");
    return;
  }
  const bool is_guard =
      side.mofc.controller == ControllerKind::kMofc && side.mofc.mode == MofcMode::kGuard;
  if (!is_guard && side.mofc.controller != ControllerKind::kNone) {
    mofc.problem(side.mofc.controller == ControllerKind::kMofc ? "mode" : "controller",
                 "with device.wrist only mode guard clamps force and torque; leave it out, or give "
                 "controller: none");
  }
  if (side.mofc.has_safety_net) {
    mofc.problem("safety_net", "clamps no torque; leave it out with device.wrist");
  }
  const Fields wrist = device.message("wrist");
  WristProfile profile = to_wrist(wrist);
  // nobody has pushed these motors: no more than the friction of a joint absorbs, whatever its sign
  if (plugin != nullptr && wrist.enumerator("accept") != v1::Device::Wrist::UNCHECKED_MOTORS) {
    profile.peak_torque_newton_m = std::min(profile.peak_torque_newton_m, profile.coulomb_newton_m);
  }
  side.device.wrist = profile;
  side.simulated.wrist = to_true_wrist(simulated.message("wrist"), *side.device.wrist);
  side.hand.wrist = to_hand_wrist(hand.message("wrist"));
}

}  // namespace palpate
