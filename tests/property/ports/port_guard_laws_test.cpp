// SPDX-License-Identifier: Apache-2.0
// The clamp for ports: no hand within v_max and no physics draw energy from an arm or a handle.
// Each protection taken away, they do.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "tests/property/ports/leader_loop.h"
#include "tests/property/seeds.h"
#include "tests/support/alloc_guard.h"

namespace palpate::test {
namespace {

constexpr double kLeastJoule = -1e-6;

/// 0 joints: the handle.
class EveryLeader : public testing::TestWithParam<std::size_t> {};

TEST_P(EveryLeader, GivesNoHandAndNoPhysicsEnergyAtAnyInstant) {
  double least = 0.0;
  double least_unclamped = 0.0;
  std::uint64_t rendered = 0;
  const std::uint64_t count = seed_count(60);
  for (std::uint64_t seed = 1; seed <= count; ++seed) {
    LeaderCase a_case(seed, GetParam());
    const double joule = least_energy_joule(a_case);
    EXPECT_GE(joule, kLeastJoule) << "seed=" << seed;
    least = std::min(least, joule);
    rendered += static_cast<std::uint64_t>(a_case.rendered);
    if (seed > 60) continue;
    LeaderCase without(seed, GetParam());
    without.is_clamped = false;
    least_unclamped = std::min(least_unclamped, least_energy_joule(without));
  }
  std::printf(
      "%zu joints, %llu runs: least true energy %.3f µJ, %.0f %% of the ticks above "
      "friction; unclamped %.1f J\n",
      GetParam(), static_cast<unsigned long long>(count), 1e6 * least,
      static_cast<double>(rendered) / (6.0 * static_cast<double>(count)), least_unclamped);
  EXPECT_LT(least_unclamped, -0.1);
  EXPECT_GT(rendered, 30 * count);  // of 600 ticks
}

INSTANTIATE_TEST_SUITE_P(Leaders, EveryLeader, testing::Values(0U, 4U, 6U, 7U, 8U),
                         [](const auto& row) {
                           return row.param == 0 ? std::string("Handle")
                                                 : "Joints" + std::to_string(row.param);
                         });

/// The least energy over cases in which `change` has been made, as many in every build.
template <class Change>
double least_with(std::size_t joints, Change&& change) {
  double least = 0.0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    LeaderCase a_case(seed, joints);
    change(a_case);
    least = std::min(least, least_energy_joule(a_case));
  }
  return least;
}

constexpr double kDrawnJoule = -1e-4;

TEST(PortGuardTwin, WithFrictionBeyondTheStatedMarginEnergyIsDrawn) {
  EXPECT_LT(least_with(7,
                       [](LeaderCase& c) {
                         for (Port& port : c.parameters.ports) port.f_co *= 3.0;
                       }),
            kDrawnJoule);
  EXPECT_LT(least_with(7,
                       [](LeaderCase& c) {
                         for (Port& port : c.parameters.ports) port.f_d *= 3.0;
                       }),
            kDrawnJoule);
}

TEST(PortGuardTwin, WithTheEncodersTreatedAsExactEnergyIsDrawn) {
  EXPECT_LT(least_with(7,
                       [](LeaderCase& c) {
                         for (Port& port : c.parameters.ports) port.q = 0.0;
                       }),
            kDrawnJoule);
}

TEST(PortGuardTwin, WithAHandFasterThanVMaxEnergyIsDrawn) {
  EXPECT_LT(least_with(7, [](LeaderCase& c) { c.joint_leader->overspeed = 3.0; }), kDrawnJoule);
}

TEST(PortGuardTwin, WithCommandsThatOutliveTheirLeaseEnergyIsDrawn) {
  EXPECT_LT(least_with(7,
                       [](LeaderCase& c) {
                         c.timing.overrun = 3.0;
                         c.timing.lost_answers = 0.3;
                       }),
            kDrawnJoule);
}

TEST(PortGuardTwin, WithAnswersLaterThanReservedForEnergyIsDrawn) {
  // nothing else in reserve
  const auto make_tight = [](LeaderCase& c) {
    c.joint_leader->make_tight();
    c.take_profile();
    c.parameters.credit_cap_joule = c.parameters.gate_joule = 1e6;
    c.parameters.times.longest_lease_s = 0.0;
  };
  EXPECT_GE(least_with(7, make_tight), kLeastJoule);
  EXPECT_LT(least_with(7,
                       [&](LeaderCase& c) {
                         make_tight(c);
                         c.parameters.times.delta_max_s = 0.0;
                         c.ignores_deadlines = true;
                       }),
            kDrawnJoule);
}

TEST(PortGuardTwin, WithUnnoticedGapsEnergyIsDrawn) {
  EXPECT_LT(least_with(7,
                       [](LeaderCase& c) {
                         c.timing.lost_echoes = 0.5;
                         c.sees_gaps = false;
                       }),
            kDrawnJoule);
}

TEST(PortGuard, AnEchoThatIsMissingIsNoticedByTheMotionOfTheHand) {
  EXPECT_GE(least_with(7,
                       [](LeaderCase& c) {
                         c.timing.lost_echoes = 0.05;
                         c.sees_gaps = false;
                         c.loses_stretches = true;
                       }),
            kLeastJoule);
}

TEST(PortGuard, ReducesWhatIsRequestedOrKeepsIt) {
  for (const std::size_t joints : {0U, 4U, 7U}) {
    for (const std::uint64_t seed : seeds(20)) {
      SCOPED_TRACE(testing::Message() << "seed=" << seed);
      LeaderCase c(seed, joints);
      LeaderLoop loop(c);
      loop.run(300, [&](const PortInput& in, const PortOutput& out) {
        bool differs = false;
        bool is_finite = true;
        for (std::size_t i = 0; i < c.leader->count(); ++i) {
          const double asked = in.requested_effort_on_hand[i];
          is_finite = is_finite && std::isfinite(asked);
          ASSERT_TRUE(std::isfinite(out.effort_on_hand[i]));
          differs = differs || out.effort_on_hand[i] != asked;
          if (!std::isfinite(asked)) continue;
          ASSERT_LE(std::abs(out.effort_on_hand[i]), std::abs(asked));
          ASSERT_GE(out.effort_on_hand[i] * asked, 0.0);
        }
        ASSERT_EQ(out.is_clamped, differs);
        ASSERT_TRUE(is_finite || out.effort_on_hand == PortValues{});
        ASSERT_GE(out.lease_s, c.parameters.times.hold_s);
        ASSERT_LE(out.begins_within_s, c.parameters.times.delta_max_s);
        ASSERT_LE(out.ledger_energy_joule, out.counted_energy_joule);
      });
    }
  }
}

/// One joint of 0.1 N·m and 0.1 N·m·s/rad, at 1 kHz.
struct OneJoint {
  PortGuardParameters parameters{
      .ports = {Port{.f_d = 0.1, .f_co = 0.1, .q = 1.6e-3, .v_max = 5.0}},
      .count = 1,
      .times = {.hold_s = 1e-3, .delta_max_s = 0.0, .longest_lease_s = 5e-3}};
  PortGuard guard{parameters};
  PortStretch stretch{.duration_s = 1e-3};

