// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "physics_node/elastic/dynamics.h"
#include "tests/bench/tissue/soft_body.h"
#include "tests/bench/tissue/tissue_problems.h"

namespace palpate::bench {
namespace {

using elastic::Vector3d;
using elastic::VectorXd;

class ElasticSoftBody : public SoftBody {
 public:
  explicit ElasticSoftBody(elastic::BodyDescription description)
      : body_(std::move(description)),
        lower_(lower_end(body_.mesh())),
        dynamics_(body_, {.theta = 1.0, .tolerance_m = 1e-5, .most_rounds = 4}) {}

  void step(double dt_s) override {
    if (turn_rad_) {
      VectorXd x = dynamics_.x_m();
      for (const std::uint32_t node : lower_) {
        x.segment<3>(3 * Eigen::Index{node}) = turned(body_.mesh().nodes_m[node], *turn_rad_);
      }
      dynamics_.set_state(x, dynamics_.v_m_per_s());
    }
    dynamics_.step(dt_s, contact_ ? &*contact_ : nullptr);
    if (contact_) contact_->update_multipliers(dynamics_.x_m().data(), body_.pattern());
  }

  void move_sphere(const Vector3d& centre_m) override {
    if (!contact_) {
      const bool is_linear = body_.mesh().nodes_per_element == 4;
      // as the tissue of a session: 100 Young's moduli per radius
      contact_.emplace(top_of_slab(body_.mesh(), is_linear ? 1 : 2),
                       100.0 * kYoung_pa / kSphereRadius_m);
    }
    contact_->set_sphere(centre_m, kSphereRadius_m);
    contact_->choose_near(dynamics_.x_m().data(), kSphereRadius_m);
  }

  void turn_lower_end(double angle_rad) override { turn_rad_ = angle_rad; }

  double sag_m() override {
    double least_m = 0.0;
    for (const std::uint32_t node : lower_) {
      least_m = std::min(least_m, dynamics_.x_m()[3 * Eigen::Index{node} + 2]);
    }
    return -least_m;
  }

  double force_on_sphere_newton() override { return contact_->force_on_sphere_newton().z(); }

  double torque_newton_m() override {
    const VectorXd& x = dynamics_.x_m();
    VectorXd gradient = VectorXd::Zero(x.size());
    elastic::ElementBatches batches = body_.new_batches();
    elastic::add_gradient(batches, x.data(), 0.0, gradient.data());
    double torque = 0.0;
    for (const std::uint32_t node : lower_) {
      const Eigen::Index i = 3 * Eigen::Index{node};
      torque +=
          (x[i] - 0.5 * kBarSide_m) * gradient[i + 1] - (x[i + 1] - 0.5 * kBarSide_m) * gradient[i];
    }
    return torque;
  }

 private:
  elastic::Body body_;
  std::vector<std::uint32_t> lower_;
  elastic::Dynamics dynamics_;
  std::optional<elastic::SphereContact> contact_;
  std::optional<double> turn_rad_;
};

}  // namespace

std::unique_ptr<SoftBody> elastic_soft_body(elastic::BodyDescription description) {
  return std::make_unique<ElasticSoftBody>(std::move(description));
}

}  // namespace palpate::bench
