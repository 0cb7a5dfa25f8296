// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/support.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>

namespace palpate::elastic {
namespace {

constexpr std::size_t kCorners = 4;
// Three nodes are on a line if the triangle's height is below this share of its longest edge.
constexpr double kLine = 1e-6;

using Corners = std::array<std::uint32_t, kCorners>;

/// Parts of elements, merged where they meet.
class Parts {
 public:
  explicit Parts(std::size_t elements) : above_(elements) {
    std::iota(above_.begin(), above_.end(), 0U);
  }
  std::uint32_t of(std::uint32_t element) {
    while (above_[element] != element) element = above_[element] = above_[above_[element]];
    return element;
  }
  void merge(std::uint32_t a, std::uint32_t b) {
    const auto [first, second] = std::minmax({of(a), of(b)});
    above_[second] = first;
  }

 private:
  std::vector<std::uint32_t> above_;
};

/// How nodes hold what they belong to: 0 not at all, 1 at a point, 2 along a line, 3 firmly.
int hold_of(const Mesh& mesh, const std::vector<std::uint32_t>& nodes) {
  if (nodes.empty()) return 0;
  const Vector3d& first = mesh.nodes_m[nodes[0]];
  Vector3d farthest = Vector3d::Zero();
  for (const std::uint32_t node : nodes) {
    const Vector3d way = mesh.nodes_m[node] - first;
    if (way.squaredNorm() > farthest.squaredNorm()) farthest = way;
  }
  if (!(farthest.norm() > 0.0)) return 1;
  const bool is_firm = std::any_of(nodes.begin(), nodes.end(), [&](std::uint32_t node) {
    return farthest.cross(mesh.nodes_m[node] - first).norm() > kLine * farthest.squaredNorm();
  });
  return is_firm ? 3 : 2;
}

std::string complaint_about_elements(const std::vector<Corners>& elements, Parts& parts) {
  std::map<Corners, std::uint32_t> sorted;
  struct Side {
    std::array<std::uint32_t, 3> nodes;
    std::uint32_t element;
  };
  std::vector<Side> sides;
  for (std::uint32_t e = 0; e < elements.size(); ++e) {
    Corners corners = elements[e];
    std::sort(corners.begin(), corners.end());
    if (const auto [same, is_new] = sorted.try_emplace(corners, e); !is_new) {
      return "elements " + std::to_string(same->second + 1) + " and " + std::to_string(e + 1) +
             " are the same; remove one of them";
    }
    for (const auto& face : kFaces) {
      Side side{.nodes = {}, .element = e};
      for (std::size_t i = 0; i < 3; ++i) {
        side.nodes[i] = elements[e][static_cast<std::size_t>(face[i])];
      }
      std::sort(side.nodes.begin(), side.nodes.end());
      sides.push_back(side);
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return std::tie(a.nodes, a.element) < std::tie(b.nodes, b.element);
  });
  for (std::size_t i = 1; i < sides.size(); ++i) {
    if (sides[i].nodes != sides[i - 1].nodes) continue;
    if (i > 1 && sides[i].nodes == sides[i - 2].nodes) {
      return "elements " + std::to_string(sides[i - 2].element + 1) + ", " +
             std::to_string(sides[i - 1].element + 1) + " and " +
             std::to_string(sides[i].element + 1) +
             " share a face, so that they overlap; repair the mesh";
    }
    parts.merge(sides[i - 1].element, sides[i].element);
  }
  return "";
}

}  // namespace

std::string complaint_about_support(const Mesh& mesh,
                                    const std::vector<std::uint32_t>& held_nodes) {
  std::vector<Corners> elements;
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    Corners corners{};
    std::copy_n(mesh.element(e).begin(), kCorners, corners.begin());
    elements.push_back(corners);
  }
  Parts parts(elements.size());
  if (std::string complaint = complaint_about_elements(elements, parts); !complaint.empty()) {
    return complaint;
  }

  // the nodes of each part
  std::map<std::uint32_t, std::vector<std::uint32_t>> nodes_of;
  std::map<std::uint32_t, std::size_t> elements_of;
  for (std::uint32_t e = 0; e < elements.size(); ++e) {
    const std::uint32_t part = parts.of(e);
    const auto nodes = mesh.element(e);
    nodes_of[part].insert(nodes_of[part].end(), nodes.begin(), nodes.end());
    ++elements_of[part];
  }
  std::vector<bool> is_held_node(mesh.nodes_m.size(), false);
  for (const std::uint32_t node : held_nodes) {
    if (node < is_held_node.size()) is_held_node[node] = true;
  }
  // what is held holds its neighbours
  const auto hold = [&](const std::vector<std::uint32_t>& nodes) {
    std::vector<std::uint32_t> held;
    std::copy_if(nodes.begin(), nodes.end(), std::back_inserter(held),
                 [&](std::uint32_t node) { return is_held_node[node]; });
    return hold_of(mesh, held);
  };
  for (bool is_more = true; is_more;) {
    is_more = false;
    for (auto part = nodes_of.begin(); part != nodes_of.end();) {
      if (hold(part->second) < 3) {
        ++part;
        continue;
      }
      for (const std::uint32_t node : part->second) is_held_node[node] = true;
      part = nodes_of.erase(part);
      is_more = true;
    }
  }
  if (nodes_of.empty()) return "";
  const auto& [part, nodes] = *nodes_of.begin();
  constexpr std::array<const char*, 3> kHold = {"is not held anywhere", "is held at one point only",
                                                "is held along a line only and turns about it"};
  return "a part of " + std::to_string(elements_of[part]) + " of " +
         std::to_string(elements.size()) + " tetrahedra (the first is number " +
         std::to_string(part + 1) + ") " + kHold[static_cast<std::size_t>(hold(nodes))] +
         "; let elastic.fixed or elastic.attached reach three of its nodes that are not on a "
         "line, join it to the rest by faces, or remove it";
}

}  // namespace palpate::elastic
