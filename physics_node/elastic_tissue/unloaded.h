// SPDX-License-Identifier: Apache-2.0
// unloaded.h — the shape of a body without load, from its shape under load.
#pragma once

#include "physics_node/elastic/body.h"

namespace palpate::elastic {

struct UnloadedShape {
  Mesh mesh;          ///< without load; where it is held as in the loaded one
  VectorXd loaded_m;  ///< where it rests under the load
  /// To be added to the load, 3 per node [N]: edges of the mesh without load are straight, so that
  /// some would bend under gravity, their middles by a millimetre; this keeps them straight.
  VectorXd more_load_newton;
  double away_m = 0.0;  ///< largest distance of a node at rest from its place in the given mesh
  int solutions = 0;
  bool is_converged = false;
};

/// The inverse problem of gravity: X with x(X) = the given shape, x(X) where the body X rests, as
/// the fixed point of X + given − x(X) [Sellier11], which Anderson's mixing accelerates. It may not
/// exist, or not be found, where the body is too soft for its weight.
/// @param loaded  its mesh in the shape that it has under its gravity
/// @throws std::invalid_argument  as Body
[[nodiscard]] UnloadedShape find_unloaded_shape(const BodyDescription& loaded);

}  // namespace palpate::elastic
