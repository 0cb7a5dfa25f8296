// SPDX-License-Identifier: Apache-2.0
// scene_config.h — tissues, tool and the settings of the physics.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/core/time.h"
#include "common/core/tissue.h"
#include "common/core/vector.h"

namespace palpate {

/// A surface from a file: scaled by `unit_m`, then rotated, then moved into W.
/// Only physics_node reads the file (physics_node/files/surface_files.h).
struct FileGeometry {
  enum class Kind : std::uint8_t {
    kPointCloud,       ///< PLY
    kTriangleSurface,  ///< OBJ, STL
    kTetrahedralMesh,  ///< Gmsh .msh, VTK .vtk and .vtu
  };
  Kind kind = Kind::kPointCloud;
  std::string file;                      ///< path, relative to the working directory
  double unit_m = 1.0;                   ///< length of 1 in the file
  std::string stiffness_property{};      ///< point property: factor on the stiffness; "": none
  Vector3 position_m = Vector3::Zero();  ///< of the file's origin, in W
  Quaternion rotation = Quaternion::Identity();
};
using Geometry =
    std::variant<HalfSpaceGeometry, SphereGeometry, BoxGeometry, CapsuleGeometry, FileGeometry>;

/// A region of a mesh, by the name that its file gives it.
struct MeshTag {
  std::string name{};
  double within_m = 0.0;  ///< of one of its nodes
};
/// A part of space, in W, or of the mesh.
using RegionGeometry = std::variant<HalfSpaceGeometry, SphereGeometry, BoxGeometry, MeshTag>;
/// Whether a point lies in the part of space; never in a MeshTag, which only its mesh can tell.
[[nodiscard]] bool contains(const RegionGeometry& region, const Vector3& point_m);

/// An elastic solid on the tetrahedra of a mesh (docs/elastic.md).
struct ElasticMaterial {
  enum class Law : std::uint8_t { kNeoHookean, kCorotational, kStVenantKirchhoff };
  struct Part {
    RegionGeometry where{};
    std::string tissue{};  ///< name in materials.h; "": given by figures
    double young_pa = 0.0;
    double poisson_ratio = 0.0;
    double density_kg_per_m3 = 0.0;
  };
  /// How a needle goes into it, or a blade cuts it (docs/grasping.md).
  struct Pierced {
    /// Of the last of `parts` that contains the tip.
    struct Tougher {
      RegionGeometry where{};
      double toughness_joule_per_m2 = 0.0;
    };
    double toughness_joule_per_m2 = 0.0;  ///< of what is cut: width or edge × way
    double spreading_ratio = 0.0;         ///< of the force that spreads to the one that cuts
    double friction_newton_per_m = 0.0;   ///< by the length of needle or edge in it
    double membrane_newton = 0.0;         ///< force on the tip that punctures the surface; 0: none
    std::vector<Tougher> parts{};

    [[nodiscard]] double toughness_at(const Vector3& point_m) const {
      double toughness = toughness_joule_per_m2;
      for (const Tougher& part : parts) {
        if (contains(part.where, point_m)) toughness = part.toughness_joule_per_m2;
      }
      return toughness;
    }
  };
  /// What gives way where the body is held, such as a ligament: springs on its surface.
  struct Attached {
    RegionGeometry where{};  ///< faces whose centroid lies there
    double stiffness_pa_per_m = 0.0;
    double toughness_joule_per_m2 = 0.0;  ///< 0: they do not tear
    /// Index of another elastic tissue in the scene that it is tied to; none: to what stands still.
    std::optional<std::size_t> tissue{};
    double gap_m = 1e-3;       ///< of faces that are tied, from the other surface
    bool is_anywhere = false;  ///< `where` does not count
  };
  /// Another tissue of the scene, whose surface it cannot go through.
  struct Touches {
    std::size_t tissue = 0;  ///< index in the scene
    double friction_coefficient = 0.0;
  };
  /// One spring and dashpot in series of the relaxing part of the modulus (Prony).
  struct Branch {
    double share = 0.0;  ///< of the modulus at once, in (0, 1)
    double tau_s = 0.0;  ///< > 0
  };
  std::string tissue{};    ///< name in materials.h; "": given by figures
  double young_pa = 10e3;  ///< at rest, when all branches have relaxed
  double poisson_ratio = 0.45;
  double density_kg_per_m3 = 1000.0;
  Law law = Law::kNeoHookean;
  double viscosity_s = 0.0;         ///< Rayleigh's β
  double mass_damping_per_s = 0.0;  ///< Rayleigh's α
  std::vector<Branch> branches{};   ///< shares sum to less than 1
  /// Of a power law: largest error of the branches' complex modulus over its range, relative.
  std::optional<double> fit_error_ratio{};
  Vector3 gravity_m_per_s2 = Vector3::Zero();
  Vector3 scan_gravity_m_per_s2 = Vector3::Zero();  ///< under which the mesh has its shape
  std::vector<RegionGeometry> fixed{};              ///< nodes in any of these are held
  std::vector<Attached> attached{};                 ///< outside `fixed`
  std::vector<Touches> touches{};
  std::vector<Part> parts{};  ///< the last one that contains an element's centroid counts
  double solve_rate_hz = 50.0;
  bool is_linear = false;  ///< elements as in the file; else made quadratic
  double friction_coefficient = 0.0;
  std::optional<Pierced> pierced{};  ///< none: no needle or blade goes in
};

using Material = std::variant<KelvinVoigtMaterial, ElasticMaterial>;

struct TissueConfig {
  std::string name;
  Geometry geometry;
  Material material;
  TissueMotionConfig motion{};
};

/// Jaws at the tip that hold elastic tissue (docs/grasping.md), or a needle or blade that does,
/// along which the tissue slips by another law.
struct GripperConfig {
  std::uint32_t button = 0;                ///< the jaws are closed while it is held
  double reach_m = 0.0;                    ///< from the centre of the tip
  std::uint32_t most_points = 64;          ///< of the surface
  double stiffness_newton_per_m = 2000.0;  ///< of the jaws, all points together
  double jaw_newton = 10.0;                ///< with which they press, both together
  double friction_coefficient = 0.5;       ///< slips above μ · jaw_newton
  double tear_newton = 8.0;                ///< the tissue is lost above
  /// > 0: a needle, or a blade, of which this much is pressed in first; button, jaws and tear do
  /// not count
  double needle_width_m = 0.0;
  double blade_length_m = 0.0;              ///< of its edge; 0: not a blade
  Vector3 blade_facing = Vector3::UnitX();  ///< unit, of the tool frame, without z

