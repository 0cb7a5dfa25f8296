// SPDX-License-Identifier: Apache-2.0
// obstacle.h — what pushes on an elastic body from outside.
#pragma once

#include <limits>

#include "physics_node/elastic/linear/block_matrix.h"

namespace palpate::elastic {

/// A potential of the node positions. Called with positions of 3 per node.
class Obstacle {
 public:
  virtual ~Obstacle() = default;
  /// Adds the gradient; returns the potential [J]. No allocation.
  virtual double add_gradient(const double* x_m, double* gradient) const = 0;
  /// Adds a positive semidefinite stiffness to the blocks.
  virtual void add_stiffness(const double* x_m, const BlockPattern& pattern,
                             BlockValues& values) const = 0;
  /// Adds the second derivative of the potential, also where it is negative.
  virtual void add_exact_stiffness(const double* x_m, const BlockPattern& pattern,
                                   BlockValues& values) const {
    add_stiffness(x_m, pattern, values);
  }
  /// Where a search ended: whether it shall go on from there, because the potential is another now
  /// (an augmented Lagrangian whose multipliers have changed).
  virtual bool begin_round(const double* /*x_m*/, const BlockPattern& /*pattern*/) { return false; }
  /// It acts as in the step before, so that a body that has come to rest under it may sleep.
  [[nodiscard]] virtual bool is_still() const { return false; }
  /// No node moves further in one iteration of a search, so that none jumps across the obstacle.
  [[nodiscard]] virtual double longest_correction_m() const {
    return std::numeric_limits<double>::infinity();
  }
};

}  // namespace palpate::elastic
