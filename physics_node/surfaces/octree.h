// SPDX-License-Identifier: Apache-2.0
// octree.h — nearest points of a cloud; near points are near in memory.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace palpate::physics {

/// An immutable octree over points. Points are in the order of their Morton code, nodes in one
/// array with siblings side by side, each with the smallest box around its points; levels without a
/// branch are omitted.
///
/// Coordinates are float, relative to the middle of the cloud. Queries neither allocate nor lock
/// nor throw, and are thread-safe.
class Octree {
 public:
  /// `reach` is the radius of the ball in which visit_reaching() finds the point; 0: nowhere.
  struct Point {
    float x = 0.0F;
    float y = 0.0F;
    float z = 0.0F;
    float reach = 0.0F;
  };
  struct Neighbor {
    float squared_distance = 0.0F;
    std::uint32_t point = 0;  ///< index into points()
  };
  /// Where the last query of one caller ended: the next one starts there. It changes the time of an
  /// exact query, never its result.
  struct Hint {
    std::uint32_t leaf = 0;
    std::uint32_t cells_visited = 0;  ///< by the caller's queries so far
  };

  Octree() = default;

  /// Of points that share a cell of 2⁻²¹ of the cloud's size only the first is kept.
  /// @param points  finite; any number up to 2³¹
  explicit Octree(std::span<const Point> points);

  [[nodiscard]] std::span<const Point> points() const noexcept { return points_; }
  /// order()[i] is the index of points()[i] in the constructor's list.
  [[nodiscard]] std::span<const std::uint32_t> order() const noexcept { return order_; }
  /// Frees order(), which is needed only during construction of what uses the octree.
  void forget_order() noexcept { std::vector<std::uint32_t>().swap(order_); }

  /// @param reaches  one of each point, in the order of points()
  void set_reaches(std::span<const float> reaches) noexcept;

  /// Finds the `found.size()` nearest points no farther than `within`, nearest first; equally far
  /// ones by index.
  ///
  /// @param overshoot_ratio  ≥ 0: how much farther than the nearest points the result may be. Above
  ///     0 a query that is almost equally far from many points is faster, and the result may depend
  ///     on the hint.
  /// @return number of points found
  std::size_t nearest(const Eigen::Vector3f& center, std::span<Neighbor> found, Hint& hint,
                      float within = std::numeric_limits<float>::max(),
                      float overshoot_ratio = 0.0F) const noexcept;

  /// Calls `visit(index, squared_distance)` for every point no farther than `radius`.
  template <class Visit>
  void visit_within(const Eigen::Vector3f& center, float radius,
                    const Visit& visit) const noexcept {
    const float squared_radius = radius * radius;
    visit_if(
        center, [=](const Node&) { return squared_radius; },
        [=](const Point&) { return squared_radius; }, visit);
  }

  /// Calls `visit(index, squared_distance)` for every point whose reach includes `center`.
  /// @return number of cells visited
  template <class Visit>
  std::uint32_t visit_reaching(const Eigen::Vector3f& center, const Visit& visit) const noexcept {
    return visit_if(
        center, [](const Node& node) { return node.reach * node.reach; },
        [](const Point& point) { return point.reach * point.reach; }, visit);
  }

  /// Heap memory held.
  [[nodiscard]] std::size_t bytes() const noexcept {
    return points_.capacity() * sizeof(Point) + nodes_.capacity() * sizeof(Node) +
           order_.capacity() * sizeof(std::uint32_t);
  }

 private:
  static constexpr int kLevels = 21;  // of 3 bits in a 64-bit code
  // at each level at most 7 siblings wait on the stack
  static constexpr std::size_t kStackSize = 7 * kLevels + 8;

  struct Node {
    std::array<float, 3> lowest{};
    std::array<float, 3> highest{};
    float reach = 0.0F;       // largest of its points
    std::uint32_t first = 0;  // point of a leaf, else child
    std::uint32_t count = 0;  // points of a leaf, else 0
    std::uint32_t children = 0;
  };
  struct Keyed {
    std::uint64_t code = 0;
    std::uint32_t index = 0;
  };

  static float squared_distance(const Eigen::Vector3f& a, const Point& b) noexcept {
    const float x = a.x() - b.x;
    const float y = a.y() - b.y;
    const float z = a.z() - b.z;
    return x * x + y * y + z * z;
  }
  static float squared_distance(const Eigen::Vector3f& a, const Node& box) noexcept {
    float sum = 0.0F;
    for (int axis = 0; axis < 3; ++axis) {
      const auto i = static_cast<std::size_t>(axis);
      const float below = box.lowest[i] - a[axis];
      const float above = a[axis] - box.highest[i];
      const float beyond = std::max(std::max(below, above), 0.0F);
      sum += beyond * beyond;
    }
    return sum;
  }

  template <class NodeLimit, class PointLimit, class Visit>
  std::uint32_t visit_if(const Eigen::Vector3f& center, const NodeLimit& node_limit,
                         const PointLimit& point_limit, const Visit& visit) const noexcept {
    if (nodes_.empty()) return 0;
    std::array<std::uint32_t, kStackSize> stack;
    std::size_t size = 0;
    std::uint32_t visited = 0;
    stack[size++] = 0;
    while (size > 0) {
      const Node& node = nodes_[stack[--size]];
      ++visited;
      if (node.count > 0) {
        for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
          const float squared = squared_distance(center, points_[i]);
          if (squared <= point_limit(points_[i])) visit(i, squared);
        }
        continue;
      }
      for (std::uint32_t i = node.first; i < node.first + node.children; ++i) {
        if (squared_distance(center, nodes_[i]) <= node_limit(nodes_[i])) stack[size++] = i;
      }
    }
    return visited;
  }

  void build(std::uint32_t node, std::span<const Keyed> keyed, std::uint32_t first);
  void fit_boxes() noexcept;

  std::vector<Point> points_;
  std::vector<Node> nodes_;
  std::vector<std::uint32_t> order_;
};

}  // namespace palpate::physics
