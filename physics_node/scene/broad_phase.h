// broad_phase.h — which tissues can be near the tool, without looking at each.
#pragma once

#include <cstdint>
#include <vector>

#include "common/core/vector.h"
#include "physics_node/surfaces/geometry.h"

namespace palpate::physics {

/// A binary tree of bounding boxes in one array, depth first: the children of a node follow it, and
/// every node knows where its subtree ends, so that a far subtree is stepped over.
class BroadPhase {
 public:
  struct Item {
    Bounds bounds;
    std::uint32_t index = 0;  ///< handed back by visit_near
  };

  BroadPhase() = default;
  explicit BroadPhase(std::vector<Item> items);

  /// Calls `visit(index)` for every item whose bounds meet this box.
  template <class Visit>
  void visit_near(const Bounds& box, const Visit& visit) const noexcept {
    for (std::size_t i = 0; i < nodes_.size();) {
      const Node& node = nodes_[i];
      const bool is_near = (box.highest_m.array() >= node.bounds.lowest_m.array()).all() &&
                           (box.lowest_m.array() <= node.bounds.highest_m.array()).all();
      if (!is_near) {
        i = node.end;
        continue;
      }
      if (node.items == 1) visit(node.index);
      ++i;
    }
  }

 private:
  struct Node {
    Bounds bounds;
    std::size_t end = 0;  // first node after this subtree
    std::uint32_t items = 0;
    std::uint32_t index = 0;  // of the item, where there is one only
  };
  void build(std::vector<Item>& items, std::size_t first, std::size_t last);

  std::vector<Node> nodes_;
};

}  // namespace palpate::physics
