// SPDX-License-Identifier: Apache-2.0
// box_tree.h — a bounding volume hierarchy: which items are near a box, or nearest to a point,
// without a look at each.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "common/contact/bounds.h"
#include "common/core/vector.h"

namespace palpate::physics {

/// A binary tree of bounding boxes in one array, depth first: the first child of a node follows it,
/// and each node knows where its subtree ends, so that a distant subtree is skipped. For items with
/// an extent, such as triangles and tissues; points have the Octree, which is smaller.
///
/// Immutable. Queries neither allocate nor lock nor throw.
class BoxTree {
 public:
  struct Item {
    Bounds bounds;
    Vector3 sort_key = Vector3::Zero();  ///< the halves of a node are ordered by this
    std::uint32_t index = 0;             ///< identifies the item; breaks ties of the key
  };

  BoxTree() = default;
  /// @param leaf_items  ≥ 1: largest number of items without a further division
  BoxTree(std::vector<Item> items, std::size_t leaf_items);

  /// The indices of the items in the order of the tree: neighbours in space are neighbours here.
  [[nodiscard]] std::span<const std::uint32_t> order() const noexcept { return order_; }

  /// The box around all items. The tree must not be empty.
  [[nodiscard]] const Bounds& bounds() const noexcept { return nodes_[0].bounds; }

  /// Calls `visit(index)` for every item of each leaf whose box meets this one.
  template <class Visit>
  void visit_near(const Bounds& box, const Visit& visit) const noexcept {
    for (std::uint32_t i = 0; i < nodes_.size();) {
      const Node& node = nodes_[i];
      if (!node.bounds.meets(box)) {
        i = node.end;
        continue;
      }
      for (std::uint32_t k = node.first; k < node.first + node.count; ++k) visit(order_[k]);
      ++i;
    }
  }

  /// Calls `offer(place)` with places in order(), those of nearer boxes first, until no box is
  /// within the limit. `offer` returns the squared distance of the nearest item so far, which
  /// becomes the limit.
  /// @param limit  squared distance [m²] from which the search starts
  template <class Offer>
  void visit_nearest(const Vector3& point_m, double limit, const Offer& offer) const noexcept {
    if (nodes_.empty()) return;
    struct Waiting {
      double squared_distance;
      std::uint32_t node;
    };
    // each level halves the items: 32 levels hold 2³², and each leaves one sibling waiting
    std::array<Waiting, 40> stack;
    std::size_t size = 0;
    stack[size++] = {nodes_[0].bounds.squared_distance(point_m), 0};
    while (size > 0) {
      const Waiting here = stack[--size];
      if (!(here.squared_distance <= limit)) continue;
      const Node& node = nodes_[here.node];
      if (node.count > 0) {
        for (std::uint32_t k = node.first; k < node.first + node.count; ++k) limit = offer(k);
        continue;
      }
      const std::uint32_t first = here.node + 1;
      const std::uint32_t second = nodes_[first].end;
      Waiting near{nodes_[first].bounds.squared_distance(point_m), first};
      Waiting far{nodes_[second].bounds.squared_distance(point_m), second};
      if (far.squared_distance < near.squared_distance) std::swap(near, far);
      stack[size++] = far;
      stack[size++] = near;
    }
  }

  /// Frees order() for callers that have put their items into it. visit_near() needs it.
  void forget_order() noexcept { std::vector<std::uint32_t>().swap(order_); }

  /// Heap memory held.
  [[nodiscard]] std::size_t bytes() const noexcept {
    return nodes_.capacity() * sizeof(Node) + order_.capacity() * sizeof(std::uint32_t);
  }

 private:
  struct Node {
    Bounds bounds;
    std::uint32_t end = 0;    // first node after this subtree
    std::uint32_t first = 0;  // of a leaf: place of its first item in order_
    std::uint32_t count = 0;  // of a leaf: its items; else 0
  };
  void build(std::span<Item> items, std::uint32_t first, std::size_t leaf_items);

  std::vector<Node> nodes_;
  std::vector<std::uint32_t> order_;
};

}  // namespace palpate::physics
