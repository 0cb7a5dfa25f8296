// SPDX-License-Identifier: Apache-2.0
// The state of an elastic tissue: to continue from, to be shown, and what of it is not kept.
#include <mutex>
#include <utility>

#include "physics_node/elastic_tissue/elastic_tissue.h"

namespace palpate::physics {

void ElasticTissue::continue_as(const ElasticTissue& other) {
  simulation_.continue_as(other.simulation_);
  for (std::size_t i = 0; i < tools_.size(); ++i) {
    Tool& own = *tools_[i];
    own = *other.tools_[i];
    own.stepped = own.prepared.place_of(other.tools_[i]->prepared, own.stepped);
    own.patch = {};
    makers_[i].reset();
  }
  tips_ = other.tips_;
  figures_ = other.figures_;
  without_compliance_ = other.without_compliance_;
  hasty_solves_ = other.hasty_solves_;
  figures_out_ = other.figures_out_;
  has_moved_ = true;
}

/// What the next solution makes again.
void ElasticTissue::fold() {
  simulation_.fold();
  for (auto& tool : tools_) {
    if (tool->last) tool->last->fold();
    Prepared* const spare = tool->prepared.spare();
    if (spare == nullptr) continue;
    spare->contact.reset();
    spare->probe.reset();
  }
}

void ElasticTissue::show() {
  const std::unique_lock lock(shown_mutex_, std::try_to_lock);
  if (!lock || !is_wanted_ || !has_moved_) return;
  is_wanted_ = has_moved_ = false;
  read_surface(vertices_m_, strain_);
  is_new_ = true;
}

void ElasticTissue::read_surface(std::vector<float>& vertices_m, std::vector<float>& strain) const {
  const elastic::VectorXd& x = simulation_.x_m();
  vertices_m.clear();
  for (const std::uint32_t node : body_->shown_nodes) {
    for (Eigen::Index i = 0; i < 3; ++i) {
      vertices_m.push_back(static_cast<float>(x[3 * Eigen::Index{node} + i]));
    }
  }
  simulation_.shown_strain(strain);
}

bool ElasticTissue::take_surface(std::vector<float>& vertices_m, std::vector<float>& strain) {
  const std::scoped_lock lock(shown_mutex_);
  is_wanted_ = true;
  if (!std::exchange(is_new_, false)) return false;
  vertices_m = vertices_m_;
  strain = strain_;
  return true;
}

}  // namespace palpate::physics
