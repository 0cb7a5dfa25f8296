// scene_config.h — tissues, tool and the settings of the physics.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate {

/// Everything on the side of the plane opposite to `normal`.
struct HalfSpaceGeometry {
  Vector3 point_m = Vector3::Zero();
  Vector3 normal = Vector3::UnitZ();  ///< unit vector, out of the tissue
};
struct SphereGeometry {
  Vector3 center_m = Vector3::Zero();
  double radius_m = 0.01;
};
/// Aligned with the axes of W.
struct BoxGeometry {
  Vector3 center_m = Vector3::Zero();
  Vector3 size_m = Vector3::Constant(0.1);  ///< full edge lengths
};
/// All points within `radius_m` of the line from one end to the other.
struct CapsuleGeometry {
  Vector3 from_m = Vector3::Zero();
  Vector3 to_m = Vector3::Zero();  ///< equal to `from_m`: a sphere
  double radius_m = 0.01;
};
/// A surface from a file: scaled by `unit_m`, then rotated, then moved into W.
/// Only physics_node reads the file (physics_node/files/surface_files.h).
struct FileGeometry {
  enum class Kind : std::uint8_t {
    kPointCloud,       ///< PLY
    kTriangleSurface,  ///< OBJ, STL
    kTetrahedralMesh,  ///< Gmsh .msh, legacy VTK
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

/// A ball of different stiffness and damping inside a tissue, such as a tumour; smooth transition.
struct InclusionConfig {
  Vector3 center_m = Vector3::Zero();
  double radius_m = 0.005;      ///< where half of the transition is reached
  double transition_m = 0.002;  ///< thickness of the transition
  double stiffness_newton_per_m = 0.0;
  double damping_newton_s_per_m = 0.0;
};

/// Force along the normal, k·p + b·ṗ for penetration p > 0, with the extensions of soft tissue
/// below; or, with an exponent, the law of Hunt and Crossley: k·p·(p/p₁)ⁿ⁻¹ + b·(p/p₁)ⁿ·ṗ, without
/// isotropic damping, stiffening, relaxation and inclusions.
struct KelvinVoigtMaterial {
  double stiffness_newton_per_m = 500.0;  ///< k
  double damping_newton_s_per_m = 0.0;    ///< b
  double exponent = 0.0;                  ///< n ≥ 1 of Hunt and Crossley; 0: Kelvin–Voigt
  double exponent_depth_m = 1e-3;         ///< p₁ > 0, where that law's k and b are given
  bool is_damping_isotropic = false;      ///< b acts on the tangential motion too
  bool is_adhesive = false;               ///< may pull while p > 0
  double stiffening_newton_per_m3 = 0.0;  ///< k₃: adds k₃ p³
  double relaxing_stiffness_newton_per_m = 0.0;  ///< k₁: adds k₁ (p − z), τ ż = p − z
  double relaxation_time_s = 0.0;                ///< τ
  std::vector<InclusionConfig> inclusions{};
  double friction_coefficient = 0.0;             ///< μ ≥ 0 of Coulomb friction; 0: slippery
  double friction_stiffness_newton_per_m = 0.0;  ///< tangential stiffness while the tip sticks
  double puncture_newton = 0.0;  ///< normal force at which the tip punctures; 0: never
  double cutting_newton = 0.0;   ///< largest drag of punctured tissue
};
using Material = std::variant<KelvinVoigtMaterial>;

/// Rigid oscillation of the tissue, as with breath or pulse: a sin(2πft + φ).
struct TissueMotionConfig {
  Vector3 amplitude_m = Vector3::Zero();
  double frequency_hz = 0.0;
  double phase_rad = 0.0;
};

struct TissueConfig {
  std::string name;
  Geometry geometry;
  Material material;
  TissueMotionConfig motion{};
};

struct SceneConfig {
  double tip_radius_m = 0.0;  ///< of the spherical tool tip; 0: a point
  double shaft_length_m =
      0.0;  ///< from the centre of the tip to the handle, along +z of T; 0: no shaft
  double shaft_radius_m = 0.0;
  std::vector<TissueConfig> tissues;
};

/// Thins hop 3: an Interaction is sent when the receiver's force is off, or after `keep_alive`.
struct InteractionDeadband {
  double ratio = 0.05;         ///< k of the force
  double floor_newton = 0.05;  ///< smallest error that is corrected
  Duration keep_alive = std::chrono::milliseconds(20);
};

struct PhysicsConfig {
  double rate_hz = 1000.0;
  double reach_m = 0.05;  ///< tissues this close to the tip are described before contact
  std::optional<InteractionDeadband> interaction_deadband{};  ///< none: every step sends one
};

}  // namespace palpate
