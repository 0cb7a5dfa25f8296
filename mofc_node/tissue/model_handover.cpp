// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/tissue/model_handover.h"

#include <algorithm>

namespace palpate::mofc {

void ModelHandover::reset() noexcept {
  has_model_ = false;
  is_crossing_ = false;
  share_ = 0.0;
  last_step_newton_ = 0.0;
}

void ModelHandover::take(const Interaction& newest, TimePoint now, Model& model) noexcept {
  copy_without_news(newest, model.interaction);
  model.loop_age_at_arrival = std::max(Duration::zero(), now - newest.device_sampled_at);
}

double ModelHandover::surface_age_s(const Model& model, TimePoint now) noexcept {
  // physics looked at the tissue half-way round the loop, as far as anybody knows
  const Duration age = now - model.interaction.device_sampled_at - model.loop_age_at_arrival / 2;
  return std::max(0.0, to_seconds(age));
}

bool ModelHandover::is_same(const Model& model, const Interaction& newest) noexcept {
  return model.interaction.header.session_id == newest.header.session_id &&
         model.interaction.header.sequence == newest.header.sequence;
}

ModelForce ModelHandover::of_tissue(std::uint32_t tissue, const Vector3& tool_position_world_m,
                                    const ToolVelocity& tool_velocity_world,
                                    TimePoint now) const noexcept {
  if (!has_model_) return {};
  const Model& model = models_[current_];
  return evaluate_tissue(model.interaction, tissue, tool_position_world_m, tool_velocity_world,
                         surface_age_s(model, now));
}

ModelForce ModelHandover::step(const Interaction& newest, const Vector3& tool_position_world_m,
                               const ToolVelocity& tool_velocity_world, double dt_s, TimePoint now,
                               std::span<const TissueShare> shares) noexcept {
  const auto at_tool = [&](const Model& model) {
    return evaluate(model.interaction, tool_position_world_m, tool_velocity_world,
                    surface_age_s(model, now), shares);
  };
  last_step_newton_ = 0.0;
  ModelForce from = has_model_ ? at_tool(models_[current_]) : ModelForce{};
  if (!is_crossing_) {
    if (has_model_ && is_same(models_[current_], newest)) return from;
    take(newest, now, models_[1 - current_]);
    is_crossing_ = true;
    share_ = 0.0;
  }

  // a step of the crossing
  ModelForce to = at_tool(models_[1 - current_]);
  const Vector3 difference = to.force_on_tool_newton - from.force_on_tool_newton;
  const double newton = difference.norm();
  const double bound_newton = newton_per_s_ * dt_s;
  const double share_before = share_;
  share_ = newton > bound_newton ? std::min(1.0, share_ + bound_newton / newton) : 1.0;
  last_step_newton_ = (share_ - share_before) * newton;
  if (share_ >= 1.0) {
    current_ = 1 - current_;
    has_model_ = true;
    is_crossing_ = false;
    return to;
  }
  return {from.force_on_tool_newton + share_ * difference,
          std::min(from.stored_energy_joule, to.stored_energy_joule),
          from.is_touching || to.is_touching,
          from.torque_on_tool_newton_m +
              share_ * (to.torque_on_tool_newton_m - from.torque_on_tool_newton_m)};
}

}  // namespace palpate::mofc
