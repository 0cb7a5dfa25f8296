#include "physics_node/scene/broad_phase.h"

#include <algorithm>

namespace palpate::physics {

BroadPhase::BroadPhase(std::vector<Item> items) {
  if (items.empty()) return;
  nodes_.reserve(2 * items.size() - 1);
  build(items, 0, items.size());
}

void BroadPhase::build(std::vector<Item>& items, std::size_t first, std::size_t last) {
  Bounds bounds = items[first].bounds;
  for (std::size_t i = first + 1; i < last; ++i) {
    bounds.lowest_m = bounds.lowest_m.cwiseMin(items[i].bounds.lowest_m);
    bounds.highest_m = bounds.highest_m.cwiseMax(items[i].bounds.highest_m);
  }
  const std::size_t here = nodes_.size();
  nodes_.push_back({.bounds = bounds,
                    .items = static_cast<std::uint32_t>(last - first),
                    .index = items[first].index});

  // two halves along the longest axis
  if (last - first > 1) {
    int axis = 0;
    (bounds.highest_m - bounds.lowest_m).maxCoeff(&axis);
    const std::size_t middle = first + (last - first) / 2;
    const auto at = [&](std::size_t i) { return items.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(first), at(middle), at(last), [axis](const Item& a, const Item& b) {
      const auto twice_center = [axis](const Item& item) {
        return item.bounds.lowest_m[axis] + item.bounds.highest_m[axis];
      };
      return twice_center(a) < twice_center(b);
    });
    build(items, first, middle);
    build(items, middle, last);
  }
  nodes_[here].end = nodes_.size();
}

}  // namespace palpate::physics
