// SPDX-License-Identifier: Apache-2.0
// random_elastic.h — random news of elastic bodies that satisfy every rule of hop 3: what a physics
// sends whose compliance is none.
#pragma once

#include <cmath>

#include "common/core/elastic/elastic_patch.h"
#include "deploy/lockstep/random_surface.h"

namespace palpate {

/// From 10^low to 10^high.
inline double random_magnitude(Random& random, double low, double high) {
  return std::pow(10.0, random.uniform(low, high));
}

inline void randomise(ElasticPoint& point, Random& random) {
  const auto some = [&] { return static_cast<std::int16_t>(random.bits()); };
  point = {.patch = static_cast<std::uint32_t>(random.below(kMaxElasticPatches)),
           .slot = static_cast<std::uint32_t>(random.below(kElasticSlots)),
           .version = 1 + static_cast<std::uint32_t>(random.below(1U << 20U)),
           .rest_m = random_vector(random, 1.0),
           .rigid_give_m_per_newton = static_cast<float>(random_magnitude(random, -11.0, 2.0)),
           .is_held = random.chance(0.3),
           .step_m_per_newton = static_cast<float>(random_magnitude(random, -11.0, 2.0))};
  // v vᵀ and a diagonal
  std::array<int, 3> v{};
  for (int& x : v) x = static_cast<int>(random.below(300)) - 150;
  const auto entry = [&](std::size_t i, std::size_t k) {
    return static_cast<std::int16_t>(v[i] * v[k] +
                                     (i == k ? static_cast<int>(random.below(3)) : 0));
  };
  point.own = {entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)};
  for (std::size_t other = 0; other < kElasticSlots; ++other) {
    if (other == point.slot || random.chance(0.3)) continue;
    point.has_other.set(other);
    for (std::int16_t& x : point.others[other]) x = some();
  }
}

inline void randomise(ElasticState& state, Random& random) {
  const auto some = [&] { return static_cast<std::int16_t>(random.bits()); };
  state = {.patch = static_cast<std::uint32_t>(random.below(kMaxElasticPatches)),
           .tissue = static_cast<std::uint32_t>(random.bits()),
           .number = 1 + static_cast<std::uint32_t>(random.below(1U << 20U)),
           .tip_radius_m = random_magnitude(random, -4.0, 0.0),
           .center_m = random_vector(random, 1.0),
           .force_outside_patch_newton = random_vector(random, 1e4),
           .friction_coefficient = random.uniform(0.01, 10.0),
           .friction_stiffness_newton_per_m = random_magnitude(random, 0.0, 5.9),
           .has_rest = random.chance(0.5),
           .relaxation_s = random.chance(0.5) ? random_magnitude(random, -4.0, 1.0) : 0.0,
           .normal = random_vector(random, 1.0).normalized(),
           .from_m = random_vector(random, 1.0),
           .to_m = random_vector(random, 1.0),
           .radius_m = random.uniform(0.0, 100.0),
           .away_step_m = static_cast<float>(random_magnitude(random, -6.0, 0.0)),
           .force_step_newton = static_cast<float>(random_magnitude(random, -3.0, 4.0))};
  if (state.has_rest)
    state.compliance_ratio = random.uniform(kMinComplianceRatio, kMaxComplianceRatio);
  if (random.chance(0.3)) {
    state.carried_m = random_vector(random, 0.1);
    state.carried_m_per_s = random_vector(random, 5.0);
    state.carried_at_s = random.uniform(0.0, 10.0);
  }
  for (ElasticPlace& place : state.places) {
    if (random.chance(0.3)) continue;
    place.version = 1 + static_cast<std::uint32_t>(random.below(1U << 20U));
    for (std::int16_t& x : place.away) x = some();
    place.rest = place.away;
    if (state.relaxation_s > 0.0) {
      for (std::int16_t& x : place.rest) x = some();
    }
    if (random.chance(0.5)) continue;
    for (std::int16_t& x : place.force) x = some();
  }
}

inline void randomise(ElasticNews& news, Random& random) {
  news.store_id = random.bits() | 1;
  news.number = random.bits() | 1;
  news.has_point = random.chance(0.5);
  if (news.has_point) {
    randomise(news.point, random);
  } else {
    randomise(news.state, random);
  }
}

}  // namespace palpate
