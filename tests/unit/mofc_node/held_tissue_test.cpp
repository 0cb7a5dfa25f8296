// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/tissue/held_tissue.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/contact/contact_model.h"
#include "mofc_node/tissue/tissue_model.h"
#include "tests/support/alloc_guard.h"

namespace palpate::mofc {
namespace {

using State = HeldTissue::State;

constexpr double kHeldTick_s = 1e-3;
constexpr double kHeldNewtonPerS = 100.0;
constexpr double kSpring_newton_per_m = 100.0;
constexpr std::uint32_t kJawButton = 2;

/// Tissue held at the origin: 100 N/m, 2 N until it slips, torn above 3 N, out after 10 mm.
Interaction holding(std::uint32_t number = 1, const Vector3& tool_m = Vector3::Zero()) {
  Interaction said;
  said.header.session_id = 3;
  said.tool_position_world_m = tool_m;
  said.listed_count = said.contact_count = 1;
  const Vector3 newton = -kSpring_newton_per_m * tool_m;
  said.contacts[0] = {.tissue = 4,
                      .penetration_m = 1.0,
                      .elastic_force_on_tool_newton = newton,
                      .d_force_d_position = -kSpring_newton_per_m * Matrix3::Identity(),
                      .is_adhesive = true,
                      .trust_radius_m = 1.0,
                      .force_on_tool_newton = newton,
                      .grip = {.number = number,
                               .buttons = kJawButton,
                               .slip_newton = 2.0,
                               .tear_newton = 3.0,
                               .reach_m = 0.01}};
  said.force_on_tool_newton = newton;
  return said;
}

class Held : public testing::Test {
 protected:
  Vector3 pull(const Interaction& said, double z_m, std::uint32_t buttons = kJawButton) {
    const test::AllocGuard guard;
    const ModelForce force = held_.step(said, buttons, {0, 0, z_m}, Vector3::Zero(), kHeldTick_s);
    EXPECT_EQ(guard.count(), 0U);
    return force.force_on_tool_newton;
  }
  HeldTissue held_{kHeldNewtonPerS};
};

// The only message is from before the pull: delay and loss change nothing.
TEST_F(Held, PullsAsTheSpringDoesHoweverOldTheMessage) {
  const Interaction said = holding();
  for (int tick = 0; tick <= 150; ++tick) {
    EXPECT_NEAR(pull(said, 1e-4 * tick).z(), -1e-2 * tick, 1e-12);
  }
  EXPECT_EQ(held_.state(), State::kHolds);
  ASSERT_TRUE(held_.report());
  EXPECT_EQ(held_.report()->physics_session_id, 3U);
  EXPECT_EQ(held_.report()->number, 1U);
  EXPECT_EQ(held_.report()->slip_m, Vector3::Zero());
  EXPECT_TRUE(held_.is_about(4));
  EXPECT_FALSE(held_.is_about(0));
}

TEST_F(Held, TakesUpTheForceOfAGripItHearsOfLateByNoMoreThanTheHandOver) {
  const Interaction said = holding();
  double last = 0.0;
  for (int tick = 0; tick < 100; ++tick) {
    const double newton = pull(said, 0.015).z();
    EXPECT_LE(std::abs(newton - last), kHeldNewtonPerS * kHeldTick_s + 1e-12);
    last = newton;
  }
  EXPECT_NEAR(last, -1.5, 1e-3);
}

// A pull of 25 mm asks for 2.5 N; 2 N are held, and 5 mm slip. Back at 15 mm the spring is 10 mm
// long.
TEST_F(Held, SlipsAndDoesNotPullBackWhatHasSlipped) {
  const Interaction said = holding();
  for (int tick = 0; tick <= 250; ++tick) pull(said, 1e-4 * tick);
  EXPECT_EQ(held_.state(), State::kSlips);
  EXPECT_NEAR(pull(said, 0.025).z(), -2.0, 1e-9);
  EXPECT_NEAR(held_.report()->slip_m.z(), 0.005, 1e-9);
  EXPECT_NEAR(pull(said, 0.015).z(), -1.0, 1e-9);
  EXPECT_EQ(held_.state(), State::kHolds);

  // physics_node answers with that slip, and nothing changes
  Interaction answer = holding(1, {0, 0, 0.015});
  answer.contacts[0].grip.slip_m = {0, 0, 0.005};
  answer.contacts[0].elastic_force_on_tool_newton = {0, 0, -1.0};
  EXPECT_NEAR(pull(answer, 0.015).z(), -1.0, 1e-9);
  EXPECT_NEAR(pull(answer, 0.014).z(), -0.9, 1e-9);
}

TEST_F(Held, ALoopOfPullAndReturnNeverGivesEnergy) {
  const Interaction said = holding();
  double work = 0.0;  // of the hand
  double z_m = 0.0;
  Vector3 newton = Vector3::Zero();
  for (int tick = 1; tick <= 4000; ++tick) {
    const double next_m = 0.012 * (1.0 - std::cos(4e-3 * tick));
    const Vector3 next = pull(said, next_m);
    work -= 0.5 * (newton + next).z() * (next_m - z_m);
    newton = next;
    z_m = next_m;
    if (held_.state() == State::kSlipped) break;
    EXPECT_GE(work, -1e-9) << tick;
  }
  EXPECT_GT(work, 1e-3);
}

TEST_F(Held, LosesWhatHasSlippedOutUntilTheJawsCloseAnew) {
  const Interaction said = holding();
  for (int tick = 0; tick <= 310; ++tick) pull(said, 1e-4 * tick);
  EXPECT_EQ(held_.state(), State::kSlipped);
  EXPECT_TRUE(held_.report()->has_let_go);
  EXPECT_EQ(pull(said, 0.0), Vector3::Zero());
  EXPECT_EQ(held_.state(), State::kSlipped);

  // the button is released, and pressed again; hop 3 is late
  EXPECT_EQ(pull(said, 0.0, 0), Vector3::Zero());
  EXPECT_EQ(held_.state(), State::kNone);
  EXPECT_EQ(pull(said, 0.02), Vector3::Zero());
  const Interaction anew = holding(2);
  EXPECT_GE(pull(anew, 0.005).z(), -kHeldNewtonPerS * kHeldTick_s);
  for (int tick = 0; tick < 100; ++tick) pull(anew, 0.005);
  EXPECT_NEAR(pull(anew, 0.005).z(), -0.5, 1e-4);
}

TEST_F(Held, TearsAboveItsLimit) {
  Interaction said = holding();
  said.contacts[0].grip.slip_newton = 100.0;
  for (int tick = 0; tick <= 299; ++tick) EXPECT_LT(pull(said, 1e-4 * tick + 1e-5).z(), 0.0);
  EXPECT_EQ(pull(said, 0.0301), Vector3::Zero());
  EXPECT_EQ(held_.state(), State::kTorn);
  EXPECT_TRUE(held_.report()->has_let_go);
}

TEST_F(Held, LetsGoInTheTickInWhichTheButtonIsReleased) {
  const Interaction said = holding();
  for (int tick = 0; tick <= 100; ++tick) pull(said, 1e-4 * tick);
  EXPECT_EQ(pull(said, 0.01, 1), Vector3::Zero());
  EXPECT_EQ(held_.state(), State::kNone);
  EXPECT_TRUE(held_.report()->has_let_go);
}

TEST_F(Held, EndsWhenPhysicsSaysThatItHoldsNothing) {
  const Interaction said = holding();
  for (int tick = 0; tick <= 100; ++tick) pull(said, 1e-4 * tick);
  Interaction nothing;
  nothing.header.session_id = 3;
  EXPECT_EQ(pull(nothing, 0.01), Vector3::Zero());
  EXPECT_EQ(held_.state(), State::kTorn) << "the button is still held";
  EXPECT_FALSE(held_.report());
  pull(nothing, 0.01, 0);
  EXPECT_EQ(held_.state(), State::kNone);

  for (int tick = 0; tick <= 100; ++tick) pull(holding(2), 1e-4 * tick);
  nothing.header.session_id = 5;
  EXPECT_EQ(pull(nothing, 0.01), Vector3::Zero());
  EXPECT_EQ(held_.state(), State::kNone) << "another physics has torn nothing";
}

// In the whole model the contact of hop 3 counts once, by the jaws alone.
TEST(HeldInTheModel, TheContactModelDoesNotCountBesides) {
  TissueModel model(true, kHeldNewtonPerS, 1);
  const Interaction said = holding();
  DeviceState state;
  state.header.session_id = 1;
  state.buttons = kJawButton;
  ModelForce force;
  for (int tick = 0; tick <= 100; ++tick) {
    force = model.step(said, state, {0, 0, 1e-4 * tick}, Vector3::Zero(), kHeldTick_s);
  }
  EXPECT_NEAR(force.force_on_tool_newton.z(), -1.0, 1e-12);
  EXPECT_NEAR(force.stored_energy_joule, 0.005, 1e-12);
  EXPECT_TRUE(force.is_touching);
  state.buttons = 0;
  force = model.step(said, state, {0, 0, 0.01}, Vector3::Zero(), kHeldTick_s);
  EXPECT_EQ(force.force_on_tool_newton, Vector3::Zero());
  EXPECT_FALSE(force.is_touching);
}

}  // namespace
}  // namespace palpate::mofc
