// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/elastic/bullet_rows.h"

#include <BulletSoftBody/btDeformableBodySolver.h>
#include <BulletSoftBody/btDeformableGravityForce.h>
#include <BulletSoftBody/btDeformableLinearElasticityForce.h>
#include <BulletSoftBody/btDeformableMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btDeformableNeoHookeanForce.h>
#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <btBulletDynamicsCommon.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <set>
#include <utility>

#include "tests/bench/elastic/elastic_problems.h"

namespace palpate::bench {
namespace {

using elastic::Body;

btVector3 bullet(const elastic::Vector3d& v) {
  return {static_cast<btScalar>(v.x()), static_cast<btScalar>(v.y()), static_cast<btScalar>(v.z())};
}

/// Bullet's element of the same law. Its neo-Hookean one takes Lamé values with which it agrees
/// with Hooke's law at small strain only after the conversion of [Smith18].
std::unique_ptr<btDeformableLagrangianForce> elasticity(const Body& body) {
  const elastic::Material& material = body.description().materials[0];
  const double nu = material.poisson_ratio;
  const double mu = 0.5 * material.young_modulus_pa / (1.0 + nu);
  const double lambda = 2.0 * mu * nu / (1.0 - 2.0 * nu);
  if (body.description().law == elastic::Law::kStableNeoHookean) {
    return std::make_unique<btDeformableNeoHookeanForce>(
        static_cast<btScalar>(4.0 / 3.0 * mu), static_cast<btScalar>(lambda + 5.0 / 6.0 * mu),
        0.0F);
  }
  return std::make_unique<btDeformableLinearElasticityForce>(
      static_cast<btScalar>(mu), static_cast<btScalar>(lambda), 0.0F, 0.0F);
}

/// The body in a world of its own.
class BulletBody {
 public:
  explicit BulletBody(const Body& body)
      : tip_(static_cast<int>(tip_of(body.mesh()) / 3)), elasticity_(elasticity(body)) {
    const elastic::Mesh& mesh = body.mesh();
    std::vector<btVector3> nodes;
    nodes.reserve(mesh.nodes_m.size());
    for (const elastic::Vector3d& at : mesh.nodes_m) nodes.push_back(bullet(at));
    soft_ = std::make_unique<btSoftBody>(&world_.getWorldInfo(), static_cast<int>(nodes.size()),
                                         nodes.data(), nullptr);
    std::set<std::pair<int, int>> edges;
    for (std::size_t e = 0; e < mesh.element_count(); ++e) {
      const auto corner = [&](std::size_t k) { return static_cast<int>(mesh.element(e)[k]); };
      soft_->appendTetra(corner(0), corner(1), corner(2), corner(3));
      for (const auto& [a, b] : elastic::kEdges) {
        edges.insert(
            std::minmax(corner(static_cast<std::size_t>(a)), corner(static_cast<std::size_t>(b))));
      }
    }
    // without links the search tree of the nodes is never finished; they carry no force
    for (const auto& [a, b] : edges) soft_->appendLink(a, b);
    soft_->initializeDmInverse();
    const btMatrix3x3 identity = btMatrix3x3::getIdentity();
    const btSoftBody::TetraScratch rest{identity, 3, 1, identity, identity};
    soft_->m_tetraScratches.resize(soft_->m_tetras.size(), rest);
    soft_->m_tetraScratchesTn.resize(soft_->m_tetras.size(), rest);
    for (int i = 0; i < soft_->m_nodes.size(); ++i) {
      soft_->setMass(i, static_cast<btScalar>(body.mass_kg()[i]));
    }
    for (const std::uint32_t i : body.description().fixed_nodes) {
      soft_->setMass(static_cast<int>(i), 0);
    }
    soft_->m_cfg.collisions = 0;
    soft_->m_sleepingThreshold = 0;
    soft_->setActivationState(DISABLE_DEACTIVATION);

    world_.setGravity({0, 0, 0});  // of rigid bodies
    world_.setImplicit(true);
    world_.setLineSearch(false);
    // conjugate gradients; with the default, conjugate residuals, nothing moves at this scale
    world_.setUseProjection(true);
    solver_.setDeformableSolver(&deformable_solver_);
    gravity_.m_gravity = bullet(body.description().gravity_m_per_s2);
    world_.addSoftBody(soft_.get());
    world_.addForce(soft_.get(), elasticity_.get());
    world_.addForce(soft_.get(), &gravity_);
  }
  ~BulletBody() { world_.removeSoftBody(soft_.get()); }
  BulletBody(const BulletBody&) = delete;
  BulletBody& operator=(const BulletBody&) = delete;

