#include "physics_node/material.h"

namespace palpate::physics {

// Symbols:
//   k  stiffness [N/m]      b  damping [N·s/m]      p  penetration [m]
//   n  normal, ∇p = −n      H  curvature, ∂n/∂x = H, H n = 0, H = Hᵀ
//   v  velocity of the tip  N  force along n
TissueForce respond(const KelvinVoigtMaterial& material, const SurfaceView& surface,
                    double penetration_m, const Vector3& tip_velocity_world_m_per_s) noexcept {
  const double k = material.stiffness_newton_per_m * surface.stiffness_ratio;
  const double b = material.damping_newton_s_per_m;
  const double p = penetration_m;
  const Vector3& n = surface.normal;
  const Matrix3& H = surface.curvature_per_m;
  const Vector3& v = tip_velocity_world_m_per_s;

  TissueForce result;
  result.stored_energy_joule = 0.5 * k * p * p;
  const Matrix3 nn = n * n.transpose();

  // elastic only: nothing else to compute
  if (b == 0.0) {
    result.force_on_tool_newton = k * p * n;
    result.d_force_d_position = k * p * H - k * nn;
    return result;
  }

  // along the normal: ∂N/∂x = −k nᵀ − b (H v)ᵀ,  ∂N/∂v = −b nᵀ
  const double v_n = n.dot(v);
  const double N = k * p - b * v_n;
  const Vector3 Hv = H * v;
  if (N > 0.0 || material.is_adhesive) {
    result.force_on_tool_newton = N * n;
    result.d_force_d_position = N * H - k * nn - b * n * Hv.transpose();
    result.d_force_d_velocity = -b * nn;
  }

  // along the surface
  if (material.is_damping_isotropic) {
    result.force_on_tool_newton -= b * (v - v_n * n);
    result.d_force_d_position += b * (v_n * H + n * Hv.transpose());
    result.d_force_d_velocity -= b * (Matrix3::Identity() - nn);
  }
  return result;
}

}  // namespace palpate::physics
