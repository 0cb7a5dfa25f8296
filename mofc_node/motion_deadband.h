// SPDX-License-Identifier: Apache-2.0
// motion_deadband.h — when the tool's motion must be sent to physics_node (hop 2).
#pragma once

#include <algorithm>

#include "common/core/messages.h"
#include "common/session/mofc_config.h"

namespace palpate::mofc {

/// Whether the tool has moved on from the last motion sent, or keep_alive has passed. A change of
/// velocity counts relative to the velocity itself (Weber's law). If a sent motion is lost, the
/// next one replaces it, after keep_alive at the latest. No allocation, no lock, no throw.
[[nodiscard]] inline bool is_worth_sending(const ToolMotion& sent, const ToolMotion& present,
                                           const MotionDeadband& deadband) noexcept {
  if (present.device_session_id != sent.device_session_id) return true;
  if (present.header.sampled_at - sent.header.sampled_at >= deadband.keep_alive) return true;
  if (present.buttons != sent.buttons) return true;
  if (present.grip.has_value() != sent.grip.has_value()) return true;
  if (present.grip && (present.grip->number != sent.grip->number ||
                       present.grip->has_let_go != sent.grip->has_let_go ||
                       (present.grip->slip_m - sent.grip->slip_m).norm() > deadband.floor_m)) {
    return true;
  }

  const Vector3& v = present.tool_velocity_world_m_per_s;
  const double velocity_change = (v - sent.tool_velocity_world_m_per_s).norm();
  const double moved_m = (present.tool_position_world_m - sent.tool_position_world_m).norm();
  const double turned_rad =
      present.tool_orientation_world.angularDistance(sent.tool_orientation_world);
  return moved_m > deadband.floor_m || turned_rad > deadband.floor_rad ||
         velocity_change > std::max(deadband.ratio * v.norm(), deadband.floor_m_per_s);
}

}  // namespace palpate::mofc
