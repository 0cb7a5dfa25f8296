// SPDX-License-Identifier: Apache-2.0
#include "physics_node/engines/bullet/bullet_engine.h"

#include <BulletSoftBody/btDeformableLinearElasticityForce.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace palpate::engines {
namespace {

using sdk::Vector3;

constexpr double kLongestStep_s = 2.5e-3;  // a fourth of the coupling's time constant
constexpr btScalar kTip_kg = 0.05F;
constexpr double kCoupling_newton_per_m = 500.0;
constexpr double kCoupling_newton_s_per_m = 10.0;  // critical damping of the tip
constexpr double kLeastRadius_m = 2e-3;            // below, the tip slips through the faces
constexpr btScalar kMargin_m = 0.5e-3F;            // Bullet's default is 40 mm
constexpr btScalar kVoxel_m = 2e-3F;               // of the distance field of the tip
constexpr btScalar kElasticDamping_s = 0.01F;

btVector3 bullet(const Vector3& v) {
  return {static_cast<btScalar>(v.x()), static_cast<btScalar>(v.y()), static_cast<btScalar>(v.z())};
}
Vector3 eigen(const btVector3& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

BulletEngine::BulletEngine(const sdk::Setup& setup, const BlockMaterial& material)
    : sphere_(static_cast<btScalar>(setup.tip_radius_m)) {
  if (setup.tip_radius_m < kLeastRadius_m) {
    throw sdk::SetupError("scene.tool.tip_radius_m = " + std::to_string(setup.tip_radius_m) +
                          ": must be at least 0.002 for bullet_physics_node; a smaller tip slips "
                          "through the block");
  }
  steps_ = std::max(1, static_cast<int>(std::ceil(1.0 / (setup.rate_hz * kLongestStep_s) - 1e-6)));
  period_s_ = static_cast<btScalar>(1.0 / (setup.rate_hz * steps_));

  solver_.setDeformableSolver(&deformable_solver_);
  world_.setGravity({0, 0, 0});
  // lengths of Bullet's own scenes are metres: these settings make millimetres work
  world_.getWorldInfo().m_sparsesdf.setDefaultVoxelsz(kVoxel_m);
  world_.getWorldInfo().m_sparsesdf.Reset();
  // of the solver: with that of the world too, contacts would give no impulse
  deformable_solver_.setImplicit(true);
  deformable_solver_.setLineSearch(false);
  world_.setUseProjection(true);
  world_.getSolverInfo().m_deformable_erp = 0.2F;
  world_.getSolverInfo().m_deformable_cfm = 0;
  world_.getSolverInfo().m_leastSquaresResidualThreshold = 1e-6F;
  world_.getSolverInfo().m_numIterations = 50;
  add_block(material);

  btVector3 inertia;
  sphere_.calculateLocalInertia(kTip_kg, inertia);
  tip_ = std::make_unique<btRigidBody>(kTip_kg, nullptr, &sphere_, inertia);
  tip_->setActivationState(DISABLE_DEACTIVATION);
  tip_->setFriction(0);
  tip_->setAngularFactor(0);
  world_.addRigidBody(tip_.get());
}

BulletEngine::~BulletEngine() {
  world_.removeRigidBody(tip_.get());
  world_.removeSoftBody(block_.get());
}

void BulletEngine::add_block(const BlockMaterial& material) {
  block_ = soft_block(world_.getWorldInfo(), {}, material.density_kg_per_m3);
  block_->getCollisionShape()->setMargin(kMargin_m);
  block_->m_cfg.kDF = 0;
  block_->m_cfg.kDP = 0;
  // the faces against rigid bodies; SDF_RD alone finds no contact
  block_->m_cfg.collisions = btSoftBody::fCollision::SDF_RD | btSoftBody::fCollision::SDF_RDF;
  block_->setSelfCollision(false);
  block_->m_sleepingThreshold = 0;
  world_.addSoftBody(block_.get());
  const double e = material.young_pascal;
  const double nu = material.poisson_ratio;
  elasticity_ = std::make_unique<btDeformableLinearElasticityForce>(
      static_cast<btScalar>(0.5 * e / (1.0 + nu)),
      static_cast<btScalar>(e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))), kElasticDamping_s,
      kElasticDamping_s);
  world_.addForce(block_.get(), elasticity_.get());
}

/// At rest and outside the block, even if the tool begins inside.
void BulletEngine::place_tip(const Vector3& position_m) {
  const Vector3 outside(position_m.x(), position_m.y(),
                        std::max(position_m.z(), sphere_.getRadius() + 2.0 * kMargin_m));
  const btTransform place(btQuaternion::getIdentity(), bullet(outside));
  tip_->setWorldTransform(place);
  tip_->setInterpolationWorldTransform(place);
}

Vector3 BulletEngine::coupling_newton(const Vector3& position_m,
                                      const Vector3& velocity_m_per_s) const {
  return kCoupling_newton_per_m * (eigen(tip_->getWorldTransform().getOrigin()) - position_m) +
         kCoupling_newton_s_per_m * (eigen(tip_->getLinearVelocity()) - velocity_m_per_s);
}

sdk::Answer BulletEngine::step(const sdk::Motion& motion) {
  if (!is_placed_) {
    place_tip(motion.position_m);
    tool_m_ = motion.position_m;
  }
  is_placed_ = true;
  // Each step begins with tip and tool at the same time. A tool that stands where it will be at the
  // end lets the tip run ahead of it: K v h / 2 less force on the way in, more on the way out.
  const Vector3 moved_m = (motion.position_m - tool_m_) / steps_;
  for (int i = 0; i < steps_; ++i) {
    tip_->clearForces();
    tip_->applyCentralForce(bullet(-coupling_newton(tool_m_, motion.velocity_m_per_s)));
    world_.stepSimulation(period_s_, 0);
    tool_m_ += moved_m;
  }
  tool_m_ = motion.position_m;
  const bool is_touching = block_->m_faceRigidContacts.size() > 0;
  return {.force_on_tool_newton = is_touching
                                      ? coupling_newton(motion.position_m, motion.velocity_m_per_s)
                                      : Vector3::Zero()};
}

std::vector<sdk::Surface> BulletEngine::surfaces() {
  sdk::Surface surface{.name = "soft block", .vertices_m = {}, .triangles = {}};
  const btSoftBody::Node* const first = &block_->m_nodes[0];
  for (int i = 0; i < block_->m_faces.size(); ++i) {
    for (const btSoftBody::Node* node : block_->m_faces[i].m_n) {
      surface.triangles.push_back(static_cast<std::uint32_t>(node - first));
    }
  }
  deformed(0, surface.vertices_m);
  return {surface};
}

bool BulletEngine::deformed(std::size_t surface, std::vector<float>& vertices_m) {
  static_cast<void>(surface);
  vertices_m.clear();
  for (int i = 0; i < block_->m_nodes.size(); ++i) {
    const btVector3& at = block_->m_nodes[i].m_x;
    vertices_m.insert(vertices_m.end(), {at.x(), at.y(), at.z()});
  }
  return true;
}

}  // namespace palpate::engines
