// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/body.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>

#include "physics_node/elastic/equilibrium.h"
#include "tests/bench/elastic/elastic_problems.h"
#include "tests/property/seeds.h"
#include "tests/unit/elastic/random_shape.h"

namespace palpate::elastic {
namespace {

Mesh small_mesh(bool is_quadratic) {
  const Mesh linear = beam_mesh(3, 1);
  return is_quadratic ? quadratic(linear) : linear;
}

double energy(ElementBatches& batches, const VectorXd& x, double step_s, VectorXd& gradient) {
  gradient = VectorXd::Zero(x.size());
  return add_gradient(batches, x.data(), step_s, gradient.data());
}

struct Case {
  Law law;
  bool is_quadratic;
  bool is_viscous;
};
std::vector<Case> cases() {
  std::vector<Case> all;
  for (const Law law : kAllLaws) {
    for (const bool is_quadratic : {false, true}) {
      for (const bool is_viscous : {false, true}) all.push_back({law, is_quadratic, is_viscous});
    }
  }
  return all;
}

// Central differences: their error is of the order of step² and rounding / step.
TEST(ElasticBody, ForcesAreTheDerivativeOfTheEnergyAndStiffnessThatOfTheForces) {
  for (const Case& one : cases()) {
    SCOPED_TRACE(testing::Message() << static_cast<int>(one.law) << " quadratic "
                                    << one.is_quadratic << " viscous " << one.is_viscous);
    const Body body({.mesh = small_mesh(one.is_quadratic),
                     .materials = {{.young_modulus_pa = 1e3,
                                    .poisson_ratio = 0.4,
                                    .stiffness_damping_s = one.is_viscous ? 0.01 : 0.0}},
                     .law = one.law,
                     .fixed_nodes = {0}});
    ElementBatches batches = body.new_batches();
    const double h = 0.02;
    // the shape before the step; the tangent of the viscous part is taken there
    const VectorXd x = random_shape(body, 2e-3, 1);
    remember(batches, x.data());
    VectorXd gradient;
    VectorXd ahead;
    VectorXd behind;
    energy(batches, x, h, gradient);
    BlockValues values;
    body.stiffness(x, no_rotations(body.node_count()),
                   {.per_viscosity = one.is_viscous ? 1.0 / h : 0.0}, false, values);
    const BlockPattern& pattern = body.pattern();
    constexpr double kStep = 1e-7;
    for (std::uint32_t j = 0; j < pattern.size(); j += 3) {
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        const Eigen::Index k = 3 * Eigen::Index{pattern.nodes[j]} + axis;
        VectorXd moved = x;
        moved[k] = x[k] + kStep;
        const double above = energy(batches, moved, h, ahead);
        moved[k] = x[k] - kStep;
        const double below = energy(batches, moved, h, behind);
        EXPECT_NEAR((above - below) / (2 * kStep), gradient[k], 1e-6 * gradient.norm());
        const VectorXd column = (ahead - behind) / (2 * kStep);
        for (std::uint32_t s = pattern.starts[j]; s < pattern.starts[j + 1]; ++s) {
          for (Eigen::Index r = 0; r < 3; ++r) {
            EXPECT_NEAR(values[9 * std::size_t{s} + static_cast<std::size_t>(3 * r + axis)],
                        column[3 * Eigen::Index{pattern.nodes[pattern.rows[s]]} + r],
                        1e-5 * column.norm());
          }
        }
      }
    }
  }
}

TEST(ElasticBody, ARigidMotionCostsNoEnergyAndNoForce) {
  for (const Case& one : cases()) {
    const Body body({.mesh = small_mesh(one.is_quadratic), .law = one.law, .fixed_nodes = {0}});
    ElementBatches batches = body.new_batches();
    const Eigen::AngleAxisd turn(2.5, Vector3d(1, 2, -1).normalized());
    VectorXd x = body.rest_m();
    for (Eigen::Index i = 0; i < x.size(); i += 3) {
      x.segment<3>(i) = turn * Vector3d(x.segment<3>(i)) + Vector3d(0.3, -0.1, 0.2);
    }
    VectorXd gradient;
    // E V is 0.6 J for a strain of 1
    EXPECT_NEAR(energy(batches, x, 0.0, gradient), 0.0, 1e-15);
    EXPECT_LT(gradient.cwiseAbs().maxCoeff(), 1e-9);
  }
}

// The same strain everywhere: the nodes within are in balance, and the energy is that of one point.
TEST(ElasticBody, PassesThePatchTestInEveryLaw) {
  Eigen::Matrix3d F;
  F << 1.1, 0.2, 0.0, -0.1, 0.9, 0.05, 0.1, 0.0, 1.05;
  for (const Case& one : cases()) {
    const Mesh linear =
        box_mesh(graded_planes(0.1, 3, 0.02), equal_planes(0, 0.05, 3), equal_planes(0, 0.05, 3));
    const Mesh mesh = one.is_quadratic ? quadratic(linear) : linear;
    const Body body({.mesh = mesh, .law = one.law, .fixed_nodes = {0}});
    ElementBatches batches = body.new_batches();
    VectorXd x = body.rest_m();
    for (Eigen::Index i = 0; i < x.size(); i += 3)
      x.segment<3>(i) = F * body.rest_m().segment<3>(i);
    VectorXd gradient;
    const double joule = energy(batches, x, 0.0, gradient);
    for (std::uint32_t i = 0; i < mesh.nodes_m.size(); ++i) {
      const Vector3d& at = mesh.nodes_m[i];
      const bool is_within = at.x() > 1e-9 && at.x() < 0.1 - 1e-9 && at.y() > 1e-9 &&
                             at.y() < 0.05 - 1e-9 && at.z() > 1e-9 && at.z() < 0.05 - 1e-9;
      if (!is_within) continue;
      EXPECT_LT(gradient.segment<3>(3 * Eigen::Index{i}).norm(), 1e-12);
    }
    if (one.law != Law::kStVenantKirchhoff) continue;
    const Material material;
    const Eigen::Matrix3d E = 0.5 * (F.transpose() * F - Eigen::Matrix3d::Identity());
    EXPECT_NEAR(
        joule,
        0.1 * 0.05 * 0.05 *
            (material.mu() * E.squaredNorm() + 0.5 * material.lambda() * E.trace() * E.trace()),
        1e-12);
  }
}

// ν = 0, two halves in series: the softer one takes the larger part, ε₁ E₁ = ε₂ E₂.
TEST(ElasticBody, TwoMaterialsInSeriesShareTheStretch) {
  Mesh mesh = beam_mesh(8, 2);
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    double x = 0.0;
    for (const std::uint32_t node : mesh.element(e)) x += 0.25 * mesh.nodes_m[node].x();
    mesh.regions.push_back(x < 0.05 ? 0 : 1);
  }
  const auto ends =
      nodes_where(mesh, [](const Vector3d& x) { return x.x() < 1e-9 || x.x() > 0.1 - 1e-9; });
  const Body body({.mesh = mesh,
                   .materials = {{.young_modulus_pa = 1e3, .poisson_ratio = 0.0},
                                 {.young_modulus_pa = 3e3, .poisson_ratio = 0.0}},
                   .fixed_nodes = ends});
  VectorXd x = body.rest_m();
  for (const std::uint32_t node : ends) {
    if (mesh.nodes_m[node].x() > 0.05) x[3 * Eigen::Index{node}] += 1e-3;
  }
  EquilibriumSearch search(body);
  WarpedFactor factor(body, Precision::kDouble);
  ASSERT_TRUE(find_rest(search, factor, nullptr, {.tolerance_m = 1e-9}, x).is_converged);
  for (const std::uint32_t node :
       nodes_where(mesh, [](const Vector3d& at) { return std::abs(at.x() - 0.05) < 1e-9; })) {
    EXPECT_NEAR(x[3 * Eigen::Index{node}] - 0.05, 0.75e-3, 1e-8);
  }
}

