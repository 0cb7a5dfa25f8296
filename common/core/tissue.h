// tissue.h — what a tissue is made of: simple shapes, material, motion. Both sides of hop 3 know
// it.
#pragma once

#include <vector>

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
  double stiffness_newton_per_m = 500.0;         ///< k
  double damping_newton_s_per_m = 0.0;           ///< b
  double exponent = 0.0;                         ///< n ≥ 1 of Hunt and Crossley; 0: Kelvin–Voigt
  double exponent_depth_m = 1e-3;                ///< p₁ > 0, where that law's k and b are given
  bool is_damping_isotropic = false;             ///< b acts on the tangential motion too
  bool is_adhesive = false;                      ///< may pull while p > 0
  double stiffening_newton_per_m3 = 0.0;         ///< k₃: adds k₃ p³
  double relaxing_stiffness_newton_per_m = 0.0;  ///< k₁: adds k₁ (p − z), τ ż = p − z
  double relaxation_time_s = 0.0;                ///< τ
  std::vector<InclusionConfig> inclusions{};
  double friction_coefficient = 0.0;             ///< μ ≥ 0 of Coulomb friction; 0: slippery
  double friction_stiffness_newton_per_m = 0.0;  ///< tangential stiffness while the tip sticks
  double puncture_newton = 0.0;  ///< normal force at which the tip punctures; 0: never
  double cutting_newton = 0.0;   ///< largest drag of punctured tissue
};
/// Rigid oscillation of the tissue, as with breath or pulse: a sin(2πft + φ).
struct TissueMotionConfig {
  Vector3 amplitude_m = Vector3::Zero();
  double frequency_hz = 0.0;
  double phase_rad = 0.0;
};

/// A spherical tip with a straight shaft behind it.
struct ToolShape {
  double tip_radius_m = 0.0;  ///< 0: a point
  double shaft_length_m =
      0.0;  ///< from the centre of the tip to the handle, along +z of T; 0: none
  double shaft_radius_m = 0.0;
};

}  // namespace palpate
