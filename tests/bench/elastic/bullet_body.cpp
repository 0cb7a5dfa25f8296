// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/elastic/bullet_body.h"

#include <BulletSoftBody/btDeformableBodySolver.h>
#include <BulletSoftBody/btDeformableGravityForce.h>
#include <BulletSoftBody/btDeformableLinearElasticityForce.h>
#include <BulletSoftBody/btDeformableMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btDeformableNeoHookeanForce.h>
#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <btBulletDynamicsCommon.h>

#include <cstdint>
#include <set>
#include <utility>

namespace palpate::bench {
namespace {

using elastic::Body;
using elastic::Vector3d;

// Nodes this near to the sphere touch it; the sphere is as much smaller.
constexpr double kMarginRatio = 0.005;  // of its radius
// Bullet looks distances up in a grid, whose cells are to be small beside the sphere.
constexpr double kVoxelRatio = 1.0 / 60.0;  // of its radius

btVector3 bullet(const Vector3d& v) {
  return {static_cast<btScalar>(v.x()), static_cast<btScalar>(v.y()), static_cast<btScalar>(v.z())};
}
Vector3d from_bullet(const btVector3& v) { return {v.x(), v.y(), v.z()}; }

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

}  // namespace

struct BulletBody::World {
  struct Sphere {
    Sphere(const Vector3d& centre_m, double radius_m) : shape(static_cast<btScalar>(radius_m)) {
      move(centre_m);
      body.setCollisionFlags(body.getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
      body.setActivationState(DISABLE_DEACTIVATION);
      body.setWorldTransform(at);
      body.setInterpolationWorldTransform(at);
      body.setFriction(0);
    }
    void move(const Vector3d& centre_m) {
      at.setIdentity();
      at.setOrigin(bullet(centre_m));
      motion.setWorldTransform(at);
    }
    btTransform at;
    btSphereShape shape;
    btDefaultMotionState motion;
    btRigidBody body{btRigidBody::btRigidBodyConstructionInfo(0, &motion, &shape)};
  };

