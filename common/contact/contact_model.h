// SPDX-License-Identifier: Apache-2.0
// contact_model.h — the tissue near the tool, small enough to send: physics_node describes it in an
// Interaction, mofc_node evaluates it at the device's rate, between two messages.
//
//   d  displacement from the reference, relative to the tissue
//   a  its part along n₀             t  its part along the surface
//   p  penetration, Δ = p − p₀       n  normal; Q turns n₀ into n
//   H  Hessian of the distance       κ  curvature in the plane of n₀ and t, tᵀH t / |t|²
//   K  ∂f/∂x, negative for a spring  B  ∂f/∂v
//
// Surface. In the plane of n₀ and t it is the circle of curvature κ:
//
//   p = p₀ − (2a + κ (a² + |t|²)) / (1 + √((1 + κa)² + κ²|t|²))       n ∝ (1 + κa) n₀ + H t
//
// exact for planes, spheres and (along and across) cylinders; otherwise to second order.
//
// Law. f = Q [ f₀ + K (t − Δ n₀) + (c₂ Δ² + c₃ Δ³) n₀ ] + Q B Qᵀ (v − v_surface) for p > 0, else 0.
// f₀ has the share −k_t s of Coulomb friction too: s = u₀ + t, shortened where k_t |s| > μ N, N the
// elastic force along n₀. So the tip sticks until it slips, but only physics_node moves the place
// where it sticks (TissueMemory): between two messages a slip that reverses returns the energy that
// it absorbed, and a change of N while slipping may add energy, at most that of the stretch. The
// energy ledger of the controller bounds that like any other error of the model.
// With an exponent the law is that of [Hunt75] instead, N = k p (p/p₁)ⁿ⁻¹ along n, damped by
// b (p/p₁)ⁿ: f₀, K, B, c₂ and c₃ are not used.
// The part of f along n is at least 0 unless the tissue is adhesive. Exact for Kelvin–Voigt tissue
// with cubic stiffening and for Hunt–Crossley tissue on these surfaces.
#pragma once

#include <cstdint>
#include <span>

#include "common/core/messages.h"
#include "common/core/vector.h"

namespace palpate {

/// The action of one tissue, or of all, on the tool at one position and velocity; W.
struct ModelForce {
  Vector3 force_on_tool_newton = Vector3::Zero();
  double stored_energy_joule = 0.0;  ///< ≥ 0
  bool is_touching = false;
  Vector3 torque_on_tool_newton_m = Vector3::Zero();  ///< about the tip

  /// Adds a share of another one.
  void add(double share, const ModelForce& other) noexcept {
    force_on_tool_newton += share * other.force_on_tool_newton;
    torque_on_tool_newton_m += share * other.torque_on_tool_newton_m;
    stored_energy_joule += share * other.stored_energy_joule;
    is_touching = is_touching || other.is_touching;
  }
};

/// The contact at a tool displaced by `displacement_m` from the reference and moving at `velocity`,
/// `age_s` ≥ 0 after the reference: the surface has kept its velocity.
///
/// Beyond the trust radius the tissue is as at its edge, but never presses harder than the surface,
/// continued, would let it: min(1, p/p_edge) of the force there, 0 once that surface is left.
/// The force acts at the end of the contact's arm, which moves along with the tool without turning.
/// Finite input gives a finite force unless numbers overflow. No allocation, no throw.
[[nodiscard]] ModelForce evaluate(const Contact& contact, const Vector3& displacement_m,
                                  const ToolVelocity& velocity, double age_s) noexcept;

/// The stretch of friction's spring that slips where it pulls harder than μ N: `wanted_m`, or as
/// much of it as holds. Zero without normal force.
[[nodiscard]] Vector3 friction_stretch(const Vector3& wanted_m, double friction_coefficient,
                                       double friction_stiffness_newton_per_m,
                                       double normal_newton) noexcept;

/// The stretch after the sphere has moved: it turns with the surface and slips.
[[nodiscard]] Vector3 rubbed_stretch(const Vector3& stretch_m, const Vector3& moved_m,
                                     const Vector3& normal, double friction_coefficient,
                                     double friction_stiffness_newton_per_m,
                                     double normal_newton) noexcept;

/// Gives a contact friction with this stretch, and the energy in it.
void add_friction(double friction_coefficient, double friction_stiffness_newton_per_m,
                  const Vector3& stretch_m, Contact& contact) noexcept;

/// The law of Hunt and Crossley [Hunt75] along the normal, for the penetration p.
struct HuntCrossleyForce {
  double elastic_newton = 0.0;          ///< k p (p/p₁)ⁿ⁻¹
  double stiffness_newton_per_m = 0.0;  ///< its derivative
  double damping_newton_s_per_m = 0.0;  ///< b (p/p₁)ⁿ
  double stored_energy_joule = 0.0;     ///< k p² (p/p₁)ⁿ⁻¹ / (n + 1)
};
/// @param contact  with an exponent n ≥ 1; nothing else of it but k, b and p₁ is used
/// @param penetration_m  ≤ 0: all zero
[[nodiscard]] HuntCrossleyForce hunt_crossley(const Contact& contact,
                                              double penetration_m) noexcept;

/// How much of a tissue's force does not come from its contact model.
struct TissueShare {
  std::uint32_t tissue = 0;
  double share = 0.0;  ///< 0 … 1
};

/// All contacts of an Interaction at a tool that is at `tool_position_world_m`, each less the share
/// of its tissue, without those that its jaws hold (elastic/grip.h). Touches that are not listed
/// keep the force they had. Zero where it would not be finite.
[[nodiscard]] ModelForce evaluate(const Interaction& interaction,
                                  const Vector3& tool_position_world_m,
                                  const ToolVelocity& tool_velocity_world, double age_s,
                                  std::span<const TissueShare> shares = {}) noexcept;

/// The listed contacts of one tissue.
[[nodiscard]] ModelForce evaluate_tissue(const Interaction& interaction, std::uint32_t tissue,
                                         const Vector3& tool_position_world_m,
                                         const ToolVelocity& tool_velocity_world,
                                         double age_s) noexcept;

/// The force of the Interaction, unchanged wherever the tool goes (zero-order hold).
[[nodiscard]] ModelForce held(const Interaction& interaction) noexcept;

}  // namespace palpate
