// obstacle.h — what pushes on an elastic body from outside.
#pragma once

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
};

}  // namespace palpate::elastic
