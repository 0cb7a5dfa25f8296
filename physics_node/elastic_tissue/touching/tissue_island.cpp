// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/touching/tissue_island.h"

#include <algorithm>
#include <span>
#include <utility>

namespace palpate::physics {

TissueIsland::TissueIsland(std::vector<ElasticTissue*> tissues) : tissues_(std::move(tissues)) {
  if (tissues_.size() == 1) return;
  std::vector<const ElasticBody*> bodies;
  for (const ElasticTissue* tissue : tissues_) bodies.push_back(&tissue->body());
  island_.emplace(bodies);
}

std::vector<TissueIsland> TissueIsland::of(const std::vector<ElasticTissue*>& tissues) {
  std::vector<const ElasticBody*> bodies;
  for (const ElasticTissue* tissue : tissues) bodies.push_back(&tissue->body());
  std::vector<TissueIsland> islands;
  for (const std::vector<std::size_t>& members : Island::of(bodies)) {
    std::vector<ElasticTissue*> own;
    for (const std::size_t i : members) own.push_back(tissues[i]);
    islands.emplace_back(std::move(own));
  }
  return islands;
}

void TissueIsland::solve(double step_s, double ahead_s) {
  if (!island_) {
    tissues_[0]->solve(step_s, ahead_s);
    return;
  }
  std::vector<ElasticSimulation*> bodies;
  std::vector<std::span<const std::optional<TipState>>> tips;
  std::vector<elastic::SurfaceCompliance*> compliances;
  for (ElasticTissue* tissue : tissues_) {
    tissue->begin_solve(step_s, ahead_s);
    bodies.push_back(&tissue->simulation());
    tips.emplace_back(tissue->tips());
    compliances.push_back(&tissue->compliance());
  }
  const std::vector<char> has_stepped = island_->step(bodies, tips, step_s);
  for (std::size_t i = 0; i < tissues_.size(); ++i) {
    tissues_[i]->set_leaning(island_->supports_of(i, compliances),
                             island_->tie_points_of(i, compliances));
  }
  for (std::size_t i = 0; i < tissues_.size(); ++i) {
    tissues_[i]->end_solve(step_s, has_stepped[i] != 0);
  }
}

bool TissueIsland::is_fast() const {
  return std::any_of(tissues_.begin(), tissues_.end(),
                     [](const ElasticTissue* tissue) { return tissue->is_fast(); });
}

void TissueIsland::publish() {
  for (ElasticTissue* tissue : tissues_) tissue->publish();
}

void TissueIsland::note_late() {
  for (ElasticTissue* tissue : tissues_) tissue->note_late();
}

}  // namespace palpate::physics
