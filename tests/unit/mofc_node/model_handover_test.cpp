// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/tissue/model_handover.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/core/random.h"

namespace palpate::mofc {
namespace {

constexpr double kTick = 0.001;

/// A random patch of tissue near the origin: plane or curved, stiff, damped, moving.
Contact random_contact(Random& random) {
  Contact contact;
  contact.penetration_m = random.uniform(-0.005, 0.005);
  contact.normal_world = random.direction();
  if (random.chance(0.7)) {
    const Vector3& n = contact.normal_world;
    contact.curvature_per_m = random.uniform(-100, 100) * (Matrix3::Identity() - n * n.transpose());
  }
  const double k = random.uniform(0, 3000);
  const Matrix3 nn = contact.normal_world * contact.normal_world.transpose();
  contact.elastic_force_on_tool_newton = k * contact.penetration_m * contact.normal_world;
  contact.d_force_d_position = -k * nn;
  contact.d_force_d_velocity = -random.uniform(0, 150) * nn;
  contact.stiffening_newton_per_m2 = random.uniform(0, 1e5);
  contact.stored_energy_joule = 0.5 * k * contact.penetration_m * contact.penetration_m;
  contact.surface_velocity_world_m_per_s = random.uniform(0, 0.05) * random.direction();
  contact.is_adhesive = random.chance(0.3);
  contact.trust_radius_m = random.uniform(1e-4, 0.02);
  return contact;
}

Interaction random_interaction(Random& random, std::uint64_t sequence) {
  Interaction interaction;
  interaction.header = {3, sequence, {}};
  interaction.device_sampled_at = time_at(kTick * static_cast<double>(sequence));
  interaction.tool_position_world_m = random.uniform(0, 0.003) * random.direction();
  interaction.listed_count = static_cast<std::uint32_t>(random.below(4));
  for (std::uint32_t i = 0; i < interaction.listed_count; ++i) {
    interaction.contacts[i] = random_contact(random);
    if (interaction.contacts[i].penetration_m > 0.0) ++interaction.contact_count;
  }
  return interaction;
}

// Random models arrive at random times under a tool at rest, so that nothing but the models can
// change the force: no step exceeds the bound, and eventually only the newest model is used.
TEST(ModelHandoverProperty, ANewModelAloneNeverMovesTheForceByMoreThanTheBound) {
  int changes_above_the_bound = 0;
  for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const double newton_per_s = random.uniform(20, 500);
    const double bound_newton = newton_per_s * kTick;
    const Vector3 tool_m = random.uniform(0, 0.003) * random.direction();
    const Vector3 tool_m_per_s = random.uniform(0, 0.1) * random.direction();
    ModelHandover handover(newton_per_s);
    Interaction newest = random_interaction(random, 0);
    for (Contact& contact : newest.contacts) contact.surface_velocity_world_m_per_s.setZero();
    Vector3 before = Vector3::Zero();
    for (int k = 1; k <= 60; ++k) {
      if (random.chance(0.2)) {
        const Vector3 old_force = evaluate(newest, tool_m, tool_m_per_s, 0.0).force_on_tool_newton;
        newest = random_interaction(random, static_cast<std::uint64_t>(k));
        // a moving surface changes the force without a new model
        for (Contact& contact : newest.contacts) contact.surface_velocity_world_m_per_s.setZero();
        const Vector3 new_force = evaluate(newest, tool_m, tool_m_per_s, 0.0).force_on_tool_newton;
        changes_above_the_bound += (new_force - old_force).norm() > bound_newton ? 1 : 0;
      }
      const Vector3 force = handover.step(newest, tool_m, tool_m_per_s, kTick, time_at(kTick * k))
                                .force_on_tool_newton;
      ASSERT_LE((force - before).norm(), bound_newton * (1.0 + 1e-9));
      ASSERT_LE(handover.last_step_newton(), bound_newton * (1.0 + 1e-9));
      before = force;
    }
    const Vector3 settled = evaluate(newest, tool_m, tool_m_per_s, 0.0).force_on_tool_newton;
    for (int k = 61; k <= 100'000; ++k) {
      before = handover.step(newest, tool_m, tool_m_per_s, kTick, time_at(kTick * k))
                   .force_on_tool_newton;
      if ((before - settled).norm() < 1e-12 * (1.0 + settled.norm())) break;
    }
    EXPECT_LT((before - settled).norm(), 1e-9 * (1.0 + settled.norm()));
  }
  EXPECT_GT(changes_above_the_bound, 5000);  // held back, or the test would prove nothing
}

// The same while the tool moves: the contribution of the hand-over is within the bound.
TEST(ModelHandoverProperty, TheHandOverOfAMovingToolIsWithinTheBoundToo) {
  double largest = 0.0;
  for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
    Random random(seed);
    ModelHandover handover(100.0);
    Interaction newest = random_interaction(random, 0);
    const Vector3 v = random.uniform(0, 0.5) * random.direction();
    Vector3 tool_m = random.uniform(0, 0.003) * random.direction();
    for (int k = 1; k <= 100; ++k) {
      if (random.chance(0.1)) newest = random_interaction(random, static_cast<std::uint64_t>(k));
      tool_m += kTick * v;
      const ModelForce force = handover.step(newest, tool_m, v, kTick, time_at(kTick * k));
      ASSERT_TRUE(force.force_on_tool_newton.allFinite());
      ASSERT_GE(force.stored_energy_joule, 0.0);
      ASSERT_LE(handover.last_step_newton(), 0.1 * (1.0 + 1e-9)) << "seed " << seed;
      largest = std::max(largest, handover.last_step_newton());
    }
  }
  EXPECT_GT(largest, 0.0999);
}

// A floor that rises with 10 mm/s, seen by physics half-way round a loop of 100 ms: 50 ms old when
// its model arrives, 70 ms old 20 ms later. 500 N/m · (1 mm + 10 mm/s · 70 ms) = 0.85 N.
TEST(ModelHandover, TheSurfaceKeepsMovingWhileTheModelAges) {
  ModelHandover handover(1e6);
  Interaction interaction;
  interaction.header = {3, 0, {}};
  interaction.device_sampled_at = time_at(1.0);
  interaction.listed_count = interaction.contact_count = 1;
  interaction.contacts[0] = {.penetration_m = 0.001,
                             .surface_velocity_world_m_per_s = {0, 0, 0.01},
                             .elastic_force_on_tool_newton = {0, 0, 0.5},
                             .d_force_d_position = Vector3(0, 0, -500).asDiagonal(),
                             .trust_radius_m = 1.0};
  const auto newton = [&](double t_s) {
    return handover.step(interaction, {0, 0, 0}, {0, 0, 0}, kTick, time_at(t_s))
        .force_on_tool_newton.z();
  };

  EXPECT_NEAR(newton(1.1), 0.75, 1e-9);
  EXPECT_NEAR(newton(1.12), 0.85, 1e-9);
}

}  // namespace
}  // namespace palpate::mofc
