// SPDX-License-Identifier: Apache-2.0
// Elastic bodies that may touch each other, solved together.
#include <algorithm>
#include <numeric>
#include <utility>

#include "physics_node/elastic_tissue/touching/touching_bodies.h"

namespace palpate::physics {
namespace {

// Another pass is made while a force changes by more than the penalty at this depth.
constexpr double kClose_m = 2e-6;

}  // namespace

std::vector<std::vector<std::size_t>> Island::of(std::span<const ElasticBody* const> bodies) {
  std::vector<std::size_t> island_of(bodies.size());
  std::iota(island_of.begin(), island_of.end(), std::size_t{0});
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    for (std::size_t j = 0; j < bodies.size(); ++j) {
      if (bodies[i]->touched(bodies[j]->tissue) == nullptr) continue;
      const std::size_t from = std::max(island_of[i], island_of[j]);
      const std::size_t to = std::min(island_of[i], island_of[j]);
      std::replace(island_of.begin(), island_of.end(), from, to);
    }
  }
  std::vector<std::vector<std::size_t>> islands;
  for (std::size_t first = 0; first < bodies.size(); ++first) {
    if (island_of[first] != first) continue;
    islands.emplace_back();
    for (std::size_t i = first; i < bodies.size(); ++i) {
      if (island_of[i] == first) islands.back().push_back(i);
    }
  }
  return islands;
}

Island::Island(std::span<const ElasticBody* const> bodies) {
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    for (std::size_t j = i + 1; j < bodies.size(); ++j) {
      const ElasticNeighbor* const one = bodies[i]->touched(bodies[j]->tissue);
      const ElasticNeighbor* const other = bodies[j]->touched(bodies[i]->tissue);
      if (one == nullptr && other == nullptr) continue;
      pairs_.emplace_back(i, j,
                          std::max(one == nullptr ? 0.0 : one->friction_coefficient,
                                   other == nullptr ? 0.0 : other->friction_coefficient));
    }
  }
}

std::vector<elastic::Support> Island::supports_of(
    std::size_t body, std::span<elastic::SurfaceCompliance* const> compliances) const {
  std::vector<elastic::Support> supports;
  for (const BodyPair& pair : pairs_) {
    const auto [first, second] = pair.members();
    if (first != body && second != body) continue;
    elastic::SurfaceCompliance* const other = compliances[first == body ? second : first];
    for (const BodyPair::Touch& one : pair.touches()) {
      if (!(one.multiplier_newton > 0.0)) continue;
      const bool is_own_node = one.is_second == (second == body);
      supports.push_back({.point = is_own_node ? one.node_point() : one.triangle_point(),
                          .direction = one.normal,
                          .other = other,
                          .other_point = is_own_node ? one.triangle_point() : one.node_point()});
      if (pair.is_stuck(one)) elastic::add_across(supports);
    }
  }
  return supports;
}

std::vector<char> Island::step(std::span<ElasticSimulation* const> bodies,
                               std::span<const std::span<const std::optional<TipState>>> tips,
                               std::optional<double> step_s) {
  std::vector<char> has_stepped(bodies.size(), 0);
  for (BodyPair& pair : pairs_) {
    ElasticSimulation& first = *bodies[pair.members()[0]];
    ElasticSimulation& second = *bodies[pair.members()[1]];
    if (first.is_asleep() && second.is_asleep()) continue;
    pair.look(first, second, step_s.value_or(first.step_s()));
  }
  const auto give_planes = [&](std::size_t i) {
    std::vector<elastic::ContactPlane> planes;
    bool is_moving = false;  // something that it touches
    for (const BodyPair& pair : pairs_) {
      const auto [first, second] = pair.members();
      if ((first != i && second != i) || !pair.is_near()) continue;
      pair.add_planes(*bodies[first], *bodies[second], second == i, planes);
      is_moving = is_moving || !bodies[first == i ? second : first]->is_asleep();
    }
    bodies[i]->set_neighbors(std::move(planes), is_moving);
  };
  // one that wakes up in this step wakes the others in the next
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    give_planes(i);
    has_stepped[i] = bodies[i]->step(tips[i], step_s) ? 1 : 0;
  }
  const auto update = [&] {
    double farthest_m = 0.0;
    for (BodyPair& pair : pairs_) {
      const auto [first, second] = pair.members();
      if (has_stepped[first] == 0 && has_stepped[second] == 0) continue;
      farthest_m = std::max(farthest_m, pair.update(*bodies[first], *bodies[second]));
    }
    return farthest_m;
  };
  double farthest_m = update();
  for (int pass = 1; pass < kMostPasses && farthest_m > kClose_m; ++pass) {
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      if (has_stepped[i] == 0) continue;
      give_planes(i);
      bodies[i]->step_again();
    }
    farthest_m = update();
  }
  return has_stepped;
}

}  // namespace palpate::physics
