// SPDX-License-Identifier: Apache-2.0
// scene.h — all tissues and the tool: the force on the tool at one place and velocity.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/core/vector.h"
#include "common/session/scene_config.h"
#include "physics_node/scene/scene_description.h"
#include "physics_node/scene/scene_force.h"
#include "physics_node/scene/tissue_memory.h"
#include "physics_node/surfaces/box_tree.h"
#include "physics_node/surfaces/shape.h"

namespace palpate::physics {

/// Adds a contact to the sum: its force and energy if it touches, and itself if it is among the
/// deepest. No allocation.
void add_contact(const Contact& contact, SceneForce& sum) noexcept;

/// Tissues, and a tool: a spherical tip, optionally with a straight shaft behind it. The scene is
/// immutable but for set_material(): the state of the tissues is in a TissueMemory, their position
/// follows from the time.
/// The physics step, the ideal force and the ideal run use the same functions.
///
/// The shaft touches each tissue where a sphere of its radius would be deepest, from one diameter
/// of the tip behind the tip on. The forces on tip and shaft add up; the torque of the shaft is not
/// rendered. Elastic tissues keep their index but are not part of it (elastic_tissue/).
///
/// Thread-safe, except set_material(). Real-time safe, except the constructor and new_memory(): no
/// allocation, no lock, no throw.
class Scene {
 public:
  /// @param reach_m  ≥ 0; tissues this near to the tool are described before they are touched
  /// @throws SetupError  if a file that a tissue's geometry names cannot be used
  explicit Scene(const SceneConfig& config, double reach_m = 0.0);

  /// The state of tissue that has never been touched.
  [[nodiscard]] TissueMemory new_memory() const;

  /// Moves the tool in a straight line from the memory's pose to this one, and returns the force
  /// there. The proxies follow the tool (contact/proxy.h), relaxing tissue advances
  /// (relaxation.h), friction and puncture are updated (touch.h): all of this only dissipates
  /// energy.
  /// @param tool_velocity_world  for the damping only
  /// @param time_s           not before the last step's; determines where moving tissue is
  /// @param shaft_to_handle  unit, W
  /// @return @see evaluate
  SceneForce step(TissueMemory& memory, const Vector3& tip_position_world_m,
                  const ToolVelocity& tool_velocity_world, double time_s,
                  const Vector3& shaft_to_handle = Vector3::UnitZ()) const noexcept;

  /// The force as if the tool moved from the memory's pose to this one in one step; the memory
  /// stays unchanged. At the memory's own pose it is the force of the last step, for this velocity.
  ///
  /// A sphere of the tool touches a tissue where penetration = radius − distance of its centre > 0,
  /// seen from the side where the proxy is. Forces of several contacts add up.
  ///
  /// Any finite or non-finite input gives a finite result: if a number overflows, as for a tool
  /// teleported to 1e200 m, everything is zero as if nothing touched.
  [[nodiscard]] SceneForce evaluate(
      const Vector3& tip_position_world_m, const ToolVelocity& tool_velocity_world, double time_s,
      const TissueMemory& memory, const Vector3& shaft_to_handle = Vector3::UnitZ()) const noexcept;
  /// The same at time 0, with tissue that has never been touched.
  [[nodiscard]] SceneForce evaluate(const Vector3& tip_position_world_m,
                                    const ToolVelocity& tool_velocity_world) const noexcept {
    return evaluate(tip_position_world_m, tool_velocity_world, 0.0, TissueMemory{});
  }

  /// Replaces k and b of a tissue, from the next step on. Not while another thread uses the scene;
  /// SurfaceSenders have to forget() the tissue.
  /// @param tissue  < tissue_count()
  void set_material(std::size_t tissue, double stiffness_newton_per_m,
                    double damping_newton_s_per_m) noexcept;

  [[nodiscard]] std::size_t tissue_count() const noexcept { return tissues_.size(); }
  /// What mofc_node may get to know of the tissues; empty without reach.
  [[nodiscard]] std::span<const DescribedTissue> descriptions() const noexcept {
    return descriptions_;
  }
  /// Number of tissues whose file had already been loaded for an earlier tissue.
  [[nodiscard]] std::size_t shared_surface_count() const noexcept { return shared_surfaces_; }

 private:
  static constexpr std::size_t kNone = ~std::size_t{0};
  struct Tissue {
    Shape shape;
    KelvinVoigtMaterial material;
    TissueMotionConfig motion;
    std::size_t relaxing = kNone;  // index in Relaxation
  };

  template <class Visit>
  std::uint32_t visit_near(const ToolPose& now, const TissueMemory& memory,
                           const Visit& visit) const noexcept;
  template <class Take>
  SceneCounts visit_touches(const ToolPose& now, const TissueMemory& memory,
                            const Take& take) const noexcept;
  [[nodiscard]] double relaxed_m(const Touch& touch, const TissueMemory& memory) const noexcept;
  void add(const Touch& touch, const TissueMemory& memory, const ToolVelocity& tool_velocity_world,
           double time_s, SceneForce& sum) const noexcept;

  ToolShape tool_;
  double reach_m_;
  std::size_t shared_surfaces_ = 0;
  std::size_t elastic_ = 0;  // tissues that are elsewhere
  std::vector<Tissue> tissues_;
  std::vector<double> relaxation_times_s_;  // of the relaxing tissues
  std::vector<std::uint32_t> unbounded_;    // half-spaces: their own distance is the cheapest test
  BoxTree bounded_;
  std::vector<DescribedTissue> descriptions_;
};

}  // namespace palpate::physics
