// SPDX-License-Identifier: Apache-2.0
// bullet_engine.h — Bullet as the physics: a soft block and a sphere that the tool pulls.
#pragma once

#include <BulletSoftBody/btDeformableBodySolver.h>
#include <BulletSoftBody/btDeformableMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <btBulletDynamicsCommon.h>

#include <memory>
#include <vector>

#include "physics_node/engines/bullet/soft_block.h"
#include "physics_node/sdk/physics.h"

namespace palpate::engines {

struct BlockMaterial {
  double young_pascal = 10e3;
  double poisson_ratio = 0.4;
  double density_kg_per_m3 = 1000.0;
};

/// A block of 100 × 100 × 50 mm, fixed below, whose upper face is z = 0, in
/// btDeformableMultiBodyDynamicsWorld. Bullet tells no force of a deformable body on a kinematic
/// one; so the tip is a dynamic sphere, coupled to the tool by a spring and a damper, whose force
/// is what the tool feels while the sphere touches the block ([Colgate95], virtual coupling). The
/// contact model is estimated from that force.
class BulletEngine final : public sdk::Engine {
 public:
  /// @throws sdk::SetupError  if the tip is not a sphere that Bullet can use
  BulletEngine(const sdk::Setup& setup, const BlockMaterial& material);
  ~BulletEngine() override;
  BulletEngine(const BulletEngine&) = delete;
  BulletEngine& operator=(const BulletEngine&) = delete;

  sdk::Answer step(const sdk::Motion& motion) override;
  std::vector<sdk::Surface> surfaces() override;
  bool deformed(std::size_t surface, std::vector<float>& vertices_m) override;

 private:
  void add_block(const BlockMaterial& material);
  void place_tip(const sdk::Vector3& position_m);
  /// Of the coupling, on the tool.
  [[nodiscard]] sdk::Vector3 coupling_newton(const sdk::Vector3& position_m,
                                             const sdk::Vector3& velocity_m_per_s) const;

  btSoftBodyRigidBodyCollisionConfiguration configuration_;
  btCollisionDispatcher dispatcher_{&configuration_};
  btDbvtBroadphase broadphase_;
  btDeformableBodySolver deformable_solver_;
  btDeformableMultiBodyConstraintSolver solver_;
  btDeformableMultiBodyDynamicsWorld world_{&dispatcher_, &broadphase_, &solver_, &configuration_,
                                            &deformable_solver_};
  std::unique_ptr<btDeformableLagrangianForce> elasticity_;
  std::unique_ptr<btSoftBody> block_;
  btSphereShape sphere_;
  std::unique_ptr<btRigidBody> tip_;
  int steps_ = 1;  // of Bullet for one of physics
  btScalar period_s_ = 0;
  bool is_placed_ = false;
  sdk::Vector3 tool_m_ = sdk::Vector3::Zero();  // where it was
};

}  // namespace palpate::engines
