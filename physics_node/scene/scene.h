// scene.h — all tissues and the tool: the force on the tool at one place and velocity.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/core/messages.h"
#include "common/session/scene_config.h"
#include "common/core/vector.h"
#include "physics_node/scene/broad_phase.h"
#include "physics_node/contact/proxy.h"
#include "physics_node/files/surface_files.h"

namespace palpate::physics {

/// What was looked at and what was not, at one place.
struct SceneCounts {
  std::uint32_t tissues_skipped = 0;        ///< by the broad phase, without looking at them
  std::uint32_t tissues_visited = 0;        ///< the others
  std::uint32_t tissues_asleep = 0;         ///< that relax, at rest: not advanced
  std::uint32_t octree_cells_visited = 0;   ///< of all clouds
  std::uint32_t octree_last_cell_hits = 0;  ///< nearest points found where the last one was
};

/// What all tissues together do to the tool; W. All zero where nothing touches.
struct SceneForce : SceneCounts {
  Vector3 force_on_tool_newton = Vector3::Zero();
  double stored_energy_joule = 0.0;              ///< elastic
  std::array<Contact, kMaxContacts> contacts{};  ///< the deepest first, then the nearest
  std::uint32_t listed_count = 0;                ///< entries of `contacts`
  std::uint32_t contact_count = 0;               ///< all touches; may be larger than the array
};

/// What tissue remembers of one tool: where it holds it back (physics_node/contact/proxy.h), where tissue
/// with friction sticks to it, what it has punctured, and how deep relaxing tissue has been
/// pressed.
class TissueMemory {
 private:
  friend class Scene;
  struct Pose {
    Vector3 tip_m = Vector3::Zero();
    Vector3 shaft = Vector3::UnitZ();
    double time_s = 0.0;
  };
  struct Touch {
    std::uint32_t tissue = 0;
    bool is_shaft = false;  // else the tip
    bool is_rubbed = false;
    bool is_punctured = false;
    Proxy proxy{};
    Vector3 stretch_m = Vector3::Zero();  // of the spring of friction, or of the drag; W
  };
  struct Relaxing {
    double penetration_m = 0.0;  // when last looked at, ≥ 0
    double relaxed_m = 0.0;      // z
    double advanced_s = 0.0;
  };
  [[nodiscard]] const Touch* find(std::uint32_t tissue, bool is_shaft) const noexcept;

  std::vector<Touch> touches_;  // tissues near the pose; room for kMostTouches
  std::vector<Touch> next_;
  std::vector<Relaxing> relaxing_;    // one for each relaxing tissue
  std::vector<std::uint32_t> awake_;  // of those, the ones that are not at rest
  Pose pose_;
  bool has_pose_ = false;
  bool has_all_ = false;  // tissues near the pose
  SceneCounts counts_;
};

/// Tissues, and a tool: a sphere as tip, and perhaps a straight shaft behind it. The scene itself
/// does not change: what a tissue remembers is in a TissueMemory, where it is comes from the time.
/// So evaluating it is a function: used by the physics step, by the ideal force and by the ideal
/// run alike.
///
/// The shaft touches each tissue where it would be deepest, as a sphere of its radius would, from
/// one diameter of the tip behind the tip on; what the tip and the shaft feel adds up. Its torque
/// is not felt. It is not described before it touches.
///
/// Thread-safe. Real-time safe: no allocation, no lock, no throw, but for the constructor and
/// new_memory().
class Scene {
 public:
  /// @param reach_m  ≥ 0; tissues this near to the tip are described before they are touched
  /// @throws SetupError  if a file that a tissue's geometry names cannot be used
  explicit Scene(const SceneConfig& config, double reach_m = 0.0);

  [[nodiscard]] TissueMemory new_memory() const;

