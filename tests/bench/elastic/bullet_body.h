// SPDX-License-Identifier: Apache-2.0
// bullet_body.h — an elastic body computed by Bullet, for the benches that compare it with ours:
// the same mesh, masses and material, float, no damping but that of backward Euler.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "physics_node/elastic/body.h"

namespace palpate::bench {

/// In a world of its own. Fixed nodes have no mass and stay where they are put.
class BulletBody {
 public:
  explicit BulletBody(const elastic::Body& body);
  ~BulletBody();
  BulletBody(const BulletBody&) = delete;
  BulletBody& operator=(const BulletBody&) = delete;

  /// @param dt_s > 0
  void step(double dt_s);
  [[nodiscard]] elastic::Vector3d node_m(std::size_t node) const;
  /// @pre  the node is fixed
  void move_fixed_node(std::size_t node, const elastic::Vector3d& to_m);

  /// Adds a rigid sphere without friction that goes where it is put. @pre  there is none
  void add_sphere(const elastic::Vector3d& centre_m, double radius_m);
  /// Where it is at the next step.
  void move_sphere(const elastic::Vector3d& centre_m);

  /// What its elements do to each node, at the positions of now [N].
  [[nodiscard]] std::vector<elastic::Vector3d> elastic_newton();

 private:
  struct World;
  std::unique_ptr<World> world_;
};

}  // namespace palpate::bench
