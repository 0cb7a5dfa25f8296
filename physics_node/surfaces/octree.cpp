// SPDX-License-Identifier: Apache-2.0
#include "physics_node/surfaces/octree.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "common/core/check.h"

namespace palpate::physics {
namespace {

// Points per leaf: fewer make more nodes to traverse, more make more points to reject.
constexpr std::size_t kLeafPoints = 12;

/// The lowest 21 bits of `x`, each followed by two zeros.
std::uint64_t spread(std::uint64_t x) noexcept {
  x &= 0x1fffff;
  x = (x | x << 32) & 0x1f00000000ffff;
  x = (x | x << 16) & 0x1f0000ff0000ff;
  x = (x | x << 8) & 0x100f00f00f00f00f;
  x = (x | x << 4) & 0x10c30c30c30c30c3;
  x = (x | x << 2) & 0x1249249249249249;
  return x;
}

/// The order of `found`: by distance, equally far points by index.
bool is_before(const Octree::Neighbor& a, const Octree::Neighbor& b) noexcept {
  return a.squared_distance != b.squared_distance ? a.squared_distance < b.squared_distance
                                                  : a.point < b.point;
}

}  // namespace

Octree::Octree(std::span<const Point> points) {
  PALPATE_REQUIRE(points.size() <= std::size_t{1} << 31);
  if (points.empty()) return;

  // the cube around all points, in 2²¹ steps along each edge
  Eigen::Array3f lowest(points[0].x, points[0].y, points[0].z);
  Eigen::Array3f highest = lowest;
  for (const Point& point : points) {
    const Eigen::Array3f place(point.x, point.y, point.z);
    lowest = lowest.min(place);
    highest = highest.max(place);
  }
  constexpr double kSteps = 1 << kLevels;
  const double edge = (highest.cast<double>() - lowest.cast<double>()).maxCoeff();
  const double steps_per_length = edge > 0.0 ? kSteps / edge : 0.0;
  const auto step = [&](float place, float from) {
    const double steps = (static_cast<double>(place) - static_cast<double>(from));
    return spread(static_cast<std::uint64_t>(std::min(steps * steps_per_length, kSteps - 1.0)));
  };

  std::vector<Keyed> keyed(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    keyed[i] = {step(points[i].x, lowest.x()) | step(points[i].y, lowest.y()) << 1 |
                    step(points[i].z, lowest.z()) << 2,
                static_cast<std::uint32_t>(i)};
  }
  std::sort(keyed.begin(), keyed.end(), [](const Keyed& a, const Keyed& b) {
    return a.code != b.code ? a.code < b.code : a.index < b.index;
  });
  keyed.erase(std::unique(keyed.begin(), keyed.end(),
                          [](const Keyed& a, const Keyed& b) { return a.code == b.code; }),
              keyed.end());

  points_.reserve(keyed.size());
  order_.reserve(keyed.size());
  for (const Keyed& key : keyed) {
    points_.push_back(points[key.index]);
    order_.push_back(key.index);
  }
  nodes_.emplace_back();
  build(0, keyed, 0);
  nodes_.shrink_to_fit();
  fit_boxes();
}

void Octree::build(std::uint32_t node, std::span<const Keyed> keyed, std::uint32_t first) {
  if (keyed.size() <= kLeafPoints) {
    nodes_[node].first = first;
    nodes_[node].count = static_cast<std::uint32_t>(keyed.size());
    return;
  }
  // the highest level at which the codes differ; no two are equal
  const int highest_bit =
      static_cast<int>(std::bit_width(keyed.front().code ^ keyed.back().code)) - 1;
  const int shift = highest_bit / 3 * 3;
  const auto digit = [shift](const Keyed& key) { return key.code >> shift & 7U; };

  std::array<std::size_t, 9> ends{};  // of the children, after a 0
  std::uint32_t children = 0;
  for (std::size_t begin = 0; begin < keyed.size(); begin = ends[children]) {
    const std::uint64_t own = digit(keyed[begin]);
    const auto end =
        std::partition_point(keyed.begin() + static_cast<std::ptrdiff_t>(begin), keyed.end(),
                             [&](const Keyed& key) { return digit(key) == own; });
    ends[++children] = static_cast<std::size_t>(end - keyed.begin());
  }
  const auto first_child = static_cast<std::uint32_t>(nodes_.size());
  nodes_[node].first = first_child;
  nodes_[node].children = children;
  nodes_.resize(nodes_.size() + children);
  for (std::uint32_t i = 0; i < children; ++i) {
    build(first_child + i, keyed.subspan(ends[i], ends[i + 1] - ends[i]),
          first + static_cast<std::uint32_t>(ends[i]));
  }
}

void Octree::fit_boxes() noexcept {
  // children follow their parent, so in reverse order every child is fitted before it is needed
  for (std::size_t i = nodes_.size(); i-- > 0;) {
    Node& node = nodes_[i];
    node.lowest.fill(std::numeric_limits<float>::max());
    node.highest.fill(std::numeric_limits<float>::lowest());
    node.reach = 0.0F;
    const auto include = [&](const std::array<float, 3>& lowest,
                             const std::array<float, 3>& highest, float reach) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        node.lowest[axis] = std::min(node.lowest[axis], lowest[axis]);
        node.highest[axis] = std::max(node.highest[axis], highest[axis]);
      }
      node.reach = std::max(node.reach, reach);
    };
    for (std::uint32_t p = node.first; p < node.first + node.count; ++p) {
      const std::array<float, 3> place{points_[p].x, points_[p].y, points_[p].z};
      include(place, place, points_[p].reach);
    }
    for (std::uint32_t c = node.first; c < node.first + node.children; ++c) {
      include(nodes_[c].lowest, nodes_[c].highest, nodes_[c].reach);
    }
  }
}

