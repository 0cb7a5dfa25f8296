// SPDX-License-Identifier: Apache-2.0
// tissue_model.h — the force of the tissue on the tool between two answers of physics_node.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "common/contact/contact_model.h"
#include "common/core/messages.h"
#include "common/core/time.h"
#include "mofc_node/tissue/elastic_patches.h"
#include "mofc_node/tissue/held_tissue.h"
#include "mofc_node/tissue/local_tissues.h"
#include "mofc_node/tissue/model_handover.h"
#include "mofc_node/tissue/physics_clock.h"
#include "mofc_node/tissue/tissue_store.h"

namespace palpate::mofc {

/// Tissue that physics_node has described is stepped here (LocalTissues), and the contact with
/// elastic bodies solved (ElasticPatches). Elsewhere, and beyond the part that is known, the
/// contact models of the newest Interaction count (ModelHandover). Where the two differ for a
/// tissue by Δ, the share of the one that is to count grows by bound / |Δ| per step, as between two
/// contact models; so does what an elastic body's result leaves that ends at once, because points
/// of it have been replaced. Of the tissue in the jaws of the tool only HeldTissue counts.
///
/// A physics whose descriptions need more than a step can spend (LocalTissues::work_in()) in a row
/// of about 64 steps that offer so much costs too much: the contact models take over, then its
/// store is dropped, and none is offered to it until it is restarted. No allocation, no throw.
class TissueModel {
 public:
  /// @param has_store   false: contact models only
  /// @param session_id  mofc's
  /// @param period      of the device
  TissueModel(bool has_store, double handover_newton_per_s, std::uint64_t session_id,
              Duration period);

  /// Once per Interaction, in order.
  /// @param state  of the DeviceState that is answered with it
  void receive(const Interaction& interaction, const Header& state) noexcept;
  /// What to acknowledge on hop 2.
  [[nodiscard]] SurfaceReceipts receipts() const noexcept {
    return store_ && !costs_too_much() ? store_->receipts() : SurfaceReceipts{};
  }
  [[nodiscard]] std::optional<ElasticReceipts> elastic_receipts() const noexcept {
    if (!elastic_ || costs_too_much()) return std::nullopt;
    return elastic_->receipts();
  }
  /// Of the jaws of the tool.
  [[nodiscard]] const HeldTissue& held_tissue() const noexcept { return held_; }
  [[nodiscard]] bool costs_too_much() const noexcept { return costly_session_id_ != 0; }

  /// Time of moving tissue in this physics, as far as its answers tell; none before the first.
  [[nodiscard]] std::optional<TimePoint> scene_time(TimePoint now) const noexcept {
    return clock_.best(now);
  }

  /// The force starts again from zero, and no tissue remembers the tool.
  void reset() noexcept;
  /// The physics is gone: the same, and nothing that it has described is known any more.
  void drop() noexcept;

  /// So long the force of the last step needs no news: for ever if it came from described tissue
  /// alone that does not move by itself, for one period of its motion if it does, else 0.
  [[nodiscard]] Duration holds_for() const noexcept { return holds_for_; }

  /// @param newest  answers this device session
  /// @param dt_s    ≥ 0, since the step before
  /// @param tool_position_world_m  estimated at that state, as is the velocity
  /// @param spent_work  of what the step can spend, before
  [[nodiscard]] ModelForce step(const Interaction& newest, const DeviceState& state,
                                const Vector3& tool_position_world_m,
                                const ToolVelocity& tool_velocity_world, double dt_s,
                                std::uint32_t spent_work = 0) noexcept;
  /// Of the last step.
  [[nodiscard]] std::uint32_t work() const noexcept {
    return local_.work() + (elastic_ ? elastic_->work() : 0);
  }

 private:
  void note_cost(std::uint64_t physics_session_id) noexcept;
  void share_out(const LocalTissues::Result& local, TimePoint now, const Vector3& position,
                 const ToolVelocity& velocity, double dt_s, double& share) noexcept;
  /// A patch whose result ends at once: what it had more than the contact model is left to fade.
  struct Parting {
    std::uint32_t tissue = 0;                // of the step before,
    Vector3 local_newton = Vector3::Zero();  // its force, and where the tip was
    Vector3 at_m = Vector3::Zero();
    Vector3 left_newton = Vector3::Zero();
    double newton_per_s = 0.0;  // with which that fades
  };
  void part(const LocalTissues::Result& local, TimePoint now, const Vector3& position,
            const ToolVelocity& velocity, double dt_s, double share_before, double share,
            Parting& parting) noexcept;

  double newton_per_s_;
  std::uint32_t work_per_step_;
  ModelHandover handover_;
  HeldTissue held_;
  std::unique_ptr<TissueStore> store_;
  LocalTissues local_;
  std::unique_ptr<ElasticPatches> elastic_;
  PhysicsClock clock_;
  std::array<double, kMaxDescribed> shares_{};               // of local_'s results
  std::array<double, kMaxElasticPatches> elastic_shares_{};  // of elastic_'s
  std::array<Parting, kMaxElasticPatches> partings_{};       // of elastic_'s
  Duration holds_for_{};
  int cost_ = 0;                         // grows with every step that needs too much
  std::uint64_t costly_session_id_ = 0;  // of the physics; 0: none
};

}  // namespace palpate::mofc
