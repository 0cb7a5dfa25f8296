// SPDX-License-Identifier: Apache-2.0
#include "physics_node/surfaces/box_tree.h"

#include <algorithm>

#include "common/core/check.h"

namespace palpate::physics {

BoxTree::BoxTree(std::vector<Item> items, std::size_t leaf_items) {
  PALPATE_REQUIRE(leaf_items > 0);
  if (items.empty()) return;
  build(items, 0, leaf_items);
  nodes_.shrink_to_fit();
  order_.reserve(items.size());
  for (const Item& item : items) order_.push_back(item.index);
}

void BoxTree::build(std::span<Item> items, std::uint32_t first, std::size_t leaf_items) {
  Node node;
  node.bounds = items[0].bounds;
  for (const Item& item : items.subspan(1)) node.bounds.include(item.bounds);
  const std::size_t here = nodes_.size();
  nodes_.push_back(node);

  if (items.size() <= leaf_items) {
    nodes_[here].first = first;
    nodes_[here].count = static_cast<std::uint32_t>(items.size());
  } else {
    // two halves along the longest axis
    const int axis = node.bounds.longest_axis();
    const std::size_t middle = items.size() / 2;
    std::nth_element(items.begin(), items.begin() + static_cast<std::ptrdiff_t>(middle),
                     items.end(), [axis](const Item& a, const Item& b) {
                       return a.sort_key[axis] != b.sort_key[axis]
                                  ? a.sort_key[axis] < b.sort_key[axis]
                                  : a.index < b.index;
                     });
    build(items.first(middle), first, leaf_items);
    build(items.subspan(middle), first + static_cast<std::uint32_t>(middle), leaf_items);
  }
  nodes_[here].end = static_cast<std::uint32_t>(nodes_.size());
}

}  // namespace palpate::physics
