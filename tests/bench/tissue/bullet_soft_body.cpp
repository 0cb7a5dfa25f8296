// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#ifdef PALPATE_HAS_BULLET
#include "tests/bench/elastic/bullet_body.h"
#endif
#include "tests/bench/tissue/soft_body.h"
#include "tests/bench/tissue/tissue_problems.h"

namespace palpate::bench {

#ifdef PALPATE_HAS_BULLET

namespace {

using elastic::Vector3d;

class BulletSoftBody : public SoftBody {
 public:
  explicit BulletSoftBody(elastic::BodyDescription description)
      : body_(std::move(description)), lower_(lower_end(body_.mesh())), bullet_(body_) {}

  void step(double dt_s) override { bullet_.step(dt_s); }

  void move_sphere(const Vector3d& centre_m) override {
    if (!std::exchange(has_sphere_, true)) bullet_.add_sphere(centre_m, kSphereRadius_m);
    bullet_.move_sphere(centre_m);
  }

  void turn_lower_end(double angle_rad) override {
    for (const std::uint32_t node : lower_) {
      bullet_.move_fixed_node(node, turned(body_.mesh().nodes_m[node], angle_rad));
    }
  }

  double sag_m() override {
    double least_m = 0.0;
    for (const std::uint32_t node : lower_) {
      least_m = std::min(least_m, bullet_.node_m(node).z());
    }
    return -least_m;
  }

  /// At rest the elements push down on the held side with the force of the sphere.
  double force_on_sphere_newton() override {
    const std::vector<Vector3d> newton = bullet_.elastic_newton();
    double force = 0.0;
    for (const std::uint32_t node : lower_) force -= newton[node].z();
    return force;
  }

  double torque_newton_m() override {
    const std::vector<Vector3d> newton = bullet_.elastic_newton();
    double torque = 0.0;
    for (const std::uint32_t node : lower_) {
      const Vector3d x = bullet_.node_m(node);
      torque -= (x.x() - 0.5 * kBarSide_m) * newton[node].y() -
                (x.y() - 0.5 * kBarSide_m) * newton[node].x();
    }
    return torque;
  }

 private:
  elastic::Body body_;
  std::vector<std::uint32_t> lower_;
  BulletBody bullet_;
  bool has_sphere_ = false;
};

}  // namespace

std::unique_ptr<SoftBody> bullet_soft_body(elastic::BodyDescription description) {
  return std::make_unique<BulletSoftBody>(std::move(description));
}

#else

std::unique_ptr<SoftBody> bullet_soft_body(elastic::BodyDescription /*description*/) {
  return nullptr;
}

#endif

}  // namespace palpate::bench
