// SPDX-License-Identifier: Apache-2.0
// An elastic body that lies on what moves.
#include <algorithm>
#include <cmath>
#include <utility>

#include "physics_node/elastic_tissue/elastic_simulation.h"

namespace palpate::physics {
namespace {

// What the body lies on goes to its first place in parts of at most this length.
constexpr double kCarriedPart_m = 1e-3;
constexpr int kMostCarriedParts = 40;

}  // namespace

/// What the body lies on goes to where it is in this step, and the body with it, as slowly as that
/// it lies still.
void ElasticSimulation::be_carried() {
  const std::optional<double> before_s = std::exchange(carried_s_, std::nullopt);
  const double to_s = before_s ? part_time_s_ : *time_s_;
  const std::vector<char> is_near =
      std::exchange(tips_.is_near, std::vector<char>(touches_.size()));
  const int parts =
      std::clamp(static_cast<int>(std::ceil(tips_.rigid.way_to_m(to_s) / kCarriedPart_m)), 1,
                 kMostCarriedParts);
  before_m_ = dynamics_.x_m();
  for (int part = parts; part > 0; --part) {
    tips_.rigid.move_towards(to_s, 1.0 / part);
    static_cast<void>(settle());
  }
  tips_.is_near = is_near;
  carried_s_ = before_s.value_or(to_s);
}

}  // namespace palpate::physics
