// SPDX-License-Identifier: Apache-2.0
// The clamp for ports: no hand within v_max and no physics draw energy from an arm or a handle.
// Each protection taken away, they do.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

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

/// The least energy over many cases in which `change` has been made.
template <class Change>
double least_with(std::size_t joints, Change&& change) {
  double least = 0.0;
  for (std::uint64_t seed = 1; seed <= seed_count(60); ++seed) {
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
                         c.timing.lost_echoes = 0.05;
                         c.sees_gaps = false;
                       }),
            kDrawnJoule);
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
