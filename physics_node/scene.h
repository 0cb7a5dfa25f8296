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
  double stored_energy_joule = 0.0;              ///< elastic
  std::array<Contact, kMaxContacts> contacts{};  ///< the deepest first, then the nearest
  std::uint32_t listed_count = 0;                ///< entries of `contacts`
  std::uint32_t contact_count = 0;               ///< all touches; may be larger than the array
  std::uint32_t tissues_skipped = 0;             ///< by the broad phase, without looking at them
  std::uint32_t tissues_visited = 0;             ///< the others
  std::uint32_t octree_cells_visited = 0;        ///< of all clouds
};

/// How deep each relaxing tissue has been pressed, as it remembers it, and where the tip sticks to
/// tissue with friction. Every tool has its own.
class TissueMemory {
 private:
  friend class Scene;
  struct Relaxing {
    double penetration_m = 0.0;  // when last looked at, ≥ 0
    double relaxed_m = 0.0;      // z
  };
  struct Rubbing {
    Vector3 point_m = Vector3::Zero();    // where the tip was, as the tissue sees it
    Vector3 stretch_m = Vector3::Zero();  // of friction's spring; W
    bool is_touched = false;
  };
  std::vector<Relaxing> relaxing_;  // one for each relaxing tissue
  std::vector<Rubbing> rubbing_;    // one for each tissue with friction
  double time_s_ = 0.0;
  bool has_time_ = false;
};

/// Tissues, and a tool whose tip is a sphere. The scene itself does not change: what a tissue
/// remembers is in a TissueMemory, where it is comes from the time. So evaluating it is a function:
/// used by the physics step, by the ideal force and by the ideal run alike.
///
/// Thread-safe. Real-time safe: no allocation, no lock, no throw, but for the constructor and
/// new_memory().
class Scene {
 public:
  /// @param reach_m  ≥ 0; tissues this near to the tip are described before they are touched
  /// @throws SetupError  if a file that a tissue's geometry names cannot be used
  explicit Scene(const SceneConfig& config, double reach_m = 0.0);

  [[nodiscard]] TissueMemory new_memory() const;

  /// The tip is at this place now: relaxing tissue goes on from where it was, as if the tip had
  /// come here in a straight line; where friction holds, its spring goes along with the tip, turns
  /// with the surface, and slips as far as it pulls harder than μ times the elastic normal force.
  /// What slips is lost: friction only takes energy. Does nothing where no tissue relaxes or rubs.
  /// @param time_s  not before the last call's
  void remember(TissueMemory& memory, const Vector3& tip_position_world_m,
                double time_s) const noexcept;

  /// A tissue is touched where the tip reaches deeper than its surface: penetration = tip radius −
  /// distance of the tip's centre > 0. Forces of several tissues add up.
  /// @param time_s  where moving tissue is
  ///
  /// Any finite or non-finite input gives a finite result: if a number overflows, as for a tool
  /// teleported to 1e200 m, everything is zero as if nothing touched.
  [[nodiscard]] SceneForce evaluate(const Vector3& tip_position_world_m,
                                    const Vector3& tip_velocity_world_m_per_s, double time_s,
                                    const TissueMemory& memory) const noexcept;
  /// The same at time 0, with tissue that has never been touched.
  [[nodiscard]] SceneForce evaluate(const Vector3& tip_position_world_m,
                                    const Vector3& tip_velocity_world_m_per_s) const noexcept {
    return evaluate(tip_position_world_m, tip_velocity_world_m_per_s, 0.0, TissueMemory{});
  }

  [[nodiscard]] std::size_t tissue_count() const noexcept { return tissues_.size(); }

 private:
  static constexpr std::size_t kNone = ~std::size_t{0};
  struct Tissue {
    Shape shape;
    Material material;
    TissueMotionConfig motion;
    bool is_moving = false;
    std::size_t relaxing = kNone;  // place in TissueMemory
    std::size_t rubbing = kNone;   // place in TissueMemory
  };
  struct Displacement {
    Vector3 position_m = Vector3::Zero();
    Vector3 velocity_m_per_s = Vector3::Zero();
  };
  void rub(TissueMemory& memory, const Vector3& tip_position_world_m, double time_s) const noexcept;
  [[nodiscard]] double relaxed_m(const Tissue& tissue, const TissueMemory& memory) const noexcept;
  [[nodiscard]] static Displacement displacement(const Tissue& tissue, double time_s) noexcept;
  void touch(std::uint32_t index, const Vector3& tip_position_world_m,
             const Vector3& tip_velocity_world_m_per_s, double time_s, const TissueMemory& memory,
             SceneForce& sum) const noexcept;

  double tip_radius_m_;
  double reach_m_;
  std::vector<Tissue> tissues_;
  std::vector<std::uint32_t> relaxing_;
  std::vector<std::uint32_t> rubbing_;
  std::vector<std::uint32_t> unbounded_;  // half-spaces: their own distance is the cheapest test
  BroadPhase bounded_;
};

}  // namespace palpate::physics
