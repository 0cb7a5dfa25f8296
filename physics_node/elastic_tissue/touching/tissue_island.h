// SPDX-License-Identifier: Apache-2.0
// tissue_island.h — elastic tissues that may touch each other, and are solved together.
#pragma once

#include <optional>
#include <vector>

#include "physics_node/elastic_tissue/elastic_tissue.h"
#include "physics_node/elastic_tissue/touching/touching_bodies.h"

namespace palpate::physics {

/// One tissue, or several of one solve rate. On the slow thread of all of them; as each of its
/// tissues by itself, but for solve().
class TissueIsland {
 public:
  /// @param tissues  not empty; must outlive it
  explicit TissueIsland(std::vector<ElasticTissue*> tissues);

  /// The islands of all tissues, in their order.
  [[nodiscard]] static std::vector<TissueIsland> of(const std::vector<ElasticTissue*>& tissues);

  /// @see Island::step
  void solve(double step_s, double ahead_s);
  [[nodiscard]] bool is_fast() const;
  [[nodiscard]] double longest_step_s() const noexcept { return tissues_[0]->longest_step_s(); }
  [[nodiscard]] double least_step_s() const noexcept { return tissues_[0]->least_step_s(); }
  void publish();
  void note_late();
  /// Of the contact between its tissues; these do it themselves. @pre  of the same bodies
  void continue_as(const TissueIsland& other) { island_ = other.island_; }

  [[nodiscard]] const std::optional<Island>& contact() const noexcept { return island_; }

 private:
  std::vector<ElasticTissue*> tissues_;
  std::optional<Island> island_;  // none: one tissue
};

}  // namespace palpate::physics
