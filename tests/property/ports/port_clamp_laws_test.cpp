// SPDX-License-Identifier: Apache-2.0
// The clamp of ports beside a search over hands, and its priorities.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "common/core/random.h"
#include "mofc_node/controllers/ports/port_clamp.h"
#include "tests/property/seeds.h"

namespace palpate::controllers {
namespace {

constexpr double kHold_s = 2e-3;

std::vector<Port> random_ports(Random& random) {
  std::vector<Port> ports(1 + random.below(kMostPorts));
  for (Port& port : ports) {
    port.f_d = random.chance(0.2) ? 0.0 : 0.01 * std::pow(100.0, random.uniform());
    port.f_co = random.chance(0.2) ? 0.0 : random.uniform(0.0, 0.5);
    port.v_max = 0.2 * std::pow(50.0, random.uniform());
    port.priority = static_cast<int>(random.below(3)) - 1;
  }
  return ports;
}

PortValues random_effort(Random& random, std::size_t count, double most) {
  PortValues effort{};
  for (std::size_t i = 0; i < count; ++i) effort[i] = random.uniform(-most, most);
  return effort;
}

/// Power that a hand gets which moves like this.
double drawn_watt(const std::vector<Port>& ports, const PortValues& effort, const PortValues& v) {
  double sum = 0.0;
  for (std::size_t i = 0; i < ports.size(); ++i) {
    sum += effort[i] * v[i] - ports[i].f_co * std::abs(v[i]) - ports[i].f_d * v[i] * v[i];
  }
  return sum;
}

TEST(PortClampLaws, NoHandWithinVMaxDrainsMoreThanIsComputedAndOneDrainsAsMuch) {
  for (const std::uint64_t seed : test::seeds(200)) {
    Random random(seed);
    const std::vector<Port> ports = random_ports(random);
    const PortClamp clamp(ports, kHold_s);
    const PortValues effort = random_effort(random, ports.size(), 2.0);
    const double drain = clamp.drain_watt(effort);
    PortValues v{};
    for (int k = 0; k < 200; ++k) {
      for (std::size_t i = 0; i < ports.size(); ++i) {
        v[i] = random.uniform(-1.0, 1.0) * ports[i].v_max;
      }
      ASSERT_LE(drawn_watt(ports, effort, v), drain + 1e-12) << "seed " << seed;
    }
    // port by port the best of many speeds
    PortValues best{};
    for (std::size_t i = 0; i < ports.size(); ++i) {
      double most = 0.0;
      for (int k = -1000; k <= 1000; ++k) {
        const double speed = 1e-3 * k * ports[i].v_max;
        const double watt =
            effort[i] * speed - ports[i].f_co * std::abs(speed) - ports[i].f_d * speed * speed;
        if (watt > most) {
          most = watt;
          best[i] = speed;
        }
      }
    }
    EXPECT_NEAR(drawn_watt(ports, effort, best), drain, 1e-4 * drain + 1e-12) << "seed " << seed;
  }
}

TEST(PortClampLaws, WhatItGrantsIsPaidAndNothingMuchLargerIs) {
  std::uint64_t reduced = 0;
  for (const std::uint64_t seed : test::seeds(2000)) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    Random random(seed);
    std::vector<Port> ports = random_ports(random);
    for (Port& port : ports) port.priority = 0;
    const PortClamp clamp(ports, kHold_s);
    const PortValues asked = random_effort(random, ports.size(), 5.0);
    const double energy = 1e-7 * std::pow(1e6, random.uniform());
    const PortValues given = clamp.clamp(asked, energy, 1.0);
    const double paid = kHold_s * clamp.drain_watt(given);
    ASSERT_LE(paid, energy * (1.0 + 1e-13));
    if (given == asked) continue;
    ++reduced;
    // one factor for all
    const double scale = given[0] / asked[0];
    PortValues larger{};
    for (std::size_t i = 0; i < ports.size(); ++i) {
      ASSERT_NEAR(given[i], scale * asked[i], 1e-15);
      larger[i] = given[i] * (1.0 + 1e-8);
    }
    ASSERT_GT(kHold_s * clamp.drain_watt(larger), energy);
  }
  EXPECT_GT(reduced, test::seed_count(2000) / 2);
}

TEST(PortClampLaws, WithoutCreditEachPriorityKeepsWhatFrictionAbsorbs) {
  for (const std::uint64_t seed : test::seeds(300)) {
    Random random(seed);
    const std::vector<Port> ports = random_ports(random);
    const PortClamp clamp(ports, kHold_s);
    const PortValues asked = random_effort(random, ports.size(), 2.0);
    for (const double energy : {0.0, -1.0}) {
      const PortValues given = clamp.clamp(asked, energy, 1.0);
      ASSERT_LE(clamp.drain_watt(given), 1e-14);
      for (std::size_t i = 0; i < ports.size(); ++i) {
        // the port of its priority that friction absorbs least of
        double scale = 1.0;
        for (std::size_t j = 0; j < ports.size(); ++j) {
          if (ports[j].priority != ports[i].priority) continue;
          scale = std::min(scale, ports[j].f_co / std::max(1e-300, std::abs(asked[j])));
        }
        ASSERT_NEAR(given[i], scale * asked[i], 1e-15) << "seed " << seed << " port " << i;
      }
    }
  }
}

// Torque before force: with 1 N·m/rad and N/m alike, 0.2 of friction and v_max 1, F = 1 costs 0.8 W
// on each port.
TEST(PortClamp, ReducesTheLowestPriorityFirstAndTheNextWhereThatIsNotEnough) {
  std::array<Port, 3> ports{};
  ports.fill({.f_d = 0.0, .f_co = 0.2, .q = 0.0, .v_max = 1.0, .priority = 5});
  ports[1].priority = -3;
  const PortClamp clamp(ports, 1.0);
  const PortValues asked{1.0, 1.0, -1.0};
  const auto expect = [&](double energy, double gate, double high, double low) {
    const PortValues given = clamp.clamp(asked, energy, gate);
    EXPECT_NEAR(given[0], high, 1e-8);
    EXPECT_NEAR(given[1], low, 1e-8);
    EXPECT_NEAR(given[2], -high, 1e-8);
    for (std::size_t i = 3; i < kMostPorts; ++i) EXPECT_EQ(given[i], 0.0);
  };
  expect(2.4, 1.0, 1.0, 1.0);
  expect(2.0, 1.0, 1.0, 0.6);
  expect(1.6, 1.0, 1.0, 0.2);
  expect(0.8, 1.0, 0.6, 0.2);
  expect(0.0, 1.0, 0.2, 0.2);
  // the gate closes what is beyond friction, on all of them
  expect(2.0, 0.5, 0.6, 0.4);
  expect(9.0, 0.0, 0.2, 0.2);
}

TEST(PortClamp, SaysWhatAllOfTheCreditWouldCoverOnOnePort) {
  const std::array<Port, 2> ports{Port{.f_d = 0.1, .f_co = 0.2, .v_max = 3.0},
                                  Port{.f_d = 0.0, .f_co = 0.1, .v_max = 2.0}};
  const PortClamp clamp(ports, kHold_s);
  const PortValues most = clamp.most_effort(1e-3, 1.0);
  for (std::size_t i = 0; i < 2; ++i) {
    PortValues alone{};
    alone[i] = most[i];
    EXPECT_NEAR(kHold_s * clamp.drain_watt(alone), 1e-3, 1e-12);
  }
  EXPECT_EQ(most[2], 0.0);
  EXPECT_NEAR(clamp.most_effort(1e-3, 0.5)[1], 0.5 * (0.1 + most[1]), 1e-12);
}

TEST(PortClamp, ComparesEffortsByThePowerThatTheyCouldGive) {
  const std::array<Port, 2> ports{Port{.v_max = 3.0}, Port{.v_max = 0.5}};
  const PortClamp clamp(ports, kHold_s);
  EXPECT_DOUBLE_EQ(clamp.most_watt({-2.0, 4.0}), 8.0);
}

TEST(PortClamp, TakesNoMoreThanEightPorts) {
  const std::vector<Port> ports(9);
  EXPECT_EQ(PortClamp(ports, kHold_s).count(), kMostPorts);
}

}  // namespace
}  // namespace palpate::controllers
