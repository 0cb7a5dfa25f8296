// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/verdict/remedies.h"

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <utility>

#include "common/telemetry/verdict/causes.h"

namespace palpate {
namespace {

/// Of a device with friction whose motors have no watchdog: nothing but a limit of 0 takes all of
/// every force.
bool grants_no_force(const RunFacts& facts) {
  return facts.device.has_no_motor_watchdog && facts.device.max_force_newton == 0.0 &&
         facts.device.peak_limited_ticks > 0 && facts.coulomb_newton > 0.0;
}

}  // namespace

std::string path_remedy(const RunFacts& facts) {
  return fmt::format("the recorded path {} at {:.3f} s: smooth it there",
                     std::isfinite(facts.path_m_per_s)
                         ? fmt::format("moves at {:.3g} m/s", facts.path_m_per_s)
                         : std::string("jumps from its end to its beginning"),
                     facts.path_at_s);
}

std::string disagreement_remedy(const RunFacts& facts) {
  const double friction = facts.device.checked_friction_ratio;
  if (!facts.is_limited) {
    return "the controller `" + facts.controller +
           "` does not limit itself; use mofc, or mofc.safety_net=true";
  }
  if (friction > 0.0 && friction < 1.0) {
    return fmt::format("the device has {} of the friction of its profile: `palpate identify`",
                       percent(friction));
  }
  return "the clamp and the device disagree: check device.profile (`palpate identify`)";
}

RunFinding no_motor_watchdog(const RunFacts& facts) {
  RunFinding finding{
      .grade = Grade::kFair,
      .what = "no_motor_watchdog",
      .cause = "no_motor_watchdog",
      .text =
          "the motors do not end a force by themselves, so it is held to the device's dry friction",
      .remedy = "if a person can cut the supply of the motors: device.accept=NO_MOTOR_WATCHDOG"};
  if (grants_no_force(facts)) {
    finding.grade = Grade::kBad;
    finding.text =
        "the motors do not end a force by themselves, and the device gave none: nothing bounds "
        "what held currents are elsewhere in the workspace";
    finding.remedy =
        "give the driver a smaller mount.workspace_half_extent_m, which ends before singular "
        "places of the arm, whatever the session accepts, or a plug-in its held_force_ratio "
        "(event=force_limit in the log)";
  }
  return finding;
}

bool is_held_by_no_watchdog(const RunFacts& facts) {
  return facts.device.has_no_motor_watchdog &&
         (!facts.device.accepts_no_motor_watchdog || grants_no_force(facts));
}

std::string nodes_left_out(const RunFacts& facts) {
  std::string nodes;
  for (const auto& [name, node] : {std::pair{"device_node", &facts.device_node},
                                   {"mofc_node", &facts.mofc_node},
                                   {"physics_node", &facts.physics_node}}) {
    if (!node->is_recorded) nodes += (nodes.empty() ? "" : ", ") + std::string(name);
  }
  return nodes;
}

}  // namespace palpate
