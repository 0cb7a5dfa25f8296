// material.h — what a tissue answers with, given its surface: the law of a contact.
#pragma once

#include "common/core/messages.h"
#include "common/session/scene_config.h"
#include "common/core/vector.h"
#include "physics_node/surfaces/geometry.h"

namespace palpate::physics {

/// Describes the contact of a tissue with the tip: surface and law, touching or not; its force is
/// left at zero. With p the penetration, n the normal out of the tissue, v the velocity of the tool
/// relative to the tissue and z the penetration that the tissue has relaxed to:
///
///   f = N n + f_t      N   = k p + k₃ p³ + k₁ (p − z) − b n·v; at least 0 unless adhesive
///                      f_t = −b (v − n (n·v)) if the damping is isotropic, else 0
///
/// In the shell of an inclusion k and b change with place; there f_t has the term −½ p² ∇k too, so
/// that the elastic part is the gradient of the stored energy ½ k p² + ¼ k₃ p⁴ + ½ k₁ (p − z)²
/// everywhere and gives back what it took; the damping only takes.
/// Where a map in a cloud changes k, its gradient is left out: there the force follows the map, and
/// the energy is that of the place.
/// The described law is exact but in such a shell, where it is linear and trusted over an eighth of
/// it.
/// @param surface        seen from the tip's centre
/// @param penetration_m  ≤ 0 where the tip does not touch
/// @param relaxed_m      z
/// @param point_m        the tip's centre, in the tissue's rest frame
[[nodiscard]] Contact describe(const KelvinVoigtMaterial& material, const SurfaceView& surface,
                               double penetration_m, double relaxed_m,
                               const Vector3& point_m) noexcept;

}  // namespace palpate::physics
