// SPDX-License-Identifier: Apache-2.0
// together.h — elastic bodies that touch each other, without a loop around them.
#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "physics_node/elastic_tissue/touching/touching_bodies.h"
#include "tests/unit/elastic/touching/touching_scene.h"

namespace palpate::physics {

inline constexpr double kPairTip_m = 0.006;
inline constexpr double kStep_s = 0.02;

/// All bodies of a scene, solved as islands, under one tip.
struct Together {
  std::vector<std::shared_ptr<const ElasticBody>> bodies;
  std::vector<std::unique_ptr<ElasticSimulation>> simulations;
  std::unique_ptr<Island> island;

  explicit Together(const SceneConfig& scene, double step_s = kStep_s)
      : bodies(elastic_bodies_of(scene)) {
    std::vector<const ElasticBody*> all;
    for (const auto& body : bodies) {
      all.push_back(body.get());
      simulations.push_back(std::make_unique<ElasticSimulation>(*body, 1, kPairTip_m, step_s));
    }
    island = std::make_unique<Island>(all);
  }
  /// Of what moves, for the next steps.
  void set_time(double time_s) {
    for (const auto& one : simulations) one->set_time(time_s);
  }
  /// @return  how many bodies made a step
  /// @param touched  the body that the tip may touch, or that jaws hold
  int step(std::optional<TipState> tip = {}, std::size_t touched = 0) {
    std::vector<std::array<std::optional<TipState>, 1>> tips(bodies.size());
    tips[touched][0] = tip;
    std::vector<ElasticSimulation*> all;
    std::vector<std::span<const std::optional<TipState>>> spans;
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      all.push_back(simulations[i].get());
      spans.emplace_back(tips[i]);
    }
    const std::vector<char> stepped = island->step(all, spans, {});
    return static_cast<int>(std::count(stepped.begin(), stepped.end(), 1));
  }
  [[nodiscard]] double deepest_m() const {
    return island->pairs()[0].deepest_m(*simulations[0], *simulations[1]);
  }
  [[nodiscard]] bool is_finite() const {
    return std::all_of(simulations.begin(), simulations.end(),
                       [](const auto& one) { return one->x_m().allFinite(); });
  }
  [[nodiscard]] bool is_inverted() const {
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      if (bodies[i]->body->has_inverted_element(simulations[i]->x_m())) return true;
    }
    return false;
  }
};

}  // namespace palpate::physics
