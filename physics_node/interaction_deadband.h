// interaction_deadband.h — when mofc_node must hear of the force (hop 3).
#pragma once

#include <algorithm>

#include "common/contact/contact_model.h"
#include "common/core/messages.h"
#include "common/session/scene_config.h"

namespace palpate::physics {

/// How far the force that mofc_node renders for the present motion, from what it was last sent, is
/// from the present force, N: it evaluates that contact model, or holds that force.
[[nodiscard]] inline double receiver_error_newton(const Interaction& sent,
                                                  const Interaction& present,
                                                  const Vector3& tool_velocity_world_m_per_s,
                                                  InteractionUse use) noexcept {
  if (use == InteractionUse::kHeld) {
    return (present.force_on_tool_newton - sent.force_on_tool_newton).norm();
  }
  const double age_s = to_seconds(present.header.sampled_at - sent.header.sampled_at);
  const ModelForce rendered =
      evaluate(sent, present.tool_position_world_m, tool_velocity_world_m_per_s, age_s);
  return (present.force_on_tool_newton - rendered.force_on_tool_newton).norm();
}

/// Is mofc_node's force wrong by more than k|F| and the floor, has a contact begun or ended (or, of
/// a model, a tissue come within reach), or has it been left alone for too long? While this says
/// no, the error at the instants of the physics is at most max(k|F|, floor).
/// No allocation, no lock, no throw.
[[nodiscard]] inline bool is_worth_sending(const Interaction& sent, const Interaction& present,
                                           const Vector3& tool_velocity_world_m_per_s,
                                           const InteractionDeadband& deadband,
                                           InteractionUse use) noexcept {
  if (present.device_session_id != sent.device_session_id) return true;
  if (use == InteractionUse::kHeld ? present.contact_count != sent.contact_count
                                   : present.listed_count != sent.listed_count) {
    return true;
  }
  if (present.header.sampled_at - sent.header.sampled_at >= deadband.keep_alive) return true;
  return receiver_error_newton(sent, present, tool_velocity_world_m_per_s, use) >
         std::max(deadband.ratio * present.force_on_tool_newton.norm(), deadband.floor_newton);
}

}  // namespace palpate::physics
