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
      if (bodies[i]->touched(bodies[j]->tissue) == nullptr &&
          !bodies[i]->is_tied_to(bodies[j]->tissue)) {
        continue;
      }
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
    for (std::size_t j = 0; j < bodies.size(); ++j) {
      if (bodies[i]->is_tied_to(bodies[j]->tissue)) ties_.emplace_back(i, j);
    }
  }
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

std::vector<elastic::TiePoint> Island::tie_points_of(
    std::size_t body, std::span<elastic::SurfaceCompliance* const> compliances) const {
  std::vector<elastic::TiePoint> points;
  for (const BodyTies& ties : ties_) {
    const auto [attached, other] = ties.members();
    if (attached != body && other != body) continue;
    ties.add_tie_points(other == body, *compliances[attached == body ? other : attached], points);
  }
  return points;
}

/// To each body what the ties and the others store that it is tied to, directly or through others.
void Island::share_energy(std::span<ElasticSimulation* const> bodies) const {
  if (ties_.empty()) return;
  std::vector<std::size_t> group(bodies.size());
  std::iota(group.begin(), group.end(), std::size_t{0});
  for (const BodyTies& ties : ties_) {
    const auto [a, b] = ties.members();
    std::replace(group.begin(), group.end(), std::max(group[a], group[b]),
                 std::min(group[a], group[b]));
  }
  std::vector<double> of_group(bodies.size(), 0.0);
  for (const BodyTies& ties : ties_) {
    const auto [attached, other] = ties.members();
    of_group[group[attached]] += ties.stored_joule(*bodies[attached], *bodies[other]);
  }
  for (std::size_t i = 0; i < bodies.size(); ++i) of_group[group[i]] += bodies[i]->own_joule();
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    if (std::count(group.begin(), group.end(), group[i]) == 1) continue;
    bodies[i]->set_stored_elsewhere(of_group[group[i]] - bodies[i]->own_joule());
  }
}

std::vector<char> Island::step(std::span<ElasticSimulation* const> bodies,
                               std::span<const std::span<const std::optional<TipState>>> tips,
                               std::optional<double> step_s, bool may_tear) {
  std::vector<char> has_stepped(bodies.size(), 0);
  for (BodyPair& pair : pairs_) {
    ElasticSimulation& first = *bodies[pair.members()[0]];
    ElasticSimulation& second = *bodies[pair.members()[1]];
    if (first.is_asleep() && second.is_asleep()) continue;
    pair.look(first, second, step_s.value_or(first.step_s()));
  }
  for (BodyTies& ties : ties_) {
    const auto [attached, other] = ties.members();
    if (bodies[attached]->is_asleep() && bodies[other]->is_asleep()) continue;
    ties.look(*bodies[attached], *bodies[other]);
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
    if (ties_.empty()) return;
    std::vector<elastic::Tie> ties;
    bool is_pulled = false;
    for (const BodyTies& one : ties_) {
      const auto [attached, other] = one.members();
      if (attached != i && other != i) continue;
      one.add_ties(*bodies[attached], *bodies[other], other == i, ties);
      is_pulled =
          is_pulled || (one.is_there() && !bodies[attached == i ? other : attached]->is_asleep());
    }
    bodies[i]->set_ties(std::move(ties), is_pulled);
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
    for (BodyTies& ties : ties_) {
      const auto [attached, other] = ties.members();
      if (has_stepped[attached] == 0 && has_stepped[other] == 0) continue;
      farthest_m = std::max(farthest_m, ties.update(*bodies[attached], *bodies[other]));
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
  for (const BodyTies& ties : ties_) {
    const auto [attached, other] = ties.members();
    if (has_stepped[attached] == 0 && has_stepped[other] == 0) continue;
    if (may_tear) ties.tear(*bodies[attached], *bodies[other]);
  }
  share_energy(bodies);
  return has_stepped;
}

}  // namespace palpate::physics