  /// The tool is at this place now, and came here in a straight line. Its proxies follow it;
  /// relaxing tissue goes on from where it was; where friction holds, its spring goes along, turns
  /// with the surface, and slips as far as it pulls harder than μ times the elastic normal force;
  /// tissue that the tip presses harder than it bears is punctured: it lets go, and from then on
  /// drags the tip like dry friction until the whole tool has left it. What slips or breaks is
  /// lost: all of this only takes energy.
  /// @param time_s         not before the last call's
  /// @param shaft_to_handle  unit, W
  void remember(TissueMemory& memory, const Vector3& tip_position_world_m, double time_s,
                const Vector3& shaft_to_handle = Vector3::UnitZ()) const noexcept;

  /// A tissue is touched where a sphere of the tool reaches deeper than its surface: penetration =
  /// radius − distance of the centre > 0, seen from the side where the proxy is. Forces of several
  /// touches add up. At another place than the memory's it is the force as if the tool had gone
  /// there at once.
  /// @param time_s  where moving tissue is
  ///
  /// Any finite or non-finite input gives a finite result: if a number overflows, as for a tool
  /// teleported to 1e200 m, everything is zero as if nothing touched.
  [[nodiscard]] SceneForce evaluate(
      const Vector3& tip_position_world_m, const Vector3& tip_velocity_world_m_per_s, double time_s,
      const TissueMemory& memory, const Vector3& shaft_to_handle = Vector3::UnitZ()) const noexcept;
  /// The same at time 0, with tissue that has never been touched.
  [[nodiscard]] SceneForce evaluate(const Vector3& tip_position_world_m,
                                    const Vector3& tip_velocity_world_m_per_s) const noexcept {
    return evaluate(tip_position_world_m, tip_velocity_world_m_per_s, 0.0, TissueMemory{});
  }

  [[nodiscard]] std::size_t tissue_count() const noexcept { return tissues_.size(); }
  /// Tissues whose file an earlier tissue had loaded already.
  [[nodiscard]] std::size_t shared_surface_count() const noexcept { return shared_surfaces_; }

 private:
  using Pose = TissueMemory::Pose;
  using Touch = TissueMemory::Touch;
  static constexpr std::size_t kNone = ~std::size_t{0};
  struct Tissue {
    Shape shape;
    Material material;
    TissueMotionConfig motion;
    std::size_t relaxing = kNone;  // place in TissueMemory
  };
  [[nodiscard]] double relaxed_m(const Touch& touch, const TissueMemory& memory) const noexcept;
  [[nodiscard]] double radius_m(const Touch& touch) const noexcept {
    return touch.is_shaft ? shaft_radius_m_ : tip_radius_m_;
  }
  template <class Visit>
  std::uint32_t visit_near(const Pose& now, const TissueMemory& memory,
                           const Visit& visit) const noexcept;
  template <class Take>
  void follow(std::uint32_t tissue, const Pose& now, const TissueMemory& memory,
              const Take& take) const noexcept;
  [[nodiscard]] double nearest_along(const Shape& shape, const Vector3& tip_m, const Vector3& shaft,
                                     double side, double limit_m, SurfaceHint& hint) const noexcept;
  void settle(Touch& touch, const Vector3& moved_m, const TissueMemory& memory) const noexcept;
  [[nodiscard]] Contact contact_of(const Touch& touch, const TissueMemory& memory) const noexcept;
  void relax(TissueMemory& memory, std::size_t relaxing, double depth_m,
             double time_s) const noexcept;
  void add(const Touch& touch, const TissueMemory& memory,
           const Vector3& tip_velocity_world_m_per_s, double time_s,
           SceneForce& sum) const noexcept;

  double tip_radius_m_;
  double shaft_length_m_;
  double shaft_radius_m_;
  double reach_m_;
  std::size_t shared_surfaces_ = 0;
  std::vector<Tissue> tissues_;
  std::vector<std::uint32_t> relaxing_;
  std::vector<std::uint32_t> unbounded_;  // half-spaces: their own distance is the cheapest test
  BroadPhase bounded_;
};

}  // namespace palpate::physics
