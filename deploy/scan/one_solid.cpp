// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <numeric>
#include <utility>
#include <vector>

#include "deploy/scan/stuffing.h"
#include "physics_node/elastic/mesh.h"

namespace palpate::scan {
namespace {

using Corners = std::array<std::uint32_t, 4>;
using Triangle = std::array<std::uint32_t, 3>;

/// Sets that grow together.
class Groups {
 public:
  explicit Groups(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0U);
  }
  std::uint32_t of(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::uint32_t a, std::uint32_t b) {
    a = of(a);
    b = of(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

/// Faces of all elements, sorted, so that the two elements of an inner one are neighbours.
struct SideOf {
  Triangle sorted;
  std::uint32_t element;
  bool operator<(const SideOf& other) const {
    return std::pair(sorted, element) < std::pair(other.sorted, other.element);
  }
};
std::vector<SideOf> sides_of(const std::vector<Corners>& elements) {
  std::vector<SideOf> sides;
  for (std::uint32_t e = 0; e < elements.size(); ++e) {
    for (const auto& face : elastic::kFaces) {
      Triangle nodes{};
      for (std::size_t i = 0; i < 3; ++i) nodes[i] = elements[e][static_cast<std::size_t>(face[i])];
      std::sort(nodes.begin(), nodes.end());
      sides.push_back({nodes, e});
    }
  }
  std::sort(sides.begin(), sides.end());
  return sides;
}

class Solid {
 public:
  explicit Solid(const physics::TetrahedralMesh& mesh)
      : mesh_(mesh), kept_(mesh.tetrahedra.size()) {
    std::iota(kept_.begin(), kept_.end(), 0U);
  }

  physics::TetrahedralMesh take(std::vector<std::uint32_t>& kept) {
    do {
      keep_largest_part();
    } while (remove_at_edges());
    physics::TetrahedralMesh solid = with_nodes_of_its_own();
    kept = std::move(kept_);
    return solid;
  }

 private:
  [[nodiscard]] std::vector<Corners> elements() const {
    std::vector<Corners> list;
    for (const std::uint32_t e : kept_) list.push_back(mesh_.tetrahedra[e]);
    return list;
  }
  [[nodiscard]] double volume(std::uint32_t place) const {
    return physics::six_volumes_m3(mesh_.nodes_m, mesh_.tetrahedra[kept_[place]]);
  }
  void remove(const std::vector<bool>& is_removed) {
    std::vector<std::uint32_t> left;
    for (std::size_t i = 0; i < kept_.size(); ++i) {
      if (!is_removed[i]) left.push_back(kept_[i]);
    }
    kept_ = std::move(left);
  }

  void keep_largest_part() {
    const std::vector<SideOf> sides = sides_of(elements());
    Groups groups(kept_.size());
    for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
      if (sides[i].sorted == sides[i + 1].sorted)
        groups.join(sides[i].element, sides[i + 1].element);
    }
    std::vector<double> volumes(kept_.size(), 0.0);
    for (std::uint32_t i = 0; i < kept_.size(); ++i) volumes[groups.of(i)] += volume(i);
    const auto largest = static_cast<std::uint32_t>(
        std::max_element(volumes.begin(), volumes.end()) - volumes.begin());
    std::vector<bool> is_removed(kept_.size());
    for (std::uint32_t i = 0; i < kept_.size(); ++i) is_removed[i] = groups.of(i) != largest;
    remove(is_removed);
  }

  /// Where more than two faces of the surface share an edge, the elements around it form several
  /// fans: all but the largest go. @return whether there was such an edge
  bool remove_at_edges() {
    const std::vector<Corners> all = elements();
    const std::vector<SideOf> sides = sides_of(all);
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> faces_at;
    for (std::size_t i = 0; i < sides.size(); ++i) {
      if (i + 1 < sides.size() && sides[i].sorted == sides[i + 1].sorted) {
        ++i;
        continue;
      }
      const auto& [a, b, c] = sides[i].sorted;
      ++faces_at[{a, b}];
      ++faces_at[{b, c}];
      ++faces_at[{a, c}];
    }
    std::erase_if(faces_at, [](const auto& entry) { return entry.second <= 2; });
    if (faces_at.empty()) return false;
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<std::uint32_t>> around;
    for (std::uint32_t e = 0; e < all.size(); ++e) {
      for (const auto& [i, j] : elastic::kEdges) {
        const auto edge =
            std::minmax(all[e][static_cast<std::size_t>(i)], all[e][static_cast<std::size_t>(j)]);
        if (faces_at.contains(edge)) around[edge].push_back(e);
      }
    }
    std::vector<bool> is_removed(kept_.size(), false);
    for (const auto& entry : around) {
      const std::vector<std::uint32_t>& list = entry.second;  // clang 14 captures no bindings
      // elements of the fan share a face that contains the edge: three nodes with it
      Groups groups(list.size());
      for (std::uint32_t i = 0; i < list.size(); ++i) {
        for (std::uint32_t j = 0; j < i; ++j) {
          const auto& other = all[list[j]];
          const auto shared =
              std::count_if(all[list[i]].begin(), all[list[i]].end(), [&](std::uint32_t node) {
                return std::find(other.begin(), other.end(), node) != other.end();
              });
          if (shared == 3) groups.join(i, j);
        }
      }
      std::vector<double> volumes(list.size(), 0.0);
      for (std::uint32_t i = 0; i < list.size(); ++i) volumes[groups.of(i)] += volume(list[i]);
      const auto largest = static_cast<std::uint32_t>(
          std::max_element(volumes.begin(), volumes.end()) - volumes.begin());
      for (std::uint32_t i = 0; i < list.size(); ++i) {
        if (groups.of(i) != largest) is_removed[list[i]] = true;
      }
    }
    remove(is_removed);
    return true;
  }

  /// Elements around a node that are not connected by faces at it get copies of it.
  physics::TetrahedralMesh with_nodes_of_its_own() {
    const std::vector<Corners> all = elements();
    // slot 4 e + i: corner i of element e; slots of a node that share a face at it are joined
    Groups groups(4 * all.size());
    const std::vector<SideOf> sides = sides_of(all);
    const auto slot = [&](std::uint32_t element, std::uint32_t node) {
      const auto at =
          std::find(all[element].begin(), all[element].end(), node) - all[element].begin();
      return 4 * element + static_cast<std::uint32_t>(at);
    };
    for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
      if (sides[i].sorted != sides[i + 1].sorted) continue;
      for (const std::uint32_t node : sides[i].sorted) {
        groups.join(slot(sides[i].element, node), slot(sides[i + 1].element, node));
      }
    }
    physics::TetrahedralMesh solid;
    std::vector<std::uint32_t> node_of(4 * all.size(), 0xffffffff);
    for (std::uint32_t e = 0; e < all.size(); ++e) {
      Corners corners{};
      for (std::uint32_t i = 0; i < 4; ++i) {
        std::uint32_t& node = node_of[groups.of(4 * e + i)];
        if (node == 0xffffffff) {
          node = static_cast<std::uint32_t>(solid.nodes_m.size());
          solid.nodes_m.push_back(mesh_.nodes_m[all[e][i]]);
        }
        corners[i] = node;
      }
      solid.tetrahedra.push_back(corners);
    }
    return solid;
  }

  const physics::TetrahedralMesh& mesh_;
  std::vector<std::uint32_t> kept_;
};

}  // namespace

physics::TetrahedralMesh one_solid(const physics::TetrahedralMesh& mesh,
                                   std::vector<std::uint32_t>& kept) {
  return Solid(mesh).take(kept);
}

}  // namespace palpate::scan