void Octree::set_reaches(std::span<const float> reaches) noexcept {
  PALPATE_REQUIRE(reaches.size() == points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) points_[i].reach = reaches[i];
  fit_boxes();
}

std::size_t Octree::nearest(const Eigen::Vector3f& center, std::span<Neighbor> found, Hint& hint,
                            float within, float overshoot_ratio) const noexcept {
  if (nodes_.empty() || found.empty()) return 0;
  std::size_t count = 0;
  // finite, so that a query from a place that is not finite finds nothing
  float worst =
      std::min(within * within,
               std::numeric_limits<float>::max());  // squared distance a point must not exceed
  std::uint32_t nearest_leaf = hint.leaf;

  const auto scan = [&](std::uint32_t leaf) {
    const Node& node = nodes_[leaf];
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Neighbor candidate{squared_distance(center, points_[i]), i};
      if (!(candidate.squared_distance <= worst)) continue;
      if (count == found.size() && !is_before(candidate, found[count - 1])) continue;
      std::size_t place = count < found.size() ? count++ : count - 1;
      for (; place > 0 && is_before(candidate, found[place - 1]); --place) {
        found[place] = found[place - 1];
      }
      found[place] = candidate;
      if (place == 0) nearest_leaf = leaf;
      if (count == found.size()) worst = found[count - 1].squared_distance;
    }
  };

  // the last leaf first: its points bound the search
  const bool has_hint = hint.leaf < nodes_.size() && nodes_[hint.leaf].count > 0;
  const std::uint32_t done = has_hint ? hint.leaf : std::numeric_limits<std::uint32_t>::max();
  if (has_hint) scan(hint.leaf);

  // the nearest child first; the others wait, nearest on top
  struct Waiting {
    float squared_distance;
    std::uint32_t node;
  };
  const float tightening = (1.0F + overshoot_ratio) * (1.0F + overshoot_ratio);
  std::array<Waiting, kStackSize> stack;
  std::size_t size = 0;
  stack[size++] = {squared_distance(center, nodes_[0]), 0};
  while (size > 0) {
    const Waiting here = stack[--size];
    if (here.squared_distance * tightening > worst) continue;
    ++hint.cells_visited;
    const Node& node = nodes_[here.node];
    if (node.count > 0) {
      if (here.node != done) scan(here.node);
      continue;
    }
    const std::size_t begin = size;
    for (std::uint32_t i = node.first; i < node.first + node.children; ++i) {
      const Waiting child{squared_distance(center, nodes_[i]), i};
      if (child.squared_distance * tightening > worst) continue;
      std::size_t place = size++;
      for (; place > begin && stack[place - 1].squared_distance < child.squared_distance; --place) {
        stack[place] = stack[place - 1];
      }
      stack[place] = child;
    }
  }
  hint.leaf = nearest_leaf;
  return count;
}

}  // namespace palpate::physics
