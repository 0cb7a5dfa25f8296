// SPDX-License-Identifier: Apache-2.0
// soft_body.h — a soft body as the problems of tissue_bench drive it, whoever computes it.
#pragma once

#include <cmath>
#include <memory>

#include "physics_node/elastic/body.h"

namespace palpate::bench {

/// What a program cannot do is left at these defaults, and no row asks for it.
class SoftBody {
 public:
  virtual ~SoftBody() = default;
  /// @param dt_s > 0
  virtual void step(double dt_s) = 0;
  /// Where the sphere is at the end of the next step. The first call brings it in.
  virtual void move_sphere(const elastic::Vector3d& /*centre_m*/) {}
  /// How far the lower end of the bar is turned at the end of the next step.
  virtual void turn_lower_end(double /*angle_rad*/) {}

  /// The largest way down of a node of the lower end [m].
  [[nodiscard]] virtual double sag_m() { return NAN; }
  /// Upwards [N].
  [[nodiscard]] virtual double force_on_sphere_newton() { return NAN; }
  /// That the lower end needs to be held there [N·m].
  [[nodiscard]] virtual double torque_newton_m() { return NAN; }
};

/// By the classes of physics_node/elastic.
[[nodiscard]] std::unique_ptr<SoftBody> elastic_soft_body(elastic::BodyDescription description);
/// By the tissue library, from the text of a scene. Quadratic elements are made of linear ones.
/// @pre  mesh is linear; law is the stable neo-Hookean one; one end is held
[[nodiscard]] std::unique_ptr<SoftBody> library_soft_body(
    const elastic::BodyDescription& description, bool is_quadratic);
/// By Bullet; null where it was not installed when this was built.
[[nodiscard]] std::unique_ptr<SoftBody> bullet_soft_body(elastic::BodyDescription description);

}  // namespace palpate::bench
