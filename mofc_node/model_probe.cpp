// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/model_probe.h"

#include <algorithm>

namespace palpate::mofc {

ModelProbe::ModelProbe(const Interaction* interaction, const DeviceState& state,
                       const Vector3& tool_position_world_m,
                       const WorkspaceConfig& workspace) noexcept
    : interaction_(interaction),
      state_(state),
      tool_position_world_m_(tool_position_world_m),
      workspace_(workspace) {
  if (interaction == nullptr) return;
  age_s_ = std::max(0.0, to_seconds(state.header.sampled_at - interaction->device_sampled_at));
}

ModelProbe::Force ModelProbe::at(const Vector3& hand_position_m,
                                 const Vector3& hand_velocity_m_per_s) const noexcept {
  if (interaction_ == nullptr || state_.is_clutched) return {};
  const double scale = workspace_.scale_ratio;
  const ModelForce model = evaluate(
      *interaction_, tool_position_world_m_ + scale * (hand_position_m - state_.hand_position_m),
      scale * hand_velocity_m_per_s, age_s_);
  return {.force_on_hand_newton = workspace_.force_ratio * model.force_on_tool_newton,
          .stored_energy_joule = model.stored_energy_joule * workspace_.force_ratio / scale};
}

Vector3 ModelProbe::evaluated_at_m() const noexcept {
  if (interaction_ == nullptr) return state_.hand_position_m;
  return state_.hand_position_m +
         (interaction_->tool_position_world_m - state_.tool_position_world_m) /
             workspace_.scale_ratio;
}

Vector3 ModelProbe::surface_normal() const noexcept {
  // the deepest comes first
  const bool is_touching = interaction_ != nullptr && interaction_->listed_count > 0 &&
                           interaction_->contacts[0].penetration_m > 0.0;
  return is_touching ? interaction_->contacts[0].normal_world : Vector3(Vector3::Zero());
}

}  // namespace palpate::mofc
