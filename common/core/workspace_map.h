// SPDX-License-Identifier: Apache-2.0
// workspace_map.h — maps the hand (D) to the tool (W): scale, offset, clutch.
#pragma once

#include <cstdint>
#include <optional>

#include "common/core/vector.h"

namespace palpate {

struct WorkspaceConfig {
  double scale_ratio = 1.0;            ///< tool displacement / hand displacement
  double force_ratio = 1.0;            ///< force on hand / force on tool
  Vector3 offset_m = Vector3::Zero();  ///< tool position in W when the hand is at D's origin
  std::optional<std::uint32_t> clutch_button;
};

/// tool_W = offset + scale · (hand_D + clutch_shift_D). While the clutch button is held the tool
/// stays in place and the hand moves freely; the shift compensates for this motion.
///
/// Forces: force on hand = force_ratio · force on tool. With force_ratio ≠ scale the map does not
/// preserve power. This is safe because the clamp bounds the energy at the hand itself.
class WorkspaceMap {
 public:
  explicit WorkspaceMap(const WorkspaceConfig& config) : config_(config) {}

  /// Processes one reading; call once per tick.
  /// @param hand_position_m  D        @param is_clutch_held  state of the clutch button
  void update(const Vector3& hand_position_m, bool is_clutch_held) noexcept {
    if (is_clutch_held && !is_clutched_) held_hand_position_m_ = hand_position_m;
    if (is_clutched_ || is_clutch_held) {
      // motion of the hand while the clutch is held does not move the tool
      clutch_shift_m_ += held_hand_position_m_ - hand_position_m;
      held_hand_position_m_ = hand_position_m;
    }
    is_clutched_ = is_clutch_held;
  }

  [[nodiscard]] Vector3 tool_position_world_m(const Vector3& hand_position_m) const noexcept {
    return config_.offset_m + config_.scale_ratio * (hand_position_m + clutch_shift_m_);
  }
  [[nodiscard]] Vector3 tool_velocity_world_m_per_s(const Vector3& hand_velocity) const noexcept {
    return is_clutched_ ? Vector3(Vector3::Zero()) : Vector3(config_.scale_ratio * hand_velocity);
  }
  [[nodiscard]] bool is_clutched() const noexcept { return is_clutched_; }

 private:
  WorkspaceConfig config_;
  Vector3 clutch_shift_m_ = Vector3::Zero();
  Vector3 held_hand_position_m_ = Vector3::Zero();
  bool is_clutched_ = false;
};

}  // namespace palpate
