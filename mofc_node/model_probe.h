// SPDX-License-Identifier: Apache-2.0
// model_probe.h — the contact models of an Interaction, asked where the tool is not.
#pragma once

#include "common/contact/contact_model.h"
#include "common/core/messages.h"
#include "common/core/workspace_map.h"
#include "mofc_node/controllers/force_controller.h"

namespace palpate::mofc {

/// Maps hand to tool and force back, as for the requested force. Lives as long as what it refers
/// to: within one answer. No allocation, no throw.
class ModelProbe final : public controllers::TissueProbe {
 public:
  /// @param interaction  nullptr: no tissue
  /// @param tool_position_world_m  estimated at `state`
  ModelProbe(const Interaction* interaction, const DeviceState& state,
             const Vector3& tool_position_world_m, const WorkspaceConfig& workspace) noexcept;

  [[nodiscard]] Force at(const Vector3& hand_position_m,
                         const Vector3& hand_velocity_m_per_s) const noexcept override;

  /// Where the hand was for the tool position that physics_node used.
  [[nodiscard]] Vector3 evaluated_at_m() const noexcept;
  /// Of the deepest contact that touches, out of the tissue; 0 without touch.
  [[nodiscard]] Vector3 surface_normal() const noexcept;

 private:
  const Interaction* interaction_;
  const DeviceState& state_;
  Vector3 tool_position_world_m_;
  const WorkspaceConfig& workspace_;
  double age_s_ = 0.0;
};

}  // namespace palpate::mofc
