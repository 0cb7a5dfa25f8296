// SPDX-License-Identifier: Apache-2.0
// interaction_deadband.h — decides when an Interaction must be sent to mofc_node (hop 3).
#pragma once

#include <algorithm>

#include "common/contact/contact_model.h"
#include "common/core/messages.h"
#include "common/session/scene_config.h"

namespace palpate::physics {

/// Difference, N, between the present force and the force that mofc_node computes for the present
/// motion from the last Interaction sent: it evaluates that contact model, or holds that force.
[[nodiscard]] inline double receiver_error_newton(const Interaction& sent,
                                                  const Interaction& present,
                                                  const ToolVelocity& tool_velocity_world,
                                                  InteractionUse use) noexcept {
  if (use == InteractionUse::kHeld) {
    return (present.force_on_tool_newton - sent.force_on_tool_newton).norm();
  }
  const double age_s = to_seconds(present.header.sampled_at - sent.header.sampled_at);
  const ModelForce received =
      evaluate(sent, present.tool_position_world_m, tool_velocity_world, age_s);
  return (present.force_on_tool_newton - received.force_on_tool_newton).norm();
}

/// True if mofc_node's force is wrong by more than k|F| and the floor, a contact has begun or ended
/// (with a local model: a tissue has come within reach or left it), or the keep-alive is due. While
/// it is false, the error at the times of the physics steps is at most max(k|F|, floor).
/// No allocation, no lock, no throw.
[[nodiscard]] inline bool is_worth_sending(const Interaction& sent, const Interaction& present,
                                           const ToolVelocity& tool_velocity_world,
                                           const InteractionDeadband& deadband,
                                           InteractionUse use) noexcept {
  if (present.device_session_id != sent.device_session_id) return true;
  if (use == InteractionUse::kHeld ? present.contact_count != sent.contact_count
                                   : present.listed_count != sent.listed_count) {
    return true;
  }
  const auto grip = [](const Interaction& one) {
    return one.listed_count > 0 ? one.contacts.front().grip.number : 0U;
  };
  if (grip(present) != grip(sent)) return true;
  if (present.header.sampled_at - sent.header.sampled_at >= deadband.keep_alive) return true;
  return receiver_error_newton(sent, present, tool_velocity_world, use) >
         std::max(deadband.ratio * present.force_on_tool_newton.norm(), deadband.floor_newton);
}

}  // namespace palpate::physics
