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

// --- a needle
// -------------------------------------------------------------------------------------

constexpr double kCut_newton = 0.4;
constexpr double kRub_newton_per_m = 20.0;

/// Pierced at the origin with nothing left of the force there.
Interaction pierced(std::uint32_t number = 1, double deepest_m = 0.0) {
  Interaction said = holding(number);
  said.contacts[0].grip.buttons = 0;
  said.contacts[0].grip.slip_newton = said.contacts[0].grip.tear_newton = 1e4;
  said.contacts[0].grip.reach_m = 1.0;
  said.contacts[0].grip.needle = {.inward_world = -Vector3::UnitZ(),
                                  .cutting_newton = kCut_newton,
                                  .friction_newton_per_m = kRub_newton_per_m,
                                  .deepest_m = deepest_m};
  return said;
}

// One message for all of it: in with 20 mm/s, a rest, and out.
TEST_F(Held, ANeedleCutsRubsAndComesOutWhateverTheDelay) {
  const Interaction said = pierced();
  double work = 0.0;  // of the hand
  double least_work = 0.0;
  double newton = 0.0;
  double z_m = 0.0;
  const auto go = [&](double way_m) {
    const double now = pull(said, z_m += way_m, 0).z();
    work -= 0.5 * (newton + now) * way_m;
    least_work = std::min(least_work, work);
    newton = now;
  };
  for (int tick = 0; tick < 1500; ++tick) go(-2e-5);
  EXPECT_EQ(held_.state(), State::kPierces);
  const double depth_m = -held_.report()->slip_m.z();
  EXPECT_NEAR(newton, kCut_newton + kRub_newton_per_m * depth_m, 1e-9);
  EXPECT_NEAR(depth_m + newton / kSpring_newton_per_m, 0.03, 1e-9);
  const double stored = 0.5 * newton * newton / kSpring_newton_per_m;
  EXPECT_NEAR(work, kCut_newton * depth_m + 0.5 * kRub_newton_per_m * depth_m * depth_m + stored,
              0.002 * work);
  go(2e-5);
  EXPECT_EQ(held_.state(), State::kPierced);
  while (z_m < 0.005) go(2e-5);
  EXPECT_EQ(held_.state(), State::kNone);
  EXPECT_TRUE(held_.report()->has_let_go);
  EXPECT_EQ(newton, 0.0);
  EXPECT_GE(least_work, -1e-9);
  EXPECT_GT(work, kCut_newton * depth_m);
  EXPECT_EQ(pull(said, -0.01, 0), Vector3::Zero()) << "until physics_node says that it is in again";
}

// physics_node knows of the hole; what it says late of its depth does not count.
TEST_F(Held, ANeedleKnowsItsHole) {
  const Interaction anew = pierced(2, 0.02);
  double z_m = 0.0;
  const auto go_to = [&](double there_m) {
    double newton = 0.0;
    const double step_m = there_m < z_m ? -2e-5 : 2e-5;
    while (std::abs(there_m - z_m) > 1e-5) newton = pull(anew, z_m += step_m, 0).z();
    return newton;
  };
  const double in_hole = go_to(-0.015);
  EXPECT_NEAR(in_hole, -kRub_newton_per_m * held_.report()->slip_m.z(), 1e-9);
  EXPECT_GT(go_to(-0.04), kCut_newton);
  const double deepest_m = -held_.report()->slip_m.z();
  EXPECT_GT(deepest_m, 0.029);
  go_to(-0.01);
  EXPECT_LT(go_to(-0.03), kCut_newton + kRub_newton_per_m * 0.03 - 0.1);
}

// One message for all of it: 20 mm of tissue, whatever the delay, and back through the cut.
TEST_F(Held, ABladeCutsAndComesBackThroughItsCut) {
  Interaction said = pierced();
  said.contacts[0].grip.needle = {.inward_world = Vector3::UnitX(),
                                  .cutting_newton = kCut_newton,
                                  .edge_world = Vector3::UnitZ(),
                                  .friction_newton = 0.1};
  double x_m = 0.0;
  double work = 0.0;
  double newton = 0.0;
  const auto go = [&](double way_m) {
    x_m += way_m;
    const double now =
        held_.step(said, 0, {x_m, 0, 0}, Vector3::Zero(), kHeldTick_s).force_on_tool_newton.x();
    work -= 0.5 * (newton + now) * way_m;
    newton = now;
  };
  while (x_m < 0.02) go(2e-5);
  EXPECT_EQ(held_.state(), State::kCuts);
  EXPECT_NEAR(newton, -0.5, 1e-9);
  const double depth_m = held_.report()->slip_m.x();
  EXPECT_NEAR(work, 0.5 * depth_m + 0.5 * 0.5 * 0.5 / kSpring_newton_per_m, 0.002 * work);
  while (x_m > 0.01) go(-2e-5);
  EXPECT_NEAR(newton, 0.1, 1e-9);
  while (x_m < 0.015) go(2e-5);
  EXPECT_NEAR(newton, -0.1, 1e-9);
  go(-1e-6);
  EXPECT_EQ(held_.state(), State::kPierced);
  // along its edge it slides, across it holds
  const ModelForce aside = held_.step(said, 0, {x_m, 0.001, 0.01}, Vector3::Zero(), kHeldTick_s);
  EXPECT_NEAR(aside.force_on_tool_newton.z(), -0.1, 1e-9);
  EXPECT_NEAR(aside.force_on_tool_newton.y(), -0.001 * kSpring_newton_per_m, 1e-9);
}

// The next body has more of the edge in tissue, or less.
TEST_F(Held, TheForceThatCutsPassesToThatOfTheNextBody) {
  Interaction said = pierced();
  NeedleLaw& blade = said.contacts[0].grip.needle;
  blade = {.inward_world = Vector3::UnitX(),
           .cutting_newton = 1.0,
           .edge_world = Vector3::UnitZ(),
           .friction_newton = 0.1};
  double x_m = 0.0;
  const auto go = [&](double way_m) {
    x_m += way_m;
    return held_.step(said, 0, {x_m, 0, 0}, Vector3::Zero(), kHeldTick_s).force_on_tool_newton.x();
  };
  double newton = 0.0;
  while (x_m < 0.03) newton = go(2e-5);
  EXPECT_NEAR(newton, -1.1, 1e-9);
  for (const double cutting_newton : {1.8, 0.5}) {
    blade.cutting_newton = cutting_newton;
    double largest_change = 0.0;
    for (int tick = 0; tick < 800; ++tick) {
      const double now = go(2e-5);
      largest_change = std::max(largest_change, std::abs(now - newton));
      newton = now;
    }
    EXPECT_LE(largest_change, kHeldNewtonPerS * kHeldTick_s + 1e-9);
    EXPECT_NEAR(newton, -(cutting_newton + 0.1), 1e-9);
    EXPECT_EQ(held_.state(), State::kCuts);
  }
}

TEST_F(Held, ANeedleHoldsAcross) {
  const Interaction said = pierced();
  for (int tick = 0; tick < 1000; ++tick) pull(said, -2e-5 * tick, 0);
  const ModelForce aside = held_.step(said, 0, {0.01, 0, -0.02}, Vector3::Zero(), kHeldTick_s);
  EXPECT_NEAR(aside.force_on_tool_newton.x(), -1.0, 1e-9);
}

// In the whole model the contact of hop 3 counts once, by the jaws alone.
TEST(HeldInTheModel, TheContactModelDoesNotCountBesides) {
  TissueModel model(true, kHeldNewtonPerS, 1, from_seconds(1e-3));
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
