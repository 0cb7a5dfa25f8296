// SPDX-License-Identifier: Apache-2.0
#include "common/session/session.h"

#include <algorithm>

#include "common/core/check.h"
#include "common/core/random.h"
#include "common/session/clamped_device.h"

namespace palpate {

std::uint64_t stream_seed(std::uint64_t seed, const char* stream) {
  // the hash of the name, mixed with the seed by splitmix64's finaliser
  std::uint64_t z = fnv1a(stream) + seed * 0x9e3779b97f4a7c15ULL;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

std::uint64_t stream_seed(const Session& session, const Side& side, const char* stream) {
  const std::uint64_t seed =
      side.name.empty() ? session.seed : stream_seed(session.seed, side.name.c_str());
  return stream_seed(seed, stream);
}

double reach_of(const Session& session) {
  const bool is_any_local =
      std::any_of(session.sides.begin(), session.sides.end(),
                  [](const Side& side) { return side.mofc.interaction == InteractionUse::kLocal; });
  return is_any_local ? session.physics.reach_m : 0.0;
}

bool may_change_tissue(const Session& session) {
  return session.viewer.has_control &&
         std::none_of(session.sides.begin(), session.sides.end(),
                      [](const Side& side) { return is_real(side.driver); });
}

Session with_only_side(Session session, const std::string& name) {
  std::string names;
  for (const Side& side : session.sides) {
    if (side.name == name) {
      session.sides = std::vector<Side>{side};
      return session;
    }
    names += (names.empty() ? "" : ", ") + side.name;
  }
  if (session.side().name.empty()) {
    throw SetupError("--side " + name + ": session \"" + session.name +
                     "\" has one device; leave --side out");
  }
  throw SetupError((name.empty() ? "" : "--side " + name + ": ") + "session \"" + session.name +
                   "\" has several devices; give --side with one of " + names);
}

std::string with_side(const std::string& side, const std::string& name) {
  return side.empty() ? name : side + "." + name;
}

ClampedDevice clamped_device(const DeviceConfig& device) {
  return {.profile = device.profile,
          .wrist = device.wrist,
          .workspace = device.workspace,
          .lease = device.lease,
          .longest_lease = device.longest_lease,
          .reply = device.reply,
          .prompt = device.prompt,
          .rate_hz = device.rate_hz,
          .peak_force_newton = device.peak_force_newton};
}

namespace {

const char* controller_name(const MofcConfig& config) {
  switch (config.controller) {
    case ControllerKind::kNone:
      return "none";
    case ControllerKind::kMofc:
      break;
    case ControllerKind::kVirtualCoupling:
      return "virtual_coupling";
    case ControllerKind::kEnergyBounding:
      return "energy_bounding";
    case ControllerKind::kForceBounding:
      return "force_bounding";
    case ControllerKind::kPassivityControl:
      return "passivity_control";
    case ControllerKind::kMemoryBased:
      return "memory_based";
    case ControllerKind::kInputToState:
      return "input_to_state";
    case ControllerKind::kTwoPort:
      return "two_port";
    case ControllerKind::kEnergyTank:
      return "energy_tank";
    case ControllerKind::kLyapunov:
      return "lyapunov";
    case ControllerKind::kWaveVariables:
      return "wave_variables";
  }
  switch (config.mode) {
    case MofcMode::kPaper:
      return "mofc paper";
    case MofcMode::kVector:
      return "mofc vector";
    case MofcMode::kGuard:
      return "mofc guard";
  }
  return "?";
}

}  // namespace

std::string controller_text(const MofcConfig& config) {
  return std::string(controller_name(config)) + (config.has_safety_net ? " behind guard" : "");
}

}  // namespace palpate
