// SPDX-License-Identifier: Apache-2.0
// model_handover.h — the transition from one contact model to the next without a jump of the force.
#pragma once

#include <cstdint>
#include <span>

#include "common/contact/contact_model.h"
#include "common/core/messages.h"
#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate::mofc {

/// Evaluates the newest Interaction at the tool, with a gradual transition from the previous one.
///
/// If two models differ at the tool by Δ, the share of the new one grows by bound / |Δ| per step,
/// so a new model alone never changes the force by more than `bound = rate · dt` in one step;
/// models that agree within the bound are exchanged at once. Both are evaluated at the present
/// position, so the force ends when the tool leaves the tissue, also during a transition. A model
/// that arrives during a transition waits for its end. Before the first model the force is zero;
/// that counts as a model.
///
/// No allocation, no throw.
class ModelHandover {
 public:
  /// @param newton_per_s  > 0
  explicit ModelHandover(double newton_per_s) : newton_per_s_(newton_per_s) {}

  /// Removes all models: the force starts again from zero.
  void reset() noexcept;

  /// @param newest  the model to use, identified by session and sequence
  /// @param dt_s    ≥ 0, since the step before
  /// @param now     time of that position, device's clock
  /// @param shares  of tissues whose force comes from elsewhere
  [[nodiscard]] ModelForce step(const Interaction& newest, const Vector3& tool_position_world_m,
                                const ToolVelocity& tool_velocity_world, double dt_s, TimePoint now,
                                std::span<const TissueShare> shares = {}) noexcept;

  /// One tissue in the present model; no force without one.
  [[nodiscard]] ModelForce of_tissue(std::uint32_t tissue, const Vector3& tool_position_world_m,
                                     const ToolVelocity& tool_velocity_world,
                                     TimePoint now) const noexcept;

  /// Change of the force by the transition in the last step [N]; at most rate · dt.
  [[nodiscard]] double last_step_newton() const noexcept { return last_step_newton_; }

 private:
  struct Model {
    Interaction interaction;
    Duration loop_age_at_arrival{};  // from the DeviceState it answers to its first use
  };
  void take(const Interaction& newest, TimePoint now, Model& model) noexcept;
  [[nodiscard]] static double surface_age_s(const Model& model, TimePoint now) noexcept;
  [[nodiscard]] static bool is_same(const Model& model, const Interaction& newest) noexcept;

  double newton_per_s_;
  Model models_[2];
  int current_ = 0;
  bool has_model_ = false;    // else the current one is "no force"
  bool is_crossing_ = false;  // towards models_[1 − current_]
  double share_ = 0.0;        // of that one
  double last_step_newton_ = 0.0;
};

}  // namespace palpate::mofc