// References: 27-node hexahedra, converged (23.19 mm); linear elements are 16 % too stiff there.
TEST(ElasticBody, QuadraticElementsDoNotLock) {
  const auto sag_m = [](const Mesh& mesh, double nu) {
    const Body body(bench::hanging_beam(mesh, Law::kCorotational, 100e3, nu));
    EquilibriumSearch search(body);
    WarpedFactor factor(body, Precision::kDouble);
    VectorXd x = body.rest_m();
    EXPECT_TRUE(find_rest(search, factor, nullptr, {.tolerance_m = 1e-6}, x).is_converged);
    return body.rest_m()[bench::tip_of(mesh)] - x[bench::tip_of(mesh)];
  };
  const Mesh coarse = quadratic(beam_mesh(8, 2));
  EXPECT_EQ(coarse.nodes_m.size(), 393U);
  EXPECT_NEAR(sag_m(coarse, 0.45), 23.19e-3, 0.02 * 23.19e-3);
  if (test::kIsSanitized) return;
  EXPECT_NEAR(sag_m(coarse, 0.30), 23.65e-3, 0.02 * 23.65e-3);
  EXPECT_NEAR(sag_m(beam_mesh(16, 4), 0.45), 0.84 * 23.19e-3, 0.01 * 23.19e-3);
  // nearly incompressible: a few per cent less than at 0.45, not half
  EXPECT_NEAR(sag_m(coarse, 0.49), sag_m(coarse, 0.45), 0.05 * 23.19e-3);
}

