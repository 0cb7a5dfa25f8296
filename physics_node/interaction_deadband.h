// interaction_deadband.h — when mofc_node must hear of the force (hop 3).
#pragma once

#include <algorithm>

#include "common/core/messages.h"
#include "common/core/session.h"

namespace palpate::physics {

/// How far the force that mofc_node renders at the present tool position, from what it was last
/// sent, is from the present force, N. It holds the force it was sent.
[[nodiscard]] inline double receiver_error_newton(const Interaction& sent,
                                                  const Interaction& present) noexcept {
  return (present.force_on_tool_newton - sent.force_on_tool_newton).norm();
}

/// Is mofc_node's force wrong by more than k|F| and the floor, or has it been left alone for too
/// long? While this says no, the error at the instants of the physics is at most max(k|F|, floor).
/// No allocation, no lock, no throw.
[[nodiscard]] inline bool is_worth_sending(const Interaction& sent, const Interaction& present,
                                           const InteractionDeadband& deadband) noexcept {
  if (present.device_session_id != sent.device_session_id) return true;
  if (present.contact_count != sent.contact_count) return true;
  if (present.header.sampled_at - sent.header.sampled_at >= deadband.keep_alive) return true;
  return receiver_error_newton(sent, present) >
         std::max(deadband.ratio * present.force_on_tool_newton.norm(), deadband.floor_newton);
}

}  // namespace palpate::physics
