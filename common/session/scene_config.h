// scene_config.h — tissues, tool and the physics that steps them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate {

/// Fills the side of the plane away from `normal`.
struct HalfSpaceGeometry {
  Vector3 point_m = Vector3::Zero();
  Vector3 normal = Vector3::UnitZ();  ///< unit, out of the tissue
};
struct SphereGeometry {
  Vector3 center_m = Vector3::Zero();
  double radius_m = 0.01;
};
/// Axes along W.
struct BoxGeometry {
  Vector3 center_m = Vector3::Zero();
  Vector3 size_m = Vector3::Constant(0.1);  ///< full edge lengths
};
/// All points within `radius_m` of the line from one end to the other.
struct CapsuleGeometry {
  Vector3 from_m = Vector3::Zero();
  Vector3 to_m = Vector3::Zero();  ///< the same place: a sphere
  double radius_m = 0.01;
};
/// A surface from a file, in a frame of its own: lengths times `unit_m`, then turned, then moved.
/// physics_node reads the file (physics_node/files/surface_files.h), nobody else needs it.
struct FileGeometry {
  enum class Kind : std::uint8_t {
    kPointCloud,       ///< PLY
    kTriangleSurface,  ///< OBJ, STL
    kTetrahedralMesh,  ///< Gmsh .msh, legacy VTK
  };
  Kind kind = Kind::kPointCloud;
  std::string file;                      ///< path, from the folder of the program
  double unit_m = 1.0;                   ///< length of 1 in the file
  std::string stiffness_property{};      ///< of a cloud's points: factor on the stiffness; "": none
  Vector3 position_m = Vector3::Zero();  ///< of the file's origin, in W
  Quaternion rotation = Quaternion::Identity();
};
using Geometry =
    std::variant<HalfSpaceGeometry, SphereGeometry, BoxGeometry, CapsuleGeometry, FileGeometry>;

/// A ball of other stiffness and damping inside a tissue, such as a tumour; the change is smooth.
struct InclusionConfig {
  Vector3 center_m = Vector3::Zero();
  double radius_m = 0.005;      ///< where the change is half done
  double transition_m = 0.002;  ///< thickness of the shell in which it happens
  double stiffness_newton_per_m = 0.0;
  double damping_newton_s_per_m = 0.0;
};

/// The paper's tissue: force along the normal k·p + b·ṗ for penetration p > 0; and what soft tissue
/// does besides.
struct KelvinVoigtMaterial {
  double stiffness_newton_per_m = 500.0;         ///< k
  double damping_newton_s_per_m = 0.0;           ///< b
  bool is_damping_isotropic = false;             ///< b acts on the tangential motion too
  bool is_adhesive = false;                      ///< may pull while p > 0
  double stiffening_newton_per_m3 = 0.0;         ///< k₃: adds k₃ p³
  double relaxing_stiffness_newton_per_m = 0.0;  ///< k₁: adds k₁ (p − z), τ ż = p − z
  double relaxation_time_s = 0.0;                ///< τ
  std::vector<InclusionConfig> inclusions{};
  double friction_coefficient = 0.0;  ///< μ ≥ 0 of Coulomb friction; 0: slippery
  double friction_stiffness_newton_per_m =
      0.0;                       ///< of the tissue along its surface while it sticks
  double puncture_newton = 0.0;  ///< press of the tip, along the normal, that punctures; 0: never
  double cutting_newton = 0.0;   ///< most that punctured tissue holds the tip with
};
using Material = std::variant<KelvinVoigtMaterial>;

/// The tissue goes to and fro as a whole, as with breath or pulse: a sin(2πft + φ).
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
  double tip_radius_m = 0.0;  ///< spherical tool tip; 0: a point
  double shaft_length_m =
      0.0;  ///< from the tip's centre towards the handle, along T's +z; 0: only a tip
  double shaft_radius_m = 0.0;
  std::vector<TissueConfig> tissues;
};

/// Hop 3 thinned: an Interaction is sent when the receiver's force is wrong, or after `keep_alive`.
struct InteractionDeadband {
  double ratio = 0.05;         ///< k of the force
  double floor_newton = 0.05;  ///< least error that counts
  Duration keep_alive = std::chrono::milliseconds(20);
};

struct PhysicsConfig {
  double rate_hz = 1000.0;
  double reach_m = 0.05;  ///< tissues this near to the tip are described before they are touched
  std::optional<InteractionDeadband> interaction_deadband{};  ///< none: every step is sent
};

}  // namespace palpate
