// SPDX-License-Identifier: Apache-2.0
// tie.h — what ties a point of an elastic body to one of another body, while that one stands still.
#pragma once

#include "physics_node/elastic/attached/tearing.h"
#include "physics_node/elastic/sphere_contact.h"

namespace palpate::elastic {

/// One spring as one of its two bodies has it: the other end is where the other body has it now.
/// Both bodies see the same potential of the way between the two ends, so that action is reaction.
struct Tie {
  SurfacePoint point;                     ///< of this body
  CohesiveSpring spring;                  ///< outward: of this body, towards the other one
  Vector3d place_m = Vector3d::Zero();    ///< where the point would have no force
  double in_body_newton_per_m = 0.0;      ///< of a spring that the body itself has from the point
  Vector3d in_body_m = Vector3d::Zero();  ///< to here

  [[nodiscard]] Separation separation(const double* x_m) const noexcept {
    return separation_of(point.position_m(x_m) - place_m, spring.outward);
  }

  // as an obstacle; see obstacle.h
  double add_gradient(const double* x_m, double* gradient) const noexcept;
  void add_stiffness(const double* x_m, const BlockPattern& pattern, BlockValues& values) const;
};

}  // namespace palpate::elastic
