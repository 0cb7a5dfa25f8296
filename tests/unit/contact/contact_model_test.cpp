// SPDX-License-Identifier: Apache-2.0
// The equations of contact_model.h, one by one. That the model agrees with the tissue is tested
// in tests/unit/physics_node/scene_property_test.cpp.
#include "common/contact/contact_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "common/core/random.h"

namespace palpate {
namespace {

const Vector3 kAtRest = Vector3::Zero();

// A floor of 500 N/m, touched 2 mm deep: 1 N, 1 mJ.
Contact floor_contact() {
  return {.penetration_m = 0.002,
          .elastic_force_on_tool_newton = {0, 0, 1.0},
          .d_force_d_position = Vector3(0, 0, -500).asDiagonal(),
          .stored_energy_joule = 0.001,
          .trust_radius_m = 1.0};
}

TEST(ContactModel, GivesTheReferenceForceAtTheReference) {
  const ModelForce force = evaluate(floor_contact(), {0, 0, 0}, kAtRest, 0.0);

  EXPECT_EQ(force.force_on_tool_newton, Vector3(0, 0, 1));
  EXPECT_EQ(force.stored_energy_joule, 0.001);
  EXPECT_TRUE(force.is_touching);
}

// 1 mm deeper: 1.5 N, ½·500·(3 mm)² = 2.25 mJ; 3 mm out: left.
TEST(ContactModel, FollowsTheToolInAndOut) {
  const ModelForce deeper = evaluate(floor_contact(), {0.7, 0, -0.001}, kAtRest, 0.0);
  EXPECT_NEAR(deeper.force_on_tool_newton.z(), 1.5, 1e-12);
  EXPECT_NEAR(deeper.stored_energy_joule, 2.25e-3, 1e-15);

  const ModelForce out = evaluate(floor_contact(), {0, 0, 0.003}, {0, 0, -1}, 0.0);
  EXPECT_EQ(out.force_on_tool_newton, Vector3(0, 0, 0));
  EXPECT_EQ(out.stored_energy_joule, 0.0);
  EXPECT_FALSE(out.is_touching);
}

// The law c₂ Δ² + c₃ Δ³ at Δ = 1 mm: 1e5·1e-6 + 1e7·1e-9 = 0.11 N more; its energy
// c₂ Δ³/3 + c₃ Δ⁴/4 = 33.3 + 2.5 µJ more.
TEST(ContactModel, Stiffens) {
  Contact contact = floor_contact();
  contact.stiffening_newton_per_m2 = 1e5;
  contact.stiffening_newton_per_m3 = 1e7;

  const ModelForce force = evaluate(contact, {0, 0, -0.001}, kAtRest, 0.0);

  EXPECT_NEAR(force.force_on_tool_newton.z(), 1.61, 1e-12);
  EXPECT_NEAR(force.stored_energy_joule, 2.25e-3 + 1e-4 / 3.0 + 2.5e-6, 1e-12);
}

/// 500 N/m at 1 mm, n = 1.5, 20 N·s/m there, touched 2 mm deep: 1 N · √2 = 1.414 N.
Contact hertzian_contact() {
  Contact contact = floor_contact();
  contact.hunt_crossley_exponent = 1.5;
  contact.hunt_crossley_depth_m = 1e-3;
  contact.hunt_crossley_stiffness_newton_per_m = 500.0;
  contact.hunt_crossley_damping_newton_s_per_m = 20.0;
  return contact;
}

// 4 mm deep: 500 · 4e-3 · √4 = 4 N, stored 500 · (4e-3)² · √4 / 2.5 = 6.4 mJ, damped by 20 · 4^1.5
// = 160 N·s/m; sinking at 10 mm/s: 1.6 N more. The linear part of the contact is not used.
TEST(ContactModel, FollowsHuntAndCrossley) {
  const Contact contact = hertzian_contact();
  const ModelForce still = evaluate(contact, {0.7, 0, -0.002}, kAtRest, 0.0);
  EXPECT_NEAR(still.force_on_tool_newton.z(), 4.0, 1e-12);
  EXPECT_NEAR(still.stored_energy_joule, 6.4e-3, 1e-15);
  EXPECT_NEAR(evaluate(contact, {0, 0, -0.002}, {0.5, 0, -0.01}, 0.0).force_on_tool_newton.z(), 5.6,
              1e-12);
  EXPECT_EQ(evaluate(contact, {0, 0, -0.002}, {0, 0, 1.0}, 0.0).force_on_tool_newton.z(), 0.0)
      << "it does not pull";
  EXPECT_NEAR(hunt_crossley(contact, 4e-3).stiffness_newton_per_m, 1.5 * 500.0 * 2.0, 1e-9);
}

// One count before and after the surface: 20 N·s/m · 0.055^1.5 at 0.1 m/s is 26 mN, where a damper
// of Kelvin and Voigt begins with 2 N.
TEST(ContactModel, HuntAndCrossleyBeginWithoutAJump) {
  const Contact contact = hertzian_contact();
  const Vector3 fast(0, 0, -0.1);
  EXPECT_EQ(evaluate(contact, {0, 0, 0.002 + 1e-9}, fast, 0.0).force_on_tool_newton.z(), 0.0);
  EXPECT_LT(evaluate(contact, {0, 0, 0.002 - 1e-9}, fast, 0.0).force_on_tool_newton.z(), 1e-6);
  EXPECT_LT(evaluate(contact, {0, 0, 0.002 - 55e-6}, fast, 0.0).force_on_tool_newton.z(), 0.04);
}

// In and out at several speeds: what the tool supplies is never less than what is stored.
TEST(ContactModel, HuntAndCrossleyArePassive) {
  const Contact contact = hertzian_contact();
  for (const double frequency_hz : {1.0, 5.0, 30.0}) {
    double supplied_joule = 0.0;
    constexpr int kSteps = 20'000;
    const double dt_s = 1.0 / frequency_hz / kSteps;
    for (int k = 0; k < 2 * kSteps; ++k) {
      const double angle = 2.0 * std::numbers::pi * (k + 0.5) / kSteps;
      const double rate = 2.0 * std::numbers::pi * frequency_hz;
      const Vector3 d(0, 0, 0.002 + 0.003 * std::sin(angle));
      const Vector3 v(0, 0, 0.003 * rate * std::cos(angle));
      const ModelForce force = evaluate(contact, d, v, 0.0);
      supplied_joule -= force.force_on_tool_newton.dot(v) * dt_s;
      ASSERT_GE(force.force_on_tool_newton.z(), 0.0);
      ASSERT_GE(supplied_joule, force.stored_energy_joule - 1e-7) << frequency_hz << " Hz";
    }
    EXPECT_GT(supplied_joule, 1e-5);
  }
}

// k_t 500 N/m stretched by 0.5 mm, μ 0.5 of 1 N: it holds to 1 mm, 1 mm deeper to 1.5 mm.
TEST(ContactModel, SticksAndSlips) {
  Contact contact = floor_contact();
  contact.friction_coefficient = 0.5;
  contact.friction_stiffness_newton_per_m = 500.0;
  contact.stretch_m = {0.5e-3, 0, 0};
  contact.stored_energy_joule += 0.5 * 500.0 * 0.25e-6;
  const auto at = [&](double x_m, double z_m) {
    return evaluate(contact, {x_m, 0, z_m}, kAtRest, 0.0);
  };

  EXPECT_NEAR(at(0.0, 0.0).force_on_tool_newton.x(), -0.25, 1e-12);
  EXPECT_NEAR(at(0.0, 0.0).stored_energy_joule, contact.stored_energy_joule, 1e-15);
  EXPECT_NEAR(at(0.3e-3, 0.0).force_on_tool_newton.x(), -0.4, 1e-12);
  EXPECT_NEAR(at(2e-3, 0.0).force_on_tool_newton.x(), -0.5, 1e-12);
  EXPECT_NEAR(at(2e-3, 0.0).stored_energy_joule, 1e-3 + 0.25e-3, 1e-15);
  EXPECT_NEAR(at(2e-3, -1e-3).force_on_tool_newton.x(), -0.75, 1e-12);
  EXPECT_NEAR(at(-2e-3, 0.0).force_on_tool_newton.x(), 0.5, 1e-12);
  EXPECT_EQ(at(2e-3, 3e-3).force_on_tool_newton, Vector3(0, 0, 0));
  EXPECT_NEAR(at(2e-3, 0.0).force_on_tool_newton.z(), 1.0, 1e-12);
}

// Damping 10 N·s/m along the normal, leaving at 0.3 m/s: 1 − 3 N would pull.
TEST(ContactModel, PullsOnlyIfAdhesive) {
  Contact contact = floor_contact();
  contact.d_force_d_velocity = Vector3(0, 0, -10).asDiagonal();

  EXPECT_EQ(evaluate(contact, {0, 0, 0}, {0, 0, 0.3}, 0.0).force_on_tool_newton, Vector3(0, 0, 0));
  contact.is_adhesive = true;
  EXPECT_NEAR(evaluate(contact, {0, 0, 0}, {0, 0, 0.3}, 0.0).force_on_tool_newton.z(), -2.0, 1e-12);
}

// A ball of 50 mm radius touched 2 mm deep at its top, then 16 mm to the side at the same height:
// 48 mm up, √(48² + 16²) = 50.596 mm from its centre: just left. 12 mm to the side: 49.477 mm from
// it, 0.523 mm deep, pushing along (12, 48)/49.477. A plane would still have said 2 mm.
TEST(ContactModel, ABallIsABallHoweverFarTheToolSlides) {
  Contact contact = floor_contact();
  contact.curvature_per_m = Vector3(1 / 0.048, 1 / 0.048, 0).asDiagonal();

  EXPECT_FALSE(evaluate(contact, {0.016, 0, 0}, kAtRest, 0.0).is_touching);
  const ModelForce force = evaluate(contact, {0.012, 0, 0}, kAtRest, 0.0);
  const double r = std::hypot(0.012, 0.048);
  EXPECT_LT((force.force_on_tool_newton - 500 * (0.05 - r) * Vector3(0.012, 0, 0.048) / r).norm(),
            1e-9);
}

// Inside a bowl of 50 mm radius (curvature of the other sign) the floor comes up instead.
TEST(ContactModel, ABowlRisesToTheSide) {
  Contact contact = floor_contact();  // 2 mm deep: 52 mm from the centre, straight below it
  contact.curvature_per_m = Vector3(-1 / 0.052, -1 / 0.052, 0).asDiagonal();

  const ModelForce force = evaluate(contact, {0.012, 0, 0}, kAtRest, 0.0);

  const double r = std::hypot(0.012, 0.052);
  EXPECT_LT((force.force_on_tool_newton - 500 * (r - 0.05) * Vector3(-0.012, 0, 0.052) / r).norm(),
            1e-9);
}

// A cylinder along y is curved across, straight along.
TEST(ContactModel, ACylinderIsCurvedAcrossOnly) {
  Contact contact = floor_contact();
  contact.curvature_per_m = Vector3(1 / 0.048, 0, 0).asDiagonal();

  EXPECT_NEAR(evaluate(contact, {0, 0.5, 0}, kAtRest, 0.0).force_on_tool_newton.z(), 1.0, 1e-12);
  const double r = std::hypot(0.012, 0.048);
  EXPECT_NEAR(evaluate(contact, {0.012, 0, 0}, kAtRest, 0.0).force_on_tool_newton.norm(),
              500 * (0.05 - r), 1e-9);
}

// Trusted for 1 mm. 3 mm deeper the force is that of 1 mm deeper; 2.5 mm out of the reference the
// surface is left, and on the way the force goes to zero without a jump.
TEST(ContactModel, NeverPressesHarderThanAtItsTrustRadius) {
  Contact contact = floor_contact();
  contact.trust_radius_m = 0.001;

  EXPECT_NEAR(evaluate(contact, {0, 0, -0.003}, kAtRest, 0.0).force_on_tool_newton.z(), 1.5, 1e-12);
  EXPECT_EQ(evaluate(contact, {0, 0, 0.0025}, kAtRest, 0.0).force_on_tool_newton, Vector3(0, 0, 0));
  double before = 0.5;
  for (double z_m = 0.001; z_m < 0.0025; z_m += 1e-6) {
    const double newton = evaluate(contact, {0, 0, z_m}, kAtRest, 0.0).force_on_tool_newton.z();
    EXPECT_LE(newton, before + 1e-12);
    EXPECT_GT(newton, before - 0.001);  // 0.5 N over 1 mm is 0.5 mN per step
    before = newton;
  }
}

// Rising at 20 mm/s for 50 ms: 1 mm deeper; and 10 N·s/m against its motion: 0.2 N.
TEST(ContactModel, TheSurfaceGoesOnMoving) {
  Contact contact = floor_contact();
  contact.d_force_d_velocity = Vector3(0, 0, -10).asDiagonal();
  contact.surface_velocity_world_m_per_s = {0, 0, 0.02};

  EXPECT_NEAR(evaluate(contact, {0, 0, 0}, kAtRest, 0.05).force_on_tool_newton.z(), 1.7, 1e-12);
}

TEST(ContactModel, TouchesThatAreNotListedKeepTheirForce) {
  Interaction interaction;
  interaction.contacts[0] = floor_contact();
  interaction.contacts[0].force_on_tool_newton = {0, 0, 1.0};
  interaction.listed_count = 1;
  interaction.contact_count = 2;
  interaction.force_on_tool_newton = {0.3, 0, 1.0};  // 0.3 N from the one that is not listed
  interaction.stored_energy_joule = 0.0015;

  const ModelForce force = evaluate(interaction, {0, 0, -0.001}, kAtRest, 0.0);

  EXPECT_LT((force.force_on_tool_newton - Vector3(0.3, 0, 1.5)).norm(), 1e-12);
  EXPECT_NEAR(force.stored_energy_joule, 2.75e-3, 1e-12);
}

// The elastic force is the slope of the stored energy: f·δ = −δV, over all that a contact can be.
TEST(ContactModelProperty, ForceIsTheSlopeOfTheEnergyOnPlanesAndSpheres) {
  Random random(2);
  for (int i = 0; i < 2000; ++i) {
    Contact contact;
    const double k = random.uniform(50, 2000), k3 = random.uniform(0, 1e7);
    const double p = random.uniform(-0.002, 0.004);
    const Vector3 n = random.direction();
    contact.penetration_m = p;
    contact.normal_world = n;
    contact.curvature_per_m = random.uniform(0, 50) * (Matrix3::Identity() - n * n.transpose());
    contact.elastic_force_on_tool_newton = (k * p + k3 * p * p * p) * n;
    contact.d_force_d_position = -(k + 3 * k3 * p * p) * n * n.transpose();
    contact.stiffening_newton_per_m2 = 3 * k3 * p;
    contact.stiffening_newton_per_m3 = k3;
    contact.stored_energy_joule = 0.5 * k * p * p + 0.25 * k3 * p * p * p * p;
    contact.trust_radius_m = 1.0;
    const Vector3 d = random.uniform(0, 0.01) * random.direction();
    const Vector3 step = 1e-7 * random.direction();

    const ModelForce here = evaluate(contact, d, kAtRest, 0.0);
    const double rise = evaluate(contact, d + step, kAtRest, 0.0).stored_energy_joule -
                        evaluate(contact, d - step, kAtRest, 0.0).stored_energy_joule;

    EXPECT_NEAR(here.force_on_tool_newton.dot(2.0 * step), -rise,
                1e-5 * (1e-7 + here.force_on_tool_newton.norm() * 2e-7));
  }
}

TEST(ContactModelProperty, NothingNonFiniteComesOutOfAnInteraction) {
  Random random(3);
  for (int i = 0; i < 20000; ++i) {
    const auto wild = [&] {
      return (random.chance(0.5) ? 1.0 : -1.0) * std::pow(10.0, random.uniform(-300, 300));
    };
    Interaction interaction;
    interaction.listed_count = interaction.contact_count = 1;
    Contact& contact = interaction.contacts[0];
    contact.penetration_m = wild();
    contact.normal_world = random.direction();
    for (int j = 0; j < 9; ++j) {
      contact.curvature_per_m(j / 3, j % 3) = wild();
      contact.d_force_d_position(j / 3, j % 3) = wild();
    }
    contact.stiffening_newton_per_m3 = wild();
    contact.elastic_force_on_tool_newton = {wild(), wild(), wild()};
    contact.trust_radius_m = std::abs(wild());

    const ModelForce force =
        evaluate(interaction, {wild(), wild(), wild()}, {wild(), wild(), wild()}, 1.0);

    ASSERT_TRUE(force.force_on_tool_newton.allFinite());
    ASSERT_TRUE(std::isfinite(force.stored_energy_joule));
    ASSERT_GE(force.stored_energy_joule, 0.0);
  }
}

}  // namespace
}  // namespace palpate
