// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/cut/separated_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <utility>

namespace palpate::elastic {
namespace {

constexpr std::int32_t kAbsent = -1;

/// Of the nodes of separated elements: the node of the whole mesh, and what tells copies apart.
using NodeKey = std::array<std::uint32_t, 3>;

/// By element of the whole mesh: its index among these.
std::vector<std::int32_t> places_of(std::span<const std::uint32_t> elements, std::size_t all) {
  std::vector<std::int32_t> places(all, kAbsent);
  for (std::size_t i = 0; i < elements.size(); ++i) {
    places[elements[i]] = static_cast<std::int32_t>(i);
  }
  return places;
}

/// Corners of elements that are one; the least of a group stands for it.
class Corners {
 public:
  explicit Corners(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0U);
  }
  std::uint32_t of(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void merge(std::uint32_t a, std::uint32_t b) {
    const std::uint32_t first = of(a);
    const std::uint32_t second = of(b);
    parent_[std::max(first, second)] = std::min(first, second);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

/// By local element and corner, 4 each: 0, or, around a node of a cut face, 1 + its group.
std::vector<std::uint32_t> copies_of_corners(const Mesh& whole,
                                             std::span<const std::uint32_t> elements,
                                             const FaceCuts& cuts) {
  std::vector<std::uint32_t> copies(4 * elements.size(), 0);
  if (cuts.is_cut.empty()) return copies;
  const std::vector<std::int32_t> places = places_of(elements, whole.element_count());
  const auto across = [&](std::uint32_t element, std::size_t k) {  // its index, and the side there
    const std::int32_t side = cuts.opposite[4 * std::size_t{element} + k];
    return std::pair(side == kNoSide ? kAbsent : places[static_cast<std::size_t>(side) / 4], side);
  };
  std::vector<char> is_at_cut(whole.nodes_m.size(), 0);
  for (const std::uint32_t e : elements) {
    for (std::size_t k = 0; k < 4; ++k) {
      if (!cuts.is_there(4 * e + static_cast<std::uint32_t>(k))) continue;
      if (across(e, k).first == kAbsent) continue;
      for (const int corner : kFaces[k]) {
        is_at_cut[whole.element(e)[static_cast<std::size_t>(corner)]] = 1;
      }
    }
  }
  Corners corners(copies.size());
  for (std::uint32_t i = 0; i < elements.size(); ++i) {
    const auto own = whole.element(elements[i]);
    for (std::size_t k = 0; k < 4; ++k) {
      if (cuts.is_there(4 * elements[i] + static_cast<std::uint32_t>(k))) continue;
      const auto [j, side] = across(elements[i], k);
      if (j == kAbsent || static_cast<std::uint32_t>(j) < i) continue;
      const auto other = whole.element(static_cast<std::uint32_t>(side) / 4).first(4);
      for (const int at : kFaces[k]) {
        const auto corner = static_cast<std::uint32_t>(at);
        if (is_at_cut[own[corner]] == 0) continue;
        const auto same = std::find(other.begin(), other.end(), own[corner]) - other.begin();
        corners.merge(4 * i + corner,
                      4 * static_cast<std::uint32_t>(j) + static_cast<std::uint32_t>(same));
      }
    }
  }
  for (std::uint32_t i = 0; i < copies.size(); ++i) {
    if (is_at_cut[whole.element(elements[i / 4])[i % 4]] != 0) copies[i] = 1 + corners.of(i);
  }
  return copies;
}

}  // namespace

std::vector<std::int32_t> opposite_sides(const Mesh& mesh) {
  struct Side {
    std::array<std::uint32_t, 3> sorted;
    FaceSide side;
  };
  std::vector<Side> sides;
  sides.reserve(4 * mesh.element_count());
  for (std::uint32_t e = 0; e < mesh.element_count(); ++e) {
    const auto element = mesh.element(e);
    for (std::uint32_t k = 0; k < 4; ++k) {
      Side side{.sorted = {}, .side = 4 * e + k};
      for (std::size_t i = 0; i < 3; ++i) {
        side.sorted[i] = element[static_cast<std::size_t>(kFaces[k][i])];
      }
      std::sort(side.sorted.begin(), side.sorted.end());
      sides.push_back(side);
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return std::tie(a.sorted, a.side) < std::tie(b.sorted, b.side);
  });
  std::vector<std::int32_t> opposite(sides.size(), kNoSide);
  for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
    if (sides[i].sorted != sides[i + 1].sorted) continue;
    opposite[sides[i].side] = static_cast<std::int32_t>(sides[i + 1].side);
    opposite[sides[i + 1].side] = static_cast<std::int32_t>(sides[i].side);
  }
  return opposite;
}

SeparatedMesh separated_mesh(const Mesh& whole, std::span<const std::uint32_t> elements,
                             const FaceCuts& cuts) {
  SeparatedMesh made{.mesh = {.nodes_m = {},
                              .nodes_per_element = whole.nodes_per_element,
                              .elements = {},
                              .regions = {}},
                     .nodes = {}};
  const std::vector<std::uint32_t> copies = copies_of_corners(whole, elements, cuts);
  const auto per_element = static_cast<std::size_t>(whole.nodes_per_element);
  std::vector<NodeKey> keys;
  keys.reserve(per_element * elements.size());
  for (std::size_t i = 0; i < elements.size(); ++i) {
    const auto nodes = whole.element(elements[i]);
    for (std::size_t k = 0; k < 4; ++k) keys.push_back({nodes[k], copies[4 * i + k], 0});
    for (std::size_t k = 4; k < per_element; ++k) {
      auto a = static_cast<std::size_t>(kEdges[k - 4][0]);
      auto b = static_cast<std::size_t>(kEdges[k - 4][1]);
      if (nodes[b] < nodes[a]) std::swap(a, b);
      keys.push_back({nodes[k], copies[4 * i + a], copies[4 * i + b]});
    }
  }
  std::vector<NodeKey> sorted = keys;
  std::sort(sorted.begin(), sorted.end());
  sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
  for (const NodeKey& key : sorted) {
    made.nodes.push_back(key[0]);
    made.mesh.nodes_m.push_back(whole.nodes_m[key[0]]);
  }
  for (const NodeKey& key : keys) {
    made.mesh.elements.push_back(static_cast<std::uint32_t>(
        std::lower_bound(sorted.begin(), sorted.end(), key) - sorted.begin()));
  }
  for (const std::uint32_t e : elements) {
    made.mesh.regions.push_back(whole.regions.empty() ? std::uint8_t{0} : whole.regions[e]);
  }
  return made;
}

FaceCuts clean_cuts(const Mesh& whole, std::span<const std::uint32_t> elements, FaceCuts cuts) {
  if (std::none_of(cuts.is_cut.begin(), cuts.is_cut.end(), [](char cut) { return cut != 0; })) {
    cuts.is_cut.clear();
  }
  for (bool is_clean = cuts.is_cut.empty(); !is_clean;) {
    is_clean = true;
    const SeparatedMesh now = separated_mesh(whole, elements, cuts);
    using Edge = std::pair<std::uint32_t, std::uint32_t>;
    std::map<Edge, int> faces_at;
    for (const Face& face : surface_of(now.mesh)) {
      for (std::size_t i = 0; i < 3; ++i) {
        ++faces_at[std::minmax(face.nodes[i], face.nodes[(i + 1) % 3])];
      }
    }
    std::erase_if(faces_at, [](const auto& edge) { return edge.second <= 2; });
    if (faces_at.empty()) break;
    std::vector<Edge> pinched;
    for (const auto& [edge, faces] : faces_at) {
      pinched.emplace_back(std::minmax(now.nodes[edge.first], now.nodes[edge.second]));
    }
    std::sort(pinched.begin(), pinched.end());
    for (const std::uint32_t e : elements) {
      for (std::uint32_t k = 0; k < 4; ++k) {
        const FaceSide side = 4 * e + k;
        if (!cuts.is_there(side)) continue;
        std::array<std::uint32_t, 3> nodes{};
        for (std::size_t i = 0; i < 3; ++i) {
          nodes[i] = whole.element(e)[static_cast<std::size_t>(kFaces[k][i])];
        }
        const bool is_pinched = std::binary_search(pinched.begin(), pinched.end(),
                                                   Edge(std::minmax(nodes[0], nodes[1]))) ||
                                std::binary_search(pinched.begin(), pinched.end(),
                                                   Edge(std::minmax(nodes[1], nodes[2]))) ||
                                std::binary_search(pinched.begin(), pinched.end(),
                                                   Edge(std::minmax(nodes[2], nodes[0])));
        if (!is_pinched) continue;
        cuts.is_cut[side] = 0;
        if (cuts.opposite[side] != kNoSide) {
          cuts.is_cut[static_cast<std::size_t>(cuts.opposite[side])] = 0;
        }
        is_clean = false;  // another edge may be pinched now
      }
    }
  }
  return cuts;
}

CutArea cut_area(const Mesh& whole, std::span<const std::uint32_t> elements, const FaceCuts& cuts,
                 const Mesh& separated) {
  CutArea sum;
  if (cuts.is_cut.empty()) return sum;
  const std::vector<std::int32_t> places = places_of(elements, whole.element_count());
  for (std::uint32_t i = 0; i < elements.size(); ++i) {
    for (std::uint32_t k = 0; k < 4; ++k) {
      const FaceSide side = 4 * elements[i] + k;
      const std::int32_t other = cuts.opposite[side];
      if (!cuts.is_there(side) || other == kNoSide || static_cast<FaceSide>(other) < side) continue;
      const std::int32_t j = places[static_cast<std::size_t>(other) / 4];
      if (j == kAbsent) continue;
      const auto own = separated.element(i);
      const auto across = separated.element(static_cast<std::size_t>(j)).first(4);
      bool is_apart = false;
      for (const int corner : kFaces[k]) {
        is_apart = is_apart || std::find(across.begin(), across.end(),
                                         own[static_cast<std::size_t>(corner)]) == across.end();
      }
      if (!is_apart) continue;
      const auto at = [&](std::size_t c) -> const Vector3d& {
        return separated.nodes_m[own[static_cast<std::size_t>(kFaces[k][c])]];
      };
      ++sum.faces;
      sum.area_m2 += 0.5 * (at(1) - at(0)).cross(at(2) - at(0)).norm();
    }
  }
  return sum;
}

}  // namespace palpate::elastic