  explicit World(const Body& body) : elasticity(bench::elasticity(body)) {
    const elastic::Mesh& mesh = body.mesh();
    std::vector<btVector3> nodes;
    nodes.reserve(mesh.nodes_m.size());
    for (const Vector3d& at : mesh.nodes_m) nodes.push_back(bullet(at));
    soft = std::make_unique<btSoftBody>(&world.getWorldInfo(), static_cast<int>(nodes.size()),
                                        nodes.data(), nullptr);
    std::set<std::pair<int, int>> edges;
    for (std::size_t e = 0; e < mesh.element_count(); ++e) {
      const auto corner = [&](std::size_t k) { return static_cast<int>(mesh.element(e)[k]); };
      soft->appendTetra(corner(0), corner(1), corner(2), corner(3));
      for (const auto& [a, b] : elastic::kEdges) {
        edges.insert(
            std::minmax(corner(static_cast<std::size_t>(a)), corner(static_cast<std::size_t>(b))));
      }
    }
    // without links the search tree of the nodes is never finished; they carry no force
    for (const auto& [a, b] : edges) soft->appendLink(a, b);
    soft->initializeDmInverse();
    const btMatrix3x3 identity = btMatrix3x3::getIdentity();
    const btSoftBody::TetraScratch rest{identity, 3, 1, identity, identity};
    soft->m_tetraScratches.resize(soft->m_tetras.size(), rest);
    soft->m_tetraScratchesTn.resize(soft->m_tetras.size(), rest);
    for (int i = 0; i < soft->m_nodes.size(); ++i) {
      soft->setMass(i, static_cast<btScalar>(body.mass_kg()[i]));
    }
    for (const std::uint32_t i : body.description().fixed_nodes) {
      soft->setMass(static_cast<int>(i), 0);
    }
    soft->m_cfg.collisions = 0;
    soft->m_sleepingThreshold = 0;
    soft->setActivationState(DISABLE_DEACTIVATION);

    world.setGravity({0, 0, 0});  // of rigid bodies
    world.setImplicit(true);
    world.setLineSearch(false);
    // conjugate gradients; with the default, conjugate residuals, nothing moves at this scale
    world.setUseProjection(true);
    solver.setDeformableSolver(&deformable_solver);
    gravity.m_gravity = bullet(body.description().gravity_m_per_s2);
    world.addSoftBody(soft.get());
    world.addForce(soft.get(), elasticity.get());
    world.addForce(soft.get(), &gravity);
  }
  ~World() {
    if (sphere) world.removeRigidBody(&sphere->body);
    world.removeSoftBody(soft.get());
  }
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  btSoftBodyRigidBodyCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btDeformableBodySolver deformable_solver;
  btDeformableMultiBodyConstraintSolver solver;
  btDeformableMultiBodyDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration,
                                           &deformable_solver};
  std::unique_ptr<btDeformableLagrangianForce> elasticity;
  btDeformableGravityForce gravity{{0, 0, 0}};
  std::unique_ptr<btSoftBody> soft;
  std::unique_ptr<Sphere> sphere;
};

BulletBody::BulletBody(const Body& body) : world_(std::make_unique<World>(body)) {}
BulletBody::~BulletBody() = default;

void BulletBody::step(double dt_s) { world_->world.stepSimulation(static_cast<btScalar>(dt_s), 0); }

Vector3d BulletBody::node_m(std::size_t node) const {
  return from_bullet(world_->soft->m_nodes[static_cast<int>(node)].m_x);
}

void BulletBody::move_fixed_node(std::size_t node, const Vector3d& to_m) {
  btSoftBody::Node& moved = world_->soft->m_nodes[static_cast<int>(node)];
  moved.m_x = moved.m_q = bullet(to_m);
  moved.m_v.setZero();
}

void BulletBody::add_sphere(const Vector3d& centre_m, double radius_m) {
  btSoftBody& soft = *world_->soft;
  const double margin_m = kMarginRatio * radius_m;
  soft.getCollisionShape()->setMargin(static_cast<btScalar>(margin_m));
  soft.m_cfg.collisions = btSoftBody::fCollision::SDF_RD | btSoftBody::fCollision::SDF_RDN;
  soft.m_cfg.kDF = 0;
  auto& distances = world_->world.getWorldInfo().m_sparsesdf;
  distances.setDefaultVoxelsz(static_cast<btScalar>(kVoxelRatio * radius_m));
  distances.Reset();
  // With the defaults, 0.06 and 0.01 and split impulses, less than half of the force is there.
  btContactSolverInfo& contact = world_->world.getSolverInfo();
  contact.m_splitImpulse = 0;
  contact.m_deformable_erp = 1;
  contact.m_deformable_cfm = 0;
  world_->sphere = std::make_unique<World::Sphere>(centre_m, radius_m - margin_m);
  world_->world.addRigidBody(&world_->sphere->body);
}

void BulletBody::move_sphere(const Vector3d& centre_m) { world_->sphere->move(centre_m); }

std::vector<Vector3d> BulletBody::elastic_newton() {
  btSoftBody& soft = *world_->soft;
  for (int i = 0; i < soft.m_nodes.size(); ++i) soft.m_nodes[i].m_q = soft.m_nodes[i].m_x;
  soft.advanceDeformation();
  btDeformableLagrangianForce::TVStack forces;
  forces.resize(soft.m_nodes.size(), btVector3(0, 0, 0));
  world_->elasticity->addScaledForces(1, forces);
  std::vector<Vector3d> newton;
  newton.reserve(static_cast<std::size_t>(soft.m_nodes.size()));
  for (int i = 0; i < soft.m_nodes.size(); ++i) {
    newton.push_back(from_bullet(forces[soft.m_nodes[i].index]));
  }
  return newton;
}

}  // namespace palpate::bench
