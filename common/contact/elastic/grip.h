// SPDX-License-Identifier: Apache-2.0
// grip.h — the slip of tissue in the jaws of a tool, along a needle or a blade: mofc_node computes
// it between two messages, physics_node between two full solutions of the body, or after each of
// them.
#pragma once

#include <algorithm>

#include "common/core/messages.h"
#include "common/core/vector.h"

namespace palpate {

/// A step of the tool of no length counts as one of this length, where a way becomes a velocity.
inline constexpr double kLeastStep_s = 1e-4;

struct GripSlip {
  Vector3 force_on_tool_newton = Vector3::Zero();  ///< afterwards
  Vector3 slip_m = Vector3::Zero();                ///< of the tool past the tissue
  bool is_out = false;                             ///< a needle has left its hole
};

/// Coulomb friction in the jaws: as long as the force is larger than they hold, the tool slips past
/// the tissue against the force on it. With K the stiffness of the held tissue and μ ≥ 0
///
///   F' = F + K s,  s = −μ F'   ⇒   F' = (I + μ K)⁻¹ F,   |F'| = most_newton
///
/// an implicit step, which dissipates μ |F'|² whatever the force was. Without need: F, no slip. If
/// that is not finite the force is cut to most_newton, and nothing slips. No allocation, no throw.
/// @param stiffness_newton_per_m  symmetric, positive definite   @param most_newton  > 0
[[nodiscard]] GripSlip slip_in_jaws(const Vector3& force_on_tool_newton,
                                    const Matrix3& stiffness_newton_per_m,
                                    double most_newton) noexcept;

/// A needle at the depth z of a hole that ends at z₀. With d its direction of insertion, k = d·K d
/// and the push p = −F·d on the tissue, it goes by s along d
///
///   inward   while p > Y(z), so far that p − k s = Y(z + s),  Y(z) = S + R(z) (+ C beyond z₀)
///   outward  while p < −R(z), so far that p − k s = −R(z), at most out of the hole
///
/// C cuts (toughness × width), S spreads, R(z) = R₀ + φ z is the friction: Y grows with the depth,
/// so that there is one such s, and p − k s has its sign: the step dissipates (p − k s) s whatever
/// the force was. Across, and without need, it holds. F' = F + K d s. At the end of the hole it
/// stands still where it has not yet the force to cut. If a result is not finite there is no force
/// and no slip. No allocation, no throw.
///
/// A blade cuts along d in the same way, with C = toughness × length of its edge in the tissue, and
/// φ = 0, and slides along its edge e, ⊥ d, by Coulomb's law with R: |F'·e| ≤ R. Both hold at once
/// in the one implicit step, which dissipates. Across both, in the normal of its plane, it never
/// yields.
/// @param stiffness_newton_per_m  symmetric, positive definite
/// @param needle  there; all of it ≥ 0
[[nodiscard]] GripSlip slip_of_needle(const Vector3& force_on_tool_newton,
                                      const Matrix3& stiffness_newton_per_m,
                                      const NeedleLaw& needle, double depth_m) noexcept;

/// The one of both that the grip has. Notes how deep the hole is then.
/// @param slip_m  so far
[[nodiscard]] GripSlip slip_of(Grip& grip, const Vector3& slip_m,
                               const Vector3& force_on_tool_newton,
                               const Matrix3& stiffness_newton_per_m) noexcept;

/// Energy that held tissue stores a way further, at least 0.
/// @param force_on_tool_newton  before the way, elastic
[[nodiscard]] inline double stored_joule_after(const Vector3& way_m, double stored_joule,
                                               const Vector3& force_on_tool_newton,
                                               const Matrix3& stiffness_newton_per_m) noexcept {
  return std::max(0.0, stored_joule - way_m.dot(force_on_tool_newton) +
                           0.5 * way_m.dot(stiffness_newton_per_m * way_m));
}

}  // namespace palpate
