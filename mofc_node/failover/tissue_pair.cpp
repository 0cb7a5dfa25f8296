// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/failover/tissue_pair.h"

#include <algorithm>

namespace palpate::mofc {

TissuePair::TissuePair(InteractionUse use, bool has_standby, double handover_newton_per_s,
                       std::uint64_t session_id, Duration period)
    : use_(use), newton_per_s_(handover_newton_per_s) {
  const bool has_store = use == InteractionUse::kLocal;
  models_[0] = std::make_unique<TissueModel>(has_store, handover_newton_per_s, session_id, period);
  if (has_standby) {
    models_[1] =
        std::make_unique<TissueModel>(has_store, handover_newton_per_s, session_id, period);
  }
}

void TissuePair::reset() noexcept {
  for (const auto& model : models_) {
    if (model) model->reset();
  }
}

void TissuePair::drop(PhysicsRole role, PhysicsRole in_use) noexcept {
  const double share = role == PhysicsRole::kStandby ? standby_share_ : 1.0 - standby_share_;
  if (role == in_use || share == 0.0) models_[index_of(role)]->drop();
}

ModelForce TissuePair::step(const std::array<const Interaction*, kPhysicsRoles>& newest,
                            PhysicsRole in_use, const DeviceState& state,
                            const Vector3& tool_position_world_m,
                            const ToolVelocity& tool_velocity_world, double dt_s) noexcept {
  std::array<ModelForce, kPhysicsRoles> forces{};
  work_ = 0;
  const std::size_t used = index_of(in_use);
  for (const std::size_t i : {used, 1 - used}) {
    if (!models_[i]) continue;
    if (newest[i] == nullptr) {
      models_[i]->reset();
    } else if (use_ == InteractionUse::kHeld) {
      forces[i] = held(*newest[i]);
    } else {
      forces[i] = models_[i]->step(*newest[i], state, tool_position_world_m, tool_velocity_world,
                                   dt_s, work_);
      work_ += models_[i]->work();
    }
  }
  const auto& [first, standby] = forces;
  const Vector3 difference = standby.force_on_tool_newton - first.force_on_tool_newton;
  const double aim = in_use == PhysicsRole::kStandby ? 1.0 : 0.0;
  last_step_newton_ = 0.0;
  if (standby_share_ != aim) {
    const double newton = difference.norm();
    const double bound_newton = newton_per_s_ * dt_s;
    const double most = newton > bound_newton ? bound_newton / newton : 1.0;
    const double step = std::clamp(aim - standby_share_, -most, most);
    standby_share_ = step == aim - standby_share_ ? aim : standby_share_ + step;
    last_step_newton_ = std::abs(step) * newton;
  }
  if (standby_share_ == 0.0) return first;
  if (standby_share_ == 1.0) return standby;
  return {first.force_on_tool_newton + standby_share_ * difference,
          std::min(first.stored_energy_joule, standby.stored_energy_joule),
          first.is_touching || standby.is_touching,
          first.torque_on_tool_newton_m +
              standby_share_ * (standby.torque_on_tool_newton_m - first.torque_on_tool_newton_m)};
}

std::optional<TimePoint> TissuePair::scene_time(PhysicsRole receiver, PhysicsRole in_use,
                                                TimePoint now) const noexcept {
  if (receiver == in_use) return std::nullopt;
  const auto time = models_[index_of(in_use)]->scene_time(now);
  if (!time) return std::nullopt;
  return *time + receipts(receiver).loop_age / 2;
}

}  // namespace palpate::mofc