  PortOutput step(double angle_rad, double asked_newton_m) {
    stretch.position_at_end[0] = angle_rad;
    PortInput input;
    input.position = stretch.position_at_end;
    input.acting_effort_on_hand = stretch.effort_on_hand;
    input.acting_lease_s = 1e-3;
    input.requested_effort_on_hand[0] = asked_newton_m;
    if (has_begun) input.applied = {&stretch, 1};
    has_begun = true;
    const PortOutput output = guard.step(input);
    stretch.effort_on_hand = output.effort_on_hand;
    return output;
  }
  bool has_begun = false;
};

TEST(PortGuard, AnAngleThatWrapsIsNoMotion) {
  OneJoint joint;
  for (int k = 0; k < 100; ++k) joint.step(3.0 + 1e-3 * k, 0.0);  // 1 rad/s: 20 µJ a tick
  const double before = joint.step(3.1, 0.0).ledger_energy_joule;
  EXPECT_GT(before, 5e-4);
  const PortOutput after = joint.step(3.1 - 2.0 * std::numbers::pi, 2.0);
  EXPECT_TRUE(after.is_too_fast);
  EXPECT_LE(after.ledger_energy_joule, 0.0);
  EXPECT_NEAR(after.effort_on_hand[0], 0.1, 1e-9);
}

// With a torque that acts along the wrap, counting it would make a debt of 2 N·m · 2π.
TEST(PortGuard, AnAngleThatWrapsAlongTheTorqueLeavesNoDebt) {
  OneJoint joint;
  for (int k = 0; k < 1000; ++k) joint.step(5e-3 * k, 0.0);
  const PortOutput acting = joint.step(5.0, 2.0);
  ASSERT_GT(acting.effort_on_hand[0], 0.5);
  const PortOutput after = joint.step(5.0 + 2.0 * std::numbers::pi, 2.0);
  EXPECT_TRUE(after.is_too_fast);
  EXPECT_GE(after.ledger_energy_joule, -1e-9);
  EXPECT_LE(after.ledger_energy_joule, 0.0);
}

// A clock that has not ticked: 0.05 N·m against 2π rad is 0.31 J, and nobody has done that work.
TEST(PortGuard, AnAngleThatChangesInNoTimeGivesNoCredit) {
  OneJoint joint;
  joint.step(0.0, -0.05);
  joint.step(0.0, -0.05);
  joint.stretch.duration_s = 0.0;
  const PortOutput after = joint.step(2.0 * std::numbers::pi, -0.05);
  EXPECT_TRUE(after.is_too_fast);
  EXPECT_LE(after.ledger_energy_joule, 0.0);
}

TEST(PortGuard, JumpsWithinAnEchoGiveNoCreditWhereTheyCancel) {
  PortGuard guard(OneJoint{}.parameters);
  PortInput input;
  static_cast<void>(guard.step(input));
  std::array<PortStretch, 2> applied{};
  applied[0] = {.duration_s = 5e-4, .effort_on_hand = {-0.05}, .position_at_end = {6.0}};
  applied[1] = {.duration_s = 5e-4};
  input.applied = applied;
  EXPECT_LE(guard.step(input).ledger_energy_joule, 0.0);

  // and where the last stretch ends elsewhere than the hand is
  applied[0].position_at_end = applied[1].position_at_end = {};
  input.position[0] = 1.0;
  const PortOutput after = guard.step(input);
  EXPECT_TRUE(after.is_too_fast);
  EXPECT_LE(after.ledger_energy_joule, 0.0);
}

// The true hand draws what it can within v_max while the reported angles jump and clocks stand
// still; the seeds are as many as the leaders'.
TEST(PortGuard, NoEnergyIsDrawnByJumpsAndZeroDurations) {
  double least = 0.0;
  for (std::uint64_t seed = 1; seed <= seed_count(300); ++seed) {
    Random random(seed);
    OneJoint joint;
    Port& port = joint.parameters.ports[0];
    port = {.f_d = random.uniform(0.005, 0.1),
            .f_co = random.uniform(0.0, 0.2),
            .q = random.chance(0.3) ? 0.0 : random.uniform(0.0, 0.01),
            .v_max = random.uniform(0.5, 6.0)};
    joint.guard = PortGuard(joint.parameters);
    double x = 0.0;
    double offset = 0.0;
    double energy = 0.0;
    double lease_s = 1e-3;
    double asked = 0.0;
    for (int k = 0; k < 400; ++k) {
      if (random.chance(0.05)) offset += random.uniform(1.0, 7.0) * (random.chance(0.5) ? 1 : -1);
      if (random.chance(0.2)) asked = random.uniform(-2.0, 2.0);
      const double error = 0.499 * port.q * random.uniform(-1.0, 1.0);
      const PortOutput output = joint.step(x + offset + error, asked);
      lease_s = output.lease_s;
      const double effort = output.effort_on_hand[0];
      const double excess = std::max(0.0, std::abs(effort) - port.f_co);
      joint.stretch.duration_s = random.chance(0.2) ? 0.0 : std::min(1e-3, lease_s);
      double v = random.uniform(-1.0, 1.0) * port.v_max;
      if (random.chance(0.5)) {
        v = std::copysign(std::min(port.v_max, excess / (2.0 * port.f_d)), effort);
      }
      const double t = joint.stretch.duration_s;
      energy += (port.f_d * v * v + port.f_co * std::abs(v) - effort * v) * t;
      x += v * t;
      least = std::min(least, energy);
    }
  }
  EXPECT_GE(least, kLeastJoule);
}

TEST(PortGuard, RecoversFromNumbersOfAnySize) {
  const auto peak_after = [](OneJoint& joint) {
    double most = 0.0;
    for (int k = 0; k < 5000; ++k) {
      const double moving = std::cos(6e-3 * k);
      const PortOutput output = joint.step(0.5 * std::sin(6e-3 * k), moving > 0.0 ? -0.5 : 0.5);
      most = k < 4000 ? 0.0 : std::max(most, std::abs(output.effort_on_hand[0]));
    }
    return most;
  };
  OneJoint sound;
  const double expected = peak_after(sound);
  ASSERT_GT(expected, 0.3);
  for (const double huge : {1e300, 1.7e308}) {
    OneJoint asked;
    asked.step(0.0, 0.1);
    EXPECT_EQ(asked.step(0.0, huge).effort_on_hand[0], 0.0);
    asked.step(1e-3, -huge);
    EXPECT_NEAR(peak_after(asked), expected, 1e-6);
    OneJoint placed;
    placed.step(0.0, 0.1);
    placed.step(huge, 0.1);
    placed.step(-huge, 0.1);
    EXPECT_NEAR(peak_after(placed), expected, 1e-6);
  }
}

TEST(PortGuard, AHandSomewhatFasterThanVMaxIsReportedAndKeepsItsCredit) {
  OneJoint joint;
  for (int k = 0; k < 100; ++k) joint.step(7.5e-3 * k, 0.0);
  const PortOutput output = joint.step(7.5e-3 * 100, 0.0);
  EXPECT_TRUE(output.is_too_fast);
  EXPECT_GT(output.ledger_energy_joule, 4e-3);
}

// A power of two rounds nothing, so the answers agree to the bit.
TEST(PortGuard, TheUnitOfAPortDoesNotMatter) {
  for (const std::uint64_t seed : seeds(20)) {
    LeaderCase c(seed, 7);
    const auto scale_of = [](std::size_t i) { return i % 2 == 0 ? 64.0 : 0.125; };
    PortGuardParameters scaled = c.parameters;
    for (std::size_t i = 0; i < scaled.count; ++i) {
      const double a = scale_of(i);
      Port& port = scaled.ports[i];
      port = {.f_d = port.f_d / a / a,
              .f_co = port.f_co / a,
              .q = port.q * a,
              .v_max = port.v_max * a,
              .priority = port.priority};
    }
    PortGuard other(scaled);
    LeaderLoop loop(c);
    std::vector<PortStretch> applied;
    loop.run(200, [&](const PortInput& in, const PortOutput& out) {
      const auto stretched = [&](const PortValues& values, bool is_effort) {
        PortValues result{};
        for (std::size_t i = 0; i < scaled.count; ++i) {
          result[i] = is_effort ? values[i] / scale_of(i) : values[i] * scale_of(i);
        }
        return result;
      };
      applied.assign(in.applied.begin(), in.applied.end());
      for (PortStretch& stretch : applied) {
        stretch.effort_on_hand = stretched(stretch.effort_on_hand, true);
        stretch.position_at_end = stretched(stretch.position_at_end, false);
      }
      PortInput input = in;
      input.position = stretched(in.position, false);
      input.applied = applied;
      input.acting_effort_on_hand = stretched(in.acting_effort_on_hand, true);
      input.requested_effort_on_hand = stretched(in.requested_effort_on_hand, true);
      const PortOutput answer = other.step(input);
      ASSERT_EQ(answer.effort_on_hand, stretched(out.effort_on_hand, true)) << "seed " << seed;
      ASSERT_EQ(answer.ledger_energy_joule, out.ledger_energy_joule);
      ASSERT_EQ(answer.lease_s, out.lease_s);
    });
  }
}

TEST(PortGuard, AllocatesNothing) {
  LeaderCase c(1, 8);
  PortGuard guard(c.parameters);
  std::array<PortStretch, 3> applied{};
  for (PortStretch& stretch : applied) stretch.duration_s = 1e-3;
  applied[1].has_position_at_end = false;
  PortInput input;
  input.requested_effort_on_hand.fill(1.0);
  input.stored_energy_joule = 1.0;
  std::uint64_t allocations = 0;
  std::uint64_t mallocs = 0;
  for (int k = 0; k < 300; ++k) {
    for (PortStretch& stretch : applied) {
      for (double& x : stretch.position_at_end) x = 0.01 * k;
    }
    input.position = applied[2].position_at_end;
    input.applied = applied;
    input.has_gap = k % 50 == 49;
    const AllocGuard count;
    const std::uint64_t before = mallocs_of_this_thread();
    const PortOutput output = guard.step(input);
    if (k % 100 == 99) guard.reset();
    allocations += count.count();
    mallocs += mallocs_of_this_thread() - before;
    input.acting_effort_on_hand = output.effort_on_hand;
    for (PortStretch& stretch : applied) stretch.effort_on_hand = output.effort_on_hand;
  }
  EXPECT_EQ(allocations, 0U);
  EXPECT_EQ(mallocs, 0U);
}

static_assert(noexcept(std::declval<PortGuard&>().step(PortInput{})));
static_assert(noexcept(std::declval<PortGuard&>().reset()));

}  // namespace
}  // namespace palpate::test