TEST(ElasticBody, RefusesWhatCannotBeSimulated) {
  const BodyDescription good{.mesh = beam_mesh(2, 1), .fixed_nodes = {0}};
  EXPECT_NO_THROW(Body{good});
  const auto refuses = [&](const std::function<void(BodyDescription&)>& spoil) {
    BodyDescription bad = good;
    spoil(bad);
    EXPECT_THROW(Body{bad}, std::invalid_argument);
  };
  refuses([](BodyDescription& b) { b.fixed_nodes.clear(); });
  refuses([](BodyDescription& b) { b.fixed_nodes = {12345}; });
  refuses([](BodyDescription& b) { b.materials[0].poisson_ratio = 0.5; });
  refuses([](BodyDescription& b) { b.materials[0].poisson_ratio = -1.0; });
  refuses([](BodyDescription& b) { b.materials[0].young_modulus_pa = 0.0; });
  refuses([](BodyDescription& b) { b.materials[0].density_kg_per_m3 = -1.0; });
  refuses([](BodyDescription& b) { b.materials[0].stiffness_damping_s = -1.0; });
  refuses([](BodyDescription& b) { b.materials.clear(); });
  refuses([](BodyDescription& b) { std::swap(b.mesh.elements[0], b.mesh.elements[1]); });
  refuses([](BodyDescription& b) { b.mesh.elements[0] = 999; });
  refuses([](BodyDescription& b) { b.mesh.elements.pop_back(); });
  refuses([](BodyDescription& b) { b.mesh.elements.clear(); });
  refuses([](BodyDescription& b) { b.mesh.nodes_m[0].x() = std::nan(""); });
  refuses([](BodyDescription& b) { b.mesh.nodes_m.emplace_back(0, 0, 0); });
  refuses([](BodyDescription& b) { b.mesh.regions.assign(b.mesh.element_count(), 1); });
  refuses([](BodyDescription& b) { b.mesh.nodes_per_element = 5; });
}

// Converged from the undeformed shape in one search, and again from there with new rotations: the
// same place, so the first search did not end too early.
TEST(ElasticBody, ASearchForTheRestEndsWhereAnotherOneFindsNothingLeft) {
  const Mesh beam = test::kIsSanitized ? beam_mesh(8, 2) : beam_mesh(16, 4);
  for (const Law law : kAllLaws) {
    const Body body(bench::hanging_beam(beam, law, 100e3, 0.45));
    EquilibriumSearch search(body);
    WarpedFactor factor(body, Precision::kDouble);
    VectorXd x = body.rest_m();
    ASSERT_TRUE(find_rest(search, factor, nullptr, {.tolerance_m = 1e-6}, x).is_converged);
    VectorXd again = x;
    EquilibriumSearch other(body);
    WarpedFactor fresh(body, Precision::kDouble);
    for (int round = 0; round < 3; ++round) {
      ASSERT_TRUE(find_rest(other, fresh, nullptr, {.tolerance_m = 1e-8}, again).is_converged);
    }
    EXPECT_LT((again - x).cwiseAbs().maxCoeff(), 2e-5) << static_cast<int>(law);
  }
}

}  // namespace
}  // namespace palpate::elastic
