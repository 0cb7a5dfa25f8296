// scene.h — all tissues and the tool: the force on the tool at one place and velocity.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/core/messages.h"
#include "common/core/session.h"
#include "common/core/vector.h"
#include "physics_node/broad_phase.h"
#include "physics_node/surface_files.h"

namespace palpate::physics {

/// What all tissues together do to the tool; W. All zero where nothing touches.
struct SceneForce {
  Vector3 force_on_tool_newton = Vector3::Zero();
  Matrix3 d_force_d_position = Matrix3::Zero();  ///< ∂f/∂x at constant velocity [N/m]
  Matrix3 d_force_d_velocity = Matrix3::Zero();  ///< ∂f/∂v [N·s/m]
  double stored_energy_joule = 0.0;              ///< elastic
  std::array<Contact, kMaxContacts> contacts{};  ///< the deepest, deepest first
  std::uint32_t contact_count = 0;               ///< of all; may be larger than the array
  std::uint32_t tissues_skipped = 0;             ///< by the broad phase, without looking at them
};

/// Tissues at rest, and a tool whose tip is a sphere. It keeps no state, so evaluating it is a
/// function: used by the physics step, by the ideal force and by the ideal run alike.
class Scene {
 public:
  /// @throws SetupError  if a file that a tissue's geometry names cannot be used
  explicit Scene(const SceneConfig& config);

  /// A tissue is touched where the tip reaches deeper than its surface: penetration = tip radius −
  /// distance of the tip's centre > 0. Forces of several tissues add up.
  ///
  /// Any finite or non-finite input gives a finite result: if a number overflows, as for a tool
  /// teleported to 1e200 m, everything is zero as if nothing touched.
  /// Thread-safe. Real-time safe: no allocation, no lock, no throw.
  [[nodiscard]] SceneForce evaluate(const Vector3& tip_position_world_m,
                                    const Vector3& tip_velocity_world_m_per_s) const noexcept;

  [[nodiscard]] std::size_t tissue_count() const noexcept { return tissues_.size(); }

 private:
  struct Tissue {
    Shape shape;
    Material material;
  };
  void touch(std::uint32_t index, const Vector3& tip_position_world_m,
             const Vector3& tip_velocity_world_m_per_s, SceneForce& sum) const noexcept;

  double tip_radius_m_;
  std::vector<Tissue> tissues_;
  std::vector<std::uint32_t> unbounded_;  // half-spaces: their own distance is the cheapest test
  BroadPhase bounded_;
};

}  // namespace palpate::physics
