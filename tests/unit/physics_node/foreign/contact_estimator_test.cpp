// SPDX-License-Identifier: Apache-2.0
#include "physics_node/foreign/contact_estimator.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "common/contact/contact_model.h"
#include "common/core/random.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/machine/places.h"

namespace palpate::physics {
namespace {

constexpr double kStep_s = 0.01;

Observation half_space(const Vector3& x, const Vector3& v, double k, double b) {
  const double newton = x.z() < 0.0 ? std::max(0.0, -k * x.z() - b * v.z()) : 0.0;
  return {
      .position_m = x, .velocity_m_per_s = v, .force_on_tool_newton = newton * Vector3::UnitZ()};
}

/// A sphere of 50 mm round the origin, 500 N/m.
Observation sphere(const Vector3& x, const Vector3& v) {
  const double r = x.norm();
  return {.position_m = x,
          .velocity_m_per_s = v,
          .force_on_tool_newton = std::max(0.0, 500.0 * (0.05 - r)) * x / r};
}

// 50 mm/s straight down, a sample each 0.5 mm, of which the third is the first to touch.
TEST(ContactEstimator, KnowsAHalfSpaceAtItsThirdTouch) {
  ContactEstimator estimator;
  std::optional<Contact> contact;
  for (const double z_mm : {1.2, 0.5, -0.2, -0.9, -1.7}) {
    contact = estimator.step(half_space({0, 0, 1e-3 * z_mm}, {0, 0, -0.05}, 500.0, 0.0));
  }
  ASSERT_TRUE(contact);
  EXPECT_NEAR(estimator.stiffness_newton_per_m(), 500.0, 10.0);
  EXPECT_NEAR(contact->penetration_m, 1.7e-3, 0.05e-3);
  // a step further on
  EXPECT_GT(contact->trust_radius_m, 1e-3);
  const ModelForce ahead = evaluate(*contact, {0, 0, -1e-3}, {0, 0, -0.05}, 0.0);
  EXPECT_NEAR(ahead.force_on_tool_newton.z(), 500.0 * 2.7e-3, 0.05);
}

// The surface is within the last step: half of it, so k is right to a factor of 2.
TEST(ContactEstimator, GuessesAtTheFirstTouch) {
  ContactEstimator estimator;
  static_cast<void>(estimator.step(half_space({0, 0, 0.3e-3}, {0, 0, -0.05}, 500.0, 0.0)));
  const auto contact = estimator.step(half_space({0, 0, -0.2e-3}, {0, 0, -0.05}, 500.0, 0.0));
  ASSERT_TRUE(contact);
  EXPECT_NEAR(estimator.stiffness_newton_per_m(), 400.0, 1e-9);
  EXPECT_EQ(contact->trust_radius_m, 0.5e-3);
}

TEST(ContactEstimator, TellsDampingFromStiffness) {
  ContactEstimator estimator;
  for (double t_s = 0.0; t_s < 2.0; t_s += kStep_s) {
    static_cast<void>(estimator.step(half_space({0, 0, 0.002 + 0.008 * std::cos(6.0 * t_s)},
                                                {0, 0, -0.048 * std::sin(6.0 * t_s)}, 300.0, 3.0)));
  }
  EXPECT_NEAR(estimator.stiffness_newton_per_m(), 300.0, 15.0);
  EXPECT_NEAR(estimator.damping_newton_s_per_m(), 3.0, 0.5);
}

TEST(ContactEstimator, FollowsTheCurvatureOfASphere) {
  ContactEstimator estimator;
  std::optional<Contact> contact;
  for (double angle = -0.5; angle < 0.5; angle += 0.02) {
    const Vector3 along(std::cos(angle), 0.0, -std::sin(angle));
    contact = estimator.step(
        sphere(Vector3(0.046 * std::sin(angle), 0.0, 0.046 * std::cos(angle)), 0.09 * along));
  }
  ASSERT_TRUE(contact);
  EXPECT_NEAR(contact->curvature_per_m(1, 1), 1.0 / 0.046, 2.0);
}

TEST(ContactEstimator, ExpectsTheSurfaceThatItHasLeft) {
  ContactEstimator estimator;
  for (const double z_mm : {0.5, -0.2, -0.9, -1.7, -2.6, -3.4, -2.7, -2.0, -1.4, -0.8, 0.1}) {
    static_cast<void>(estimator.step(half_space({0, 0, 1e-3 * z_mm}, Vector3::Zero(), 500.0, 0.0)));
  }
  const auto contact = estimator.step(half_space({0.003, 0, 4e-3}, Vector3::Zero(), 500.0, 0.0));
  ASSERT_TRUE(contact);
  EXPECT_NEAR(contact->penetration_m, -4e-3, 0.1e-3);
  const ModelForce back = evaluate(*contact, {0, 0, -6e-3}, Vector3::Zero(), 0.0);
  EXPECT_NEAR(back.force_on_tool_newton.z(), 1.0, 0.1);
  EXPECT_FALSE(estimator.step(half_space({0.1, 0, 4e-3}, Vector3::Zero(), 500.0, 0.0)))
      << "too far to tell";
}

TEST(ContactEstimator, TrustsForcesWithoutALawNowhere) {
  Random random(3);
  ContactEstimator estimator;
  std::optional<Contact> contact;
  for (int i = 0; i < 200; ++i) {
    contact = estimator.step({.position_m = 1e-3 * i * Vector3::UnitX(),
                              .force_on_tool_newton = 3.0 * random.direction()});
    ASSERT_TRUE(contact);
    // what was observed is exact, whatever the model
    EXPECT_LT((evaluate(*contact, Vector3::Zero(), Vector3::Zero(), 0.0).force_on_tool_newton -
               contact->force_on_tool_newton)
                  .norm(),
              1e-9);
  }
  EXPECT_EQ(contact->trust_radius_m, 0.5e-3);
}

// With the engine's normal a force against it is seen: held, as it is.
TEST(ContactEstimator, HoldsAForceThatPulls) {
  ContactEstimator estimator;
  const auto contact = estimator.step({.force_on_tool_newton = {0.0, 0.0, -2.0},
                                       .normal = Vector3::UnitZ(),
                                       .penetration_m = 1e-3});
  ASSERT_TRUE(contact);
  const ModelForce far = evaluate(*contact, {0.01, 0.0, 0.02}, {0.1, 0.0, 0.0}, 0.0);
  EXPECT_LT((far.force_on_tool_newton - Vector3(0.0, 0.0, -2.0)).norm(), 1e-12);
}

TEST(ContactEstimator, DoesNotAllocate) {
  ContactEstimator estimator;
  const test::AllocGuard guard;
  for (double z = 0.002; z > -0.004; z -= 0.0003) {
    static_cast<void>(estimator.step(half_space({0, 0, z}, {0, 0, -0.03}, 500.0, 1.0)));
  }
  EXPECT_EQ(guard.count(), 0U);
}

// The same inputs and outputs as those that the Python package is compared with. Written by
// PALPATE_WRITE_DATA=1.
TEST(ContactEstimator, AgreesWithTheTableOfThePythonPackage) {
  const std::string file = test::source_dir() + "/tests/python/data/estimated.csv";
  std::vector<std::string> lines{"x,y,z,vx,vy,vz,fx,fy,fz,has,penetration,stiffness,damping,trust"};
  ContactEstimator estimator;
  for (int i = 0; i < 150; ++i) {
    const double t = kStep_s * i;
    const Vector3 x(0.02 * std::sin(3.0 * t), 0.005 * t, 0.05 + 0.006 * std::cos(9.0 * t) - 0.003);
    const Vector3 v(0.06 * std::cos(3.0 * t), 0.005, -0.054 * std::sin(9.0 * t));
    Observation seen = sphere(x, v);
    if (i > 120) seen.force_on_tool_newton.x() += 0.5 * std::sin(40.0 * t);
    const auto contact = estimator.step(seen);
    const Vector3& f = seen.force_on_tool_newton;
    std::array<char, 512> line{};
    std::snprintf(
        line.data(), line.size(),
        "%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%d,%.12g,%.12g,%.12g,%.12g", x.x(),
        x.y(), x.z(), v.x(), v.y(), v.z(), f.x(), f.y(), f.z(), contact ? 1 : 0,
        contact ? contact->penetration_m : 0.0, estimator.stiffness_newton_per_m(),
        estimator.damping_newton_s_per_m(), contact ? contact->trust_radius_m : 0.0);
    lines.emplace_back(line.data());
  }
  if (std::getenv("PALPATE_WRITE_DATA") != nullptr) {
    std::ofstream out(file);
    for (const std::string& line : lines) out << line << "\n";
  }
  std::ifstream in(file);
  std::string line;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    ASSERT_TRUE(std::getline(in, line)) << file << " ends at line " << i;
    std::stringstream kept(line);
    std::stringstream now(lines[i]);
    std::string a;
    std::string b;
    while (i > 0 && std::getline(kept, a, ',') && std::getline(now, b, ',')) {
      EXPECT_NEAR(std::stod(a), std::stod(b), 1e-6 * (1e-3 + std::abs(std::stod(b)))) << i;
    }
  }
}

}  // namespace
}  // namespace palpate::physics
