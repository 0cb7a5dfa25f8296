// SPDX-License-Identifier: Apache-2.0
// tissue_step.h — one step of the tool in one tissue: where its proxy goes, and which contact
// results. physics_node evaluates it with the whole surface; mofc_node with the part of it that
// physics_node has sent.
#pragma once

#include <cstdint>
#include <optional>

#include "common/contact/shaft.h"
#include "common/contact/surface.h"
#include "common/contact/touch.h"
#include "common/core/messages.h"
#include "common/core/tissue.h"
#include "common/core/vector.h"

namespace palpate {

/// Tip, direction of the shaft (unit, from the tip to the handle) and time; W.
struct ToolPose {
  Vector3 tip_m = Vector3::Zero();
  Vector3 shaft = Vector3::UnitZ();
  double time_s = 0.0;

  [[nodiscard]] bool operator==(const ToolPose& other) const noexcept {
    return tip_m == other.tip_m && shaft == other.shaft && time_s == other.time_s;
  }
};

/// A straight motion of the tool from its last pose to the present one, as one tissue sees it. The
/// referenced objects must outlive it. No allocation, no throw.
class TissueStep {
 public:
  /// @param surface  in the tissue's rest frame
  /// @param last     none: the tool starts here
  /// @param most_views  of each proxy (@see move)
  /// @param most_work   of the views of each touch (@see SurfaceHint)
  TissueStep(const Surface& surface, const TissueMotionConfig& motion, const ToolShape& tool,
             const ToolPose& now, const std::optional<ToolPose>& last,
             std::uint32_t most_views = kMostProxyViews, std::uint32_t most_work = 0) noexcept;

  /// Of the touches that follow.
  void limit_work(std::uint32_t most_work) noexcept { most_work_ = most_work; }
  /// Nobody uses a tip with an uncovered view: it may end there, held by nothing.
  void use_only_covered() noexcept { only_covered_ = true; }

  /// The tip after the step, before settle(). Punctured tissue heals once the tool has left it.
  /// @param known  the touch at the last pose; nullptr: none
  [[nodiscard]] Touch follow_tip(std::uint32_t tissue, const Touch* known) const noexcept;
  /// The same for a tip that nothing has held since the last pose, in a ball around it that nothing
  /// of the tissue reaches into.
  /// @param radius_m  of the ball, more than the clearance of the tip
  [[nodiscard]] Touch free_tip(std::uint32_t tissue, const Touch* known,
                               double radius_m) const noexcept;
  /// The shaft after the step, before settle(), at the place where it would be deepest with its
  /// last proxy. False if it is not near: farther away than `reach_m` ≥ 0, and than it moves.
  /// @param search   of the same tissue at the last step, or a new one
  /// @param moved_m  set to the motion of that place relative to the tissue
  [[nodiscard]] bool follow_shaft(std::uint32_t tissue, const Touch* known, double reach_m,
                                  ShaftSearch& search, Touch& shaft,
                                  Vector3& moved_m) const noexcept;

  /// The tip relative to the displaced tissue, and its motion.
  [[nodiscard]] const Vector3& tip_m() const noexcept { return tip_m_; }
  [[nodiscard]] Vector3 moved_m() const noexcept { return tip_m_ - last_tip_m_; }

 private:
  const Surface& surface_;
  const ToolShape& tool_;
  Vector3 shaft_;
  Vector3 last_shaft_;
  Vector3 tip_m_;       // relative to the displaced tissue
  Vector3 last_tip_m_;  // likewise
  double dt_s_;
  bool is_start_;
  std::uint32_t most_views_;
  std::uint32_t most_work_;
  bool only_covered_ = false;
};

/// The contact of a settled touch with its total force.
/// @param tool_velocity_world  for the damping
/// @param time_s                       of the tissue's motion
[[nodiscard]] Contact acting_contact(const Touch& touch, const KelvinVoigtMaterial& material,
                                     double relaxed_m, const TissueMotionConfig& motion,
                                     const ToolVelocity& tool_velocity_world,
                                     double time_s) noexcept;

}  // namespace palpate
