// motion_deadband.h — when physics_node must hear of the tool (hop 2).
#pragma once

#include <algorithm>

#include "common/core/messages.h"
#include "common/session/mofc_config.h"

namespace palpate::mofc {

/// Has the tool moved on from what was last sent, or has that been silent for too long? Weber: a
/// change of velocity counts against the velocity itself. A motion that is then lost on the way is
/// made good by the next one, after keep_alive at the latest. No allocation, no lock, no throw.
[[nodiscard]] inline bool is_worth_sending(const ToolMotion& sent, const ToolMotion& present,
                                           const MotionDeadband& deadband) noexcept {
  if (present.device_session_id != sent.device_session_id) return true;
  if (present.header.sampled_at - sent.header.sampled_at >= deadband.keep_alive) return true;
  if (present.buttons != sent.buttons) return true;

  const Vector3& v = present.tool_velocity_world_m_per_s;
  const double velocity_change = (v - sent.tool_velocity_world_m_per_s).norm();
  const double moved_m = (present.tool_position_world_m - sent.tool_position_world_m).norm();
  const double turned_rad =
      present.tool_orientation_world.angularDistance(sent.tool_orientation_world);
  return moved_m > deadband.floor_m || turned_rad > deadband.floor_rad ||
         velocity_change > std::max(deadband.ratio * v.norm(), deadband.floor_m_per_s);
}

}  // namespace palpate::mofc