  void step(double dt_s) { world_.stepSimulation(static_cast<btScalar>(dt_s), 0); }
  [[nodiscard]] double tip_z_m() const { return soft_->m_nodes[tip_].m_x.z(); }

 private:
  btSoftBodyRigidBodyCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_{&configuration_};
  btDbvtBroadphase broadphase_;
  btDeformableBodySolver deformable_solver_;
  btDeformableMultiBodyConstraintSolver solver_;
  btDeformableMultiBodyDynamicsWorld world_{&dispatcher_, &broadphase_, &solver_, &configuration_,
                                            &deformable_solver_};
  int tip_;
  std::unique_ptr<btDeformableLagrangianForce> elasticity_;
  btDeformableGravityForce gravity_{{0, 0, 0}};
  std::unique_ptr<btSoftBody> soft_;
};

/// One step, its times added to the samples in µs.
void measured_step(BulletBody& bullet, double dt_s, Samples& wall, Samples& cpu) {
  const double from_wall = wall_s();
  const double from_cpu = cpu_s();
  bullet.step(dt_s);
  cpu.values.push_back(1e6 * (cpu_s() - from_cpu));
  wall.values.push_back(1e6 * (wall_s() - from_wall));
}

}  // namespace

Row bullet_step_row(const BeamSize& size, const Body& body, std::span<const double> converged_m) {
  const PeakMemory memory;
  BulletBody bullet(body);
  const double start_m = bullet.tip_z_m();
  Samples wall;
  Samples cpu;
  double error_m = 0.0;
  double way_m = 0.0;
  for (const double wanted_m : converged_m) {
    measured_step(bullet, 1e-3, wall, cpu);
    error_m = std::max(error_m, std::abs(bullet.tip_z_m() - wanted_m));
    way_m = std::max(way_m, std::abs(wanted_m - start_m));
  }
  return {.figures = {.problem = "step 1 ms",
                      .mesh = size.name,
                      .solver = "Bullet linear",
                      .median_us = wall.at(0.5),
                      .p99_us = wall.at(0.99),
                      .error_ratio = error_m / way_m},
          .cpu_median_us = cpu.at(0.5),
          .cpu_p99_us = cpu.at(0.99),
          .peak_mb = memory.megabytes()};
}

Row bullet_static_row(const BeamSize& size, const Body& body, double reference_m) {
  constexpr double kStep_s = 20e-3;
  constexpr std::size_t kMost = 200;
  constexpr std::size_t kStill = 10;  // steps in which the tip moves by less than 0.01 %
  const PeakMemory memory;
  BulletBody bullet(body);
  const double start_m = bullet.tip_z_m();
  Samples wall;
  Samples cpu;
  std::vector<double> way_m;
  std::size_t still = 0;
  while (way_m.size() < kMost && still < kStill) {
    measured_step(bullet, kStep_s, wall, cpu);
    const double moved_m = start_m - bullet.tip_z_m();
    still = !way_m.empty() && std::abs(moved_m - way_m.back()) < 1e-4 * moved_m ? still + 1 : 0;
    way_m.push_back(moved_m);
  }
  const double end_m = way_m.back();
  std::size_t steps = way_m.size();
  while (steps > 1 && std::abs(way_m[steps - 2] - end_m) < 0.01 * std::abs(end_m)) --steps;
  double total_s = 0.0;
  for (std::size_t i = 0; i < steps; ++i) total_s += 1e-6 * cpu.values[i];
  const bool is_neo_hookean = body.description().law == elastic::Law::kStableNeoHookean;
  return {.figures = {.problem = "static",
                      .mesh = size.name,
                      .solver = is_neo_hookean ? "Bullet NH" : "Bullet linear",
                      .median_us = wall.at(0.5),
                      .p99_us = wall.at(0.99),
                      .total_s = total_s,
                      .error_ratio = still == kStill ? end_m / reference_m - 1.0 : NAN},
          .cpu_median_us = cpu.at(0.5),
          .cpu_p99_us = cpu.at(0.99),
          .peak_mb = memory.megabytes()};
}

}  // namespace palpate::bench