  [[nodiscard]] bool is_needle() const noexcept { return needle_width_m > 0.0; }
  [[nodiscard]] bool is_blade() const noexcept { return blade_length_m > 0.0; }
  [[nodiscard]] double slip_newton() const noexcept { return friction_coefficient * jaw_newton; }
};

/// A needle, along −z of the tool frame (docs/grasping.md).
struct NeedleConfig {
  double width_m = 0.0;                    ///< of the crack that it cuts
  double reach_m = 0.0;                    ///< of the points that it holds, from its tip
  std::uint32_t most_points = 64;          ///< of the surface
  double stiffness_newton_per_m = 2000.0;  ///< with which it holds them, all together
};

/// A blade: its edge goes from the tip along +z of the tool frame (docs/grasping.md).
struct BladeConfig {
  double length_m = 0.0;                   ///< of the edge
  Vector3 facing = Vector3::UnitX();       ///< unit, of the tool frame, without z: where it cuts
  double reach_m = 0.0;                    ///< of the points that it holds, from its edge
  std::uint32_t most_points = 64;          ///< of the surface
  double stiffness_newton_per_m = 2000.0;  ///< with which it holds them, all together
};

/// An electrode at the tip that ablates elastic tissue (docs/grasping.md).
struct ElectrodeConfig {
  std::uint32_t button = 0;          ///< it is energised while it is held
  double power_watt = 50.0;          ///< into tissue all around the tip
  double reach_m = 0.0;              ///< from the centre of the tip; more than its radius
  double energy_joule_per_kg = 2e6;  ///< that tissue takes up until it vanishes
  double softest_ratio = 0.2;        ///< of the stiffness of tissue that is about to vanish
};

struct SceneConfig {
  double tip_radius_m = 0.0;  ///< of the spherical tool tip; 0: a point
  double shaft_length_m =
      0.0;  ///< from the centre of the tip to the handle, along +z of T; 0: no shaft
  double shaft_radius_m = 0.0;
  std::optional<GripperConfig> gripper{};
  std::optional<NeedleConfig> needle{};  ///< not with a gripper
  std::optional<BladeConfig> blade{};    ///< not with one of these
  std::optional<ElectrodeConfig> electrode{};
  std::vector<TissueConfig> tissues;

  /// What holds elastic tissue: gripper, needle or blade.
  [[nodiscard]] std::optional<GripperConfig> holder() const {
    if (blade) {
      return GripperConfig{.reach_m = blade->reach_m,
                           .most_points = blade->most_points,
                           .stiffness_newton_per_m = blade->stiffness_newton_per_m,
                           .needle_width_m = std::min(blade->length_m, 2.0 * tip_radius_m),
                           .blade_length_m = blade->length_m,
                           .blade_facing = blade->facing};
    }
    if (!needle) return gripper;
    return GripperConfig{.reach_m = needle->reach_m,
                         .most_points = needle->most_points,
                         .stiffness_newton_per_m = needle->stiffness_newton_per_m,
                         .needle_width_m = needle->width_m};
  }

  [[nodiscard]] ToolShape tool() const { return {tip_radius_m, shaft_length_m, shaft_radius_m}; }
};

/// Some of what holds it may tear.
[[nodiscard]] inline bool can_tear(const TissueConfig& tissue) {
  const auto* const elastic = std::get_if<ElasticMaterial>(&tissue.material);
  return elastic != nullptr &&
         std::any_of(elastic->attached.begin(), elastic->attached.end(),
                     [](const auto& one) { return one.toughness_joule_per_m2 > 0.0; });
}

/// What has been ablated, cut or torn can come back.
[[nodiscard]] inline bool is_restorable(const SceneConfig& scene, const TissueConfig& tissue) {
  const auto* const elastic = std::get_if<ElasticMaterial>(&tissue.material);
  return elastic != nullptr &&
         (can_tear(tissue) || scene.electrode.has_value() || (scene.blade && elastic->pierced));
}

/// Thins hop 3: an Interaction is sent when the receiver's force is off, or after `keep_alive`.
struct InteractionDeadband {
  double ratio = 0.05;         ///< k of the force
  double floor_newton = 0.05;  ///< smallest error that is corrected
  Duration keep_alive = std::chrono::milliseconds(20);
};

/// physics.standby.
struct StandbyConfig {
  std::optional<Duration> silence{};  ///< after which it takes over; none: half of stale_after
};

struct PhysicsConfig {
  double rate_hz = 1000.0;
  double reach_m = 0.05;  ///< tissues this close to the tip are described before contact
  std::optional<InteractionDeadband> interaction_deadband{};  ///< none: every step sends one
  std::optional<StandbyConfig> standby{};
};

}  // namespace palpate
