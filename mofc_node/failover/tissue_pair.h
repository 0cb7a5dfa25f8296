// SPDX-License-Identifier: Apache-2.0
// tissue_pair.h — the tissue of one or two physics: what the one in use requests, and the
// transition from one to the other.
#pragma once

#include <array>
#include <memory>

#include "common/contact/contact_model.h"
#include "common/core/messages.h"
#include "common/core/physics_term.h"
#include "mofc_node/tissue/tissue_model.h"

namespace palpate::mofc {

/// Evaluates the tissue of both physics with every DeviceState, so that the one that is not in use
/// is ready: its store is filled, its proxies follow the tool. Both share the work of a step
/// (LocalTissues::work_in()): the one in use has its turn first. When the one in use changes,
/// the share of the other grows by bound / |Δ| per step, as between two contact models, so that the
/// change alone never moves the force by more than `handover_newton_per_s` · dt. No allocation, no
/// throw.
class TissuePair {
 public:
  /// @param has_standby  else the first is the only one
  /// @param session_id   mofc's
  /// @param period       of the device
  TissuePair(InteractionUse use, bool has_standby, double handover_newton_per_s,
             std::uint64_t session_id, Duration period);

  /// Once per Interaction of that physics, in order.
  void receive(PhysicsRole role, const Interaction& interaction, const Header& state) noexcept {
    models_[index_of(role)]->receive(interaction, state);
  }
  /// The force starts again from zero, and no tissue remembers the tool.
  void reset() noexcept;
  /// That physics is gone, and its force has faded or passed to the other: what it has described is
  /// dropped. Not while it has a share in the force of the other.
  void drop(PhysicsRole role, PhysicsRole in_use) noexcept;
  /// Its descriptions need more than a tick can spend on them.
  [[nodiscard]] bool costs_too_much(PhysicsRole role) const noexcept {
    return models_[index_of(role)]->costs_too_much();
  }

  /// @param newest  of each physics; null: it has not answered this device session
  /// @param dt_s    ≥ 0, since the step before
  [[nodiscard]] ModelForce step(const std::array<const Interaction*, kPhysicsRoles>& newest,
                                PhysicsRole in_use, const DeviceState& state,
                                const Vector3& tool_position_world_m,
                                const ToolVelocity& tool_velocity_world, double dt_s) noexcept;

  /// So long the force of the last step needs no news: TissueModel::holds_for(), the shorter of
  /// all that count.
  [[nodiscard]] Duration holds_for() const noexcept {
    if (standby_share_ == 0.0) return models_[0]->holds_for();
    if (standby_share_ == 1.0) return models_[1]->holds_for();
    return std::min(models_[0]->holds_for(), models_[1]->holds_for());
  }

  /// What motions to that physics acknowledge, and the time of the scene in use when they arrive.
  [[nodiscard]] SurfaceReceipts receipts(PhysicsRole role) const noexcept {
    return models_[index_of(role)]->receipts();
  }
  [[nodiscard]] std::optional<ElasticReceipts> elastic_receipts(PhysicsRole role) const noexcept {
    return models_[index_of(role)]->elastic_receipts();
  }
  [[nodiscard]] std::optional<TimePoint> scene_time(PhysicsRole receiver, PhysicsRole in_use,
                                                    TimePoint now) const noexcept;

  /// Of the jaws of the tool, by that physics.
  [[nodiscard]] const HeldTissue& held_tissue(PhysicsRole role) const noexcept {
    return models_[index_of(role)]->held_tissue();
  }

  /// Of the last step, for both physics; LocalTissues::work().
  [[nodiscard]] std::uint32_t work() const noexcept { return work_; }

  /// Change of the force by the transition between the two in the last step [N]; at most the bound.
  [[nodiscard]] double last_step_newton() const noexcept { return last_step_newton_; }

 private:
  InteractionUse use_;
  double newton_per_s_;
  std::array<std::unique_ptr<TissueModel>, kPhysicsRoles> models_;
  double standby_share_ = 0.0;
  double last_step_newton_ = 0.0;
  std::uint32_t work_ = 0;
};

}  // namespace palpate::mofc
