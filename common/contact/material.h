// SPDX-License-Identifier: Apache-2.0
// material.h — the contact law of a tissue: force and stiffness for a given surface and
// penetration.
#pragma once

#include "common/contact/surface_view.h"
#include "common/core/messages.h"
#include "common/core/tissue.h"
#include "common/core/vector.h"

namespace palpate {

/// The contact of a tissue with a sphere of the tool: surface and law, touching or not. The total
/// force of the contact stays zero. With p the penetration, n the normal out of the tissue, v the
/// velocity of the tool relative to the tissue and z the penetration that the tissue has relaxed
/// to:
///
///   f = N n + f_t      N   = k p + k₃ p³ + k₁ (p − z) − b n·v; at least 0 unless adhesive
///                      f_t = −b (v − n (n·v)) if the damping is isotropic, else 0
///
/// In the shell of an inclusion k and b vary with the position. There f_t also has the term
/// −½ p² ∇k, so that the elastic part is everywhere the gradient of the stored energy
/// ½ k p² + ¼ k₃ p⁴ + ½ k₁ (p − z)² and does no work around a closed path; the damping dissipates.
/// Where a stiffness map of a cloud varies k, the term with its gradient is omitted: the force
/// follows the map, and the energy is that of the local k.
/// With an exponent it is the law of Hunt and Crossley [Hunt75] instead,
///
///   N = k p (p/p₁)ⁿ⁻¹ − b (p/p₁)ⁿ n·v; at least 0 unless adhesive
///
/// whose damping sets in and ends without a jump; the stored energy is k p² (p/p₁)ⁿ⁻¹ / (n + 1).
/// The contact describes the law exactly, except in such a shell, where it is linear and trusted
/// over an eighth of the shell.
/// @param surface        seen from the sphere's centre
/// @param penetration_m  ≤ 0 where the sphere does not touch
/// @param relaxed_m      z
/// @param point_m        the sphere's centre, in the tissue's rest frame
[[nodiscard]] Contact describe(const KelvinVoigtMaterial& material, const SurfaceView& surface,
                               double penetration_m, double relaxed_m,
                               const Vector3& point_m) noexcept;

}  // namespace palpate
