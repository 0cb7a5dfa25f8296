// material.h — what force a tissue answers with, given the surface and the motion of the tool.
#pragma once

#include "common/core/session.h"
#include "common/core/vector.h"
#include "physics_node/geometry.h"

namespace palpate::physics {

/// The force of one tissue on the tool and how it changes with the tool's motion; W.
struct TissueForce {
  Vector3 force_on_tool_newton = Vector3::Zero();
  Matrix3 d_force_d_position = Matrix3::Zero();  ///< ∂f/∂x at constant velocity [N/m]
  Matrix3 d_force_d_velocity = Matrix3::Zero();  ///< ∂f/∂v [N·s/m]
  double stored_energy_joule = 0.0;              ///< elastic
};

/// The paper's tissue. With p the penetration, n the normal out of the tissue, v the tool's
/// velocity:
///
///   f = N n + f_t      N   = k p + b ṗ, with ṗ = −n·v; at least 0 unless the tissue is adhesive
///                      f_t = −b (v − n (n·v)) if the damping is isotropic, else 0
///
/// The elastic part is the gradient of the stored energy ½ k p², so it gives back what it took; the
/// damping only takes. Where N is cut off its derivatives are zero.
/// @param penetration_m  > 0        @param surface  of the tissue, seen from the tip's centre
[[nodiscard]] TissueForce respond(const KelvinVoigtMaterial& material, const SurfaceView& surface,
                                  double penetration_m,
                                  const Vector3& tip_velocity_world_m_per_s) noexcept;

}  // namespace palpate::physics
