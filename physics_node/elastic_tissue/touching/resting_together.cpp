// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/touching/resting_together.h"

#include <algorithm>

#include "physics_node/elastic_tissue/touching/touching_bodies.h"

namespace palpate::physics {
namespace {

// So long that at its end nothing moves, and what relaxes has relaxed.
constexpr double kRestStep_s = 1000.0;
constexpr double kAtRest_m = 2e-7;
constexpr int kMostRestSteps = 60;

/// @return  whether the bodies are at rest, and lean on each other or are tied together
bool settle(Island& island, std::span<ElasticSimulation* const> bodies) {
  const std::vector<std::span<const std::optional<TipState>>> no_tips(bodies.size());
  for (int step = 0; step < kMostRestSteps; ++step) {
    std::vector<elastic::VectorXd> before_m;
    for (const ElasticSimulation* const body : bodies) before_m.push_back(body->x_m());
    island.step(bodies, no_tips, {}, false);
    const bool does_press =
        !island.ties().empty() ||
        std::any_of(island.pairs().begin(), island.pairs().end(), [](const BodyPair& pair) {
          return std::any_of(pair.touches().begin(), pair.touches().end(),
                             [](const auto& one) { return one.multiplier_newton > 0.0; });
        });
    if (!does_press) return false;
    double farthest_m = 0.0;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      if (bodies[i]->failed_steps() > 0 || !bodies[i]->x_m().allFinite()) return false;
      farthest_m = std::max(farthest_m, (bodies[i]->x_m() - before_m[i]).cwiseAbs().maxCoeff());
    }
    if (farthest_m < kAtRest_m) return true;
  }
  return true;  // nearer to it than where they began
}

}  // namespace

std::vector<std::optional<RestAmongOthers>> rests_among_others(
    std::span<const std::shared_ptr<const ElasticBody>> bodies) {
  std::vector<std::optional<RestAmongOthers>> rests(bodies.size());
  std::vector<const ElasticBody*> all;
  for (const auto& body : bodies) all.push_back(body.get());
  for (const std::vector<std::size_t>& members : Island::of(all)) {
    if (members.size() == 1) continue;
    std::vector<const ElasticBody*> own;
    std::vector<std::unique_ptr<ElasticSimulation>> made;
    std::vector<ElasticSimulation*> simulations;
    for (const std::size_t i : members) {
      own.push_back(all[i]);
      made.push_back(
          std::make_unique<ElasticSimulation>(*all[i], 0, all[i]->tip_radius_m, kRestStep_s));
      simulations.push_back(made.back().get());
    }
    Island island(own);
    if (!settle(island, simulations)) continue;
    for (std::size_t k = 0; k < members.size(); ++k) {
      rests[members[k]] =
          RestAmongOthers{.x_m = simulations[k]->x_m(), .resting = simulations[k]->rigid()};
    }
    for (const BodyTies& ties : island.ties()) {
      const auto [attached, other] = ties.members();
      rests[members[attached]]->has_torn =
          rests[members[attached]]->has_torn ||
          ties.is_tearing(*simulations[attached], *simulations[other]);
    }
  }
  return rests;
}

}  // namespace palpate::physics
