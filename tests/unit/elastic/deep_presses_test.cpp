// SPDX-License-Identifier: Apache-2.0
// Fast presses of half to one and a half radii into bodies that nobody drew, where thin places turn
// over and what is fixed cannot give way, against a slow full solution.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "common/core/check.h"
#include "tests/property/seeds.h"
#include "tests/unit/elastic/random_bodies.h"

namespace palpate::physics {
namespace {

TEST(DeepPresses, ComeToTheForceOfASlowFullSolution) {
  const test::TempFolder folder;
  int held = 0;
  int beyond = 0;
  int beyond_own = 0;
  int gaining = 0;
  for (const std::uint64_t seed : test::seeds(100)) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    RandomBody random(seed, folder);
    std::vector<std::shared_ptr<const ElasticBody>> bodies;
    try {
      bodies = elastic_bodies_of(random.scene);
    } catch (const SetupError&) {
      continue;
    }
    const Place place = place_on(*bodies.front(), random);
    const double speed_m_per_s = random.between(0.03, 0.3);
    const double depth_m = random.between(0.5, 1.5) * kTip_m;
    const Cycle cycle = press_and_leave(bodies.front(), place, depth_m, speed_m_per_s);
    const FullPress full(*bodies.front(), place, depth_m);
    EXPECT_TRUE(cycle.is_finite);
    EXPECT_LT(cycle.last_newton.norm(), 0.01 * cycle.most_newton + 1e-6);
    ++held;
    const Vector3& wanted = full.touch().force_on_tool_newton;
    const double enough_newton = 0.1 * wanted.norm() + 1e-3;
    beyond += (cycle.rest_newton - wanted).norm() > enough_newton ? 1 : 0;
    beyond_own += cycle.error_newton > 0.1 * cycle.rest_newton.norm() + 1e-3 ? 1 : 0;
    gaining += cycle.work_joule < -0.02 * cycle.most_newton * depth_m ? 1 : 0;
    // rounds of the contact come to an end
    if (!full.has_failed()) {
      EXPECT_LT(full.largest_gap_m(), 0.003 * kTip_m);
    }
  }
  std::printf(
      "%d bodies: %d beyond 10 %% of a slow press, %d beyond 10 %% of their own full solution, %d "
      "give back more than they took\n",
      held, beyond, beyond_own, gaining);
  if (test::kIsSanitized) return;  // too few bodies for a share of them
  EXPECT_LE(beyond, held / 6);
  EXPECT_LE(beyond_own, held / 20);
  // a body that has become stiffer follows a tip that leaves fast too well, until the next solution
  EXPECT_LE(gaining, held / 12);
}

}  // namespace
}  // namespace palpate::physics
