// SPDX-License-Identifier: Apache-2.0
// sphere_sweep.h — contact of a rigid sphere with points of the surface of an elastic body, whose
// compliance is known: physics_node solves it between two full solutions of the body, mofc_node
// between two messages.
#pragma once

#include <cstddef>

#include "common/core/vector.h"

namespace palpate {

/// Rows of a compliance are padded to a multiple of this with zeros.
inline constexpr std::size_t kCompliancePadding = 16;

/// The points that may touch, in a state of the body with forces on it, and the sphere. Arrays are
/// `count` long; what has three numbers a point is 3 · count.
struct SphereSweep {
  std::size_t count = 0;
  /// 3 count × 3 count, symmetric, column-major; each column is `stride` long.
  const float* compliance_m_per_newton = nullptr;
  std::size_t stride = 0;           ///< a multiple of kCompliancePadding, ≥ 3 count
  double compliance_ratio = 1.0;    ///< times the matrix
  const Vector3* base_m = nullptr;  ///< without what the compliance adds
  const double* rigid_give_m_per_newton = nullptr;  ///< of the penalty of a point that is held fast
  /// Points that give way to their penalty besides, at any pace: a node of theirs is fixed. What
  /// the sphere presses them in is left in their places.
  const char* is_held = nullptr;
  Vector3* normals = nullptr;        ///< scratch
  Vector3* forces_newton = nullptr;  ///< on the body; warm start, and result
  float* moved_m = nullptr;          ///< that the compliance adds under these forces, `stride` long

  Vector3 center_m = Vector3::Zero();
  double radius_m = 0.0;

  /// Normals follow what the points have moved from here along `along`, the unit normal of the
  /// surface, and half of what they have moved aside. Rest compliance lets points that are pressed
  /// hard slide round the sphere; normals that turned with them would drive them on. Null: normals
  /// follow the points.
  const Vector3* still_m = nullptr;
  Vector3 along = Vector3::UnitZ();

  /// By point, out of the sphere, unit: the normal of a point in the sphere stays within 60° of it,
  /// so that one that the centre has passed is pushed on, and does not pull it through. Zero: any
  /// direction. Null: none has one.
  const Vector3* axes = nullptr;

  double friction_coefficient = 0.0;   ///< 0: way_m is unused
  Vector3 way_m = Vector3::Zero();     ///< of the sphere since the last sweep
  const Vector3* reached_m = nullptr;  ///< the points at its end

  /// A viscous body goes this share of the way from reached_m to where the forces want it; 1: all
  /// of it, and reached_m is used by friction alone.
  double pace = 1.0;
};

struct SweepEffort {
  int sweeps = 0;
  int changes = 0;  ///< of a force
};

/// Gauss–Seidel: unilateral, Coulomb friction. At most so many sweeps, and changes of a force.
/// Normals are those at the beginning: if they turned with the points, sweeps would not converge.
/// No allocation, no throw. Time: count · sweeps + 9 count · changes.
SweepEffort sweep(const SphereSweep& sphere, int most_sweeps, int most_changes,
                  double tolerance_m) noexcept;

/// Where a point is under the forces of the last sweep.
[[nodiscard]] Vector3 place_of(const SphereSweep& sphere, std::size_t point) noexcept;

/// The pace of a body that relaxes like this, in a step of some length.
/// @param relaxation_s  with the ratio of the compliance   @param step_s  0: it comes to rest
[[nodiscard]] inline double pace_of(double relaxation_s, double step_s) noexcept {
  return step_s > 0.0 ? step_s / (step_s + relaxation_s) : 1.0;
}

/// y += ratio · M x for the three columns M of the point; y is `stride` long.
void add_columns(const SphereSweep& sphere, std::size_t point, const Vector3& x, float* y) noexcept;

}  // namespace palpate
