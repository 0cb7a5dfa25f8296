// SPDX-License-Identifier: Apache-2.0
// plane_contact.h — points of an elastic body that must stay in front of planes: what is left of a
// contact with a surface while it is linearised there.
#pragma once

#include <cstdint>
#include <vector>

#include "common/core/tissue.h"
#include "physics_node/elastic/body.h"
#include "physics_node/elastic/condensed/condensed_contact.h"
#include "physics_node/elastic/obstacle.h"
#include "physics_node/elastic/sphere_contact.h"

namespace palpate::elastic {

/// One point in front of one plane. Unilateral: it presses, and never pulls. Augmented Lagrangian
/// [Nocedal06]: with the gap g = normal·x − offset,
///
///   f = max(0, λ − k g)         potential (f² − λ²)/2k
///
/// and Coulomb friction with the limit τ = µ f of the round before (Tresca), which is a potential
/// too: of the way u of the point from its anchor within the plane, ½ k u² while k u ≤ τ, then
/// τ u − τ²/2k. Both are convex, so that a search over planes that stand still converges.
struct ContactPlane {
  SurfacePoint point;                    ///< of the body
  Vector3d normal = Vector3d::UnitZ();   ///< unit, out of what it touches
  double offset_m = 0.0;                 ///< normal·x is at least this
  double stiffness_newton_per_m = 0.0;   ///< k > 0
  double multiplier_newton = 0.0;        ///< λ ≥ 0
  double friction_coefficient = 0.0;     ///< µ
  double limit_newton = 0.0;             ///< τ
  Vector3d anchor_m = Vector3d::Zero();  ///< where friction holds it
  palpate::TissueMotionConfig motion{};  ///< of what it is a plane of

  [[nodiscard]] double gap_m(const double* x_m) const noexcept {
    return normal.dot(point.position_m(x_m)) - offset_m;
  }
  [[nodiscard]] double pressing_newton(const double* x_m) const noexcept {
    return std::max(0.0, multiplier_newton - stiffness_newton_per_m * gap_m(x_m));
  }
  /// From the anchor, within the plane.
  [[nodiscard]] Vector3d slid_m(const double* x_m) const noexcept {
    const Vector3d way_m = point.position_m(x_m) - anchor_m;
    return way_m - normal.dot(way_m) * normal;
  }
  /// On the body, with friction, where the last step ended.
  [[nodiscard]] Vector3d force_on_body_newton(const double* x_m) const noexcept;
  /// Friction holds it: it does not slip.
  [[nodiscard]] bool is_stuck(const double* x_m) const noexcept {
    return limit_newton > 0.0 && stiffness_newton_per_m * slid_m(x_m).norm() < limit_newton;
  }

  // as an obstacle; see obstacle.h
  double add_gradient(const double* x_m, double* gradient) const noexcept;
  void add_stiffness(const double* x_m, const BlockPattern& pattern, BlockValues& values) const;
  /// The end of a round: λ becomes the force, at most that of this depth, and τ follows it.
  void update_multiplier(const double* x_m, double deepest_m) noexcept;
  /// The end of a step: the anchor comes along where the point slips or has left.
  void slip(const double* x_m) noexcept;
};

/// After a support along a normal: two more of its point, across that, where friction holds it.
void add_across(std::vector<Support>& supports);

/// The directions in which planes that press hold a body: their normals, and within them where
/// friction holds it too.
/// @param x_m  where the last step ended
[[nodiscard]] std::vector<Support> supports_of(const std::vector<ContactPlane>& planes,
                                               const double* x_m);

/// Area of the surface that each of its nodes stands for: thirds of linear faces. Of quadratic ones
/// a twelfth at each corner and a quarter at each middle of an edge, so that none is 0. By node.
[[nodiscard]] std::vector<double> areas_of_nodes_m2(const Mesh& mesh,
                                                    const std::vector<Face>& faces);

/// Penalty k of a node: that many moduli times the length of its area.
[[nodiscard]] double contact_stiffness_newton_per_m(double young_pa, double area_m2,
                                                    double moduli) noexcept;

}  // namespace palpate::elastic
