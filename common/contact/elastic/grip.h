// SPDX-License-Identifier: Apache-2.0
// grip.h — the slip of tissue in the jaws of a tool: mofc_node computes it between two messages,
// physics_node between two full solutions of the body, or after each of them.
#pragma once

#include <algorithm>

#include "common/core/vector.h"

namespace palpate {

struct GripSlip {
  Vector3 force_on_tool_newton = Vector3::Zero();  ///< afterwards
  Vector3 slip_m = Vector3::Zero();                ///< of the tool past the tissue
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

/// Energy that held tissue stores a way further, at least 0.
/// @param force_on_tool_newton  before the way, elastic
[[nodiscard]] inline double stored_joule_after(const Vector3& way_m, double stored_joule,
                                               const Vector3& force_on_tool_newton,
                                               const Matrix3& stiffness_newton_per_m) noexcept {
  return std::max(0.0, stored_joule - way_m.dot(force_on_tool_newton) +
                           0.5 * way_m.dot(stiffness_newton_per_m * way_m));
}

}  // namespace palpate
