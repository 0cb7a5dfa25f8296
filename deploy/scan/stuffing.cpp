// SPDX-License-Identifier: Apache-2.0
#include "deploy/scan/stuffing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <unordered_map>
#include <vector>

#include "common/core/check.h"
#include "deploy/scan/lattice.h"
#include "physics_node/elastic/mesh.h"

namespace palpate::scan {
namespace {

// [Labelle07] §3: a vertex nearer to the surface than this share of an edge moves onto it. Edges
// along an axis are long, those from a corner to a centre short.
constexpr double kWarpLong = 0.24999;
constexpr double kWarpShort = 0.41189;
// Where cubes of different size meet; found by trial.
constexpr double kWarpIrregular = 0.23;
constexpr std::uint32_t kNone = 0xffffffff;

using Corners = std::array<std::uint32_t, 4>;

std::uint64_t pair_key(std::uint32_t a, std::uint32_t b) {
  return a < b ? (std::uint64_t{a} << 32) | b : (std::uint64_t{b} << 32) | a;
}

/// Warps and cuts the lattice.
class Cutter {
 public:
  Cutter(Lattice lattice, const std::function<double(const Vector3&)>& inside)
      : lattice_(std::move(lattice)), inside_(inside) {
    values_.reserve(lattice_.nodes_m.size());
    for (const Vector3& node : lattice_.nodes_m) values_.push_back(inside_(node));
    // exactly on the surface counts as on it
    drop_outside();
    find_cuts();
    warp();
  }

  physics::TetrahedralMesh take() {
    for (const Corners& corners : lattice_.tetrahedra) fill(corners);
    return finished();
  }

 private:
  struct Cut {
    std::uint32_t positive;
    std::uint32_t negative;
    Vector3 place_m;
    bool is_long;
    std::uint32_t node = kNone;  // in the mesh
    bool is_gone = false;
  };

  void drop_outside() {
    std::erase_if(lattice_.tetrahedra, [&](const Corners& corners) {
      return std::all_of(corners.begin(), corners.end(),
                         [&](std::uint32_t v) { return values_[v] <= 0.0; });
    });
  }

  [[nodiscard]] bool is_axis_aligned(std::uint32_t a, std::uint32_t b) const {
    const auto& p = lattice_.places[a];
    const auto& q = lattice_.places[b];
    return (p[0] != q[0]) + (p[1] != q[1]) + (p[2] != q[2]) == 1;
  }

  void find_cuts() {
    std::vector<std::uint64_t> edges;
    for (const Corners& corners : lattice_.tetrahedra) {
      for (const auto& [i, j] : elastic::kEdges) {
        const std::uint32_t a = corners[static_cast<std::size_t>(i)];
        const std::uint32_t b = corners[static_cast<std::size_t>(j)];
        if (values_[a] * values_[b] < 0.0) edges.push_back(pair_key(a, b));
      }
    }
    std::sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    cuts_of_.resize(lattice_.nodes_m.size());
    for (const std::uint64_t edge : edges) {
      auto a = static_cast<std::uint32_t>(edge >> 32);
      auto b = static_cast<std::uint32_t>(edge);
      if (values_[a] < 0.0) std::swap(a, b);
      const auto index = static_cast<std::uint32_t>(cuts_.size());
      cuts_.push_back({a, b, root(a, b), is_axis_aligned(a, b)});
      cut_of_.emplace(edge, index);
      cuts_of_[a].push_back(index);
      cuts_of_[b].push_back(index);
    }
  }

  /// Where `inside_` changes its sign between the two.
  [[nodiscard]] Vector3 root(std::uint32_t positive, std::uint32_t negative) const {
    Vector3 in = lattice_.nodes_m[positive];
    Vector3 out = lattice_.nodes_m[negative];
    for (int i = 0; i < 24; ++i) {
      const Vector3 middle = 0.5 * (in + out);
      (inside_(middle) > 0.0 ? in : out) = middle;
    }
    return 0.5 * (in + out);
  }

  void warp() {
    for (std::uint32_t v = 0; v < cuts_of_.size(); ++v) {
      const Cut* nearest = nullptr;
      double least = 0.0;
      for (const std::uint32_t c : cuts_of_[v]) {
        const Cut& cut = cuts_[c];
        if (cut.is_gone) continue;
        const double edge_m =
            (lattice_.nodes_m[cut.positive] - lattice_.nodes_m[cut.negative]).norm();
        const double distance_m = (cut.place_m - lattice_.nodes_m[v]).norm();
        const double share = !lattice_.is_regular[v] ? kWarpIrregular
                             : cut.is_long           ? kWarpLong
                                                     : kWarpShort;
        if (distance_m >= share * edge_m) continue;
        if (nearest == nullptr || distance_m < least) {
          nearest = &cut;
          least = distance_m;
        }
      }
      if (nearest == nullptr) continue;
      moved_.push_back({v, nearest->place_m});
      values_[v] = 0.0;
      for (const std::uint32_t c : cuts_of_[v]) cuts_[c].is_gone = true;
    }
    // afterwards, because the lengths above are those of the lattice
    for (const auto& [v, place_m] : moved_) lattice_.nodes_m[v] = place_m;
  }

  std::uint32_t node_of(std::uint32_t vertex) {
    if (node_of_.empty()) node_of_.assign(lattice_.nodes_m.size(), kNone);
    if (node_of_[vertex] == kNone) {
      node_of_[vertex] = static_cast<std::uint32_t>(mesh_.nodes_m.size());
      mesh_.nodes_m.push_back(lattice_.nodes_m[vertex]);
    }
    return node_of_[vertex];
  }
  Cut& cut_between(std::uint32_t positive, std::uint32_t negative) {
    return cuts_[cut_of_.at(pair_key(positive, negative))];
  }
  std::uint32_t node_of(Cut& cut) {
    if (cut.node == kNone) {
      cut.node = static_cast<std::uint32_t>(mesh_.nodes_m.size());
      mesh_.nodes_m.push_back(cut.place_m);
    }
    return cut.node;
  }
  void add(Corners corners) {
    if (physics::six_volumes_m3(mesh_.nodes_m, corners) < 0.0) std::swap(corners[0], corners[1]);
    mesh_.tetrahedra.push_back(corners);
  }

  /// Whether the face with the inner vertices a, b and an outer one is cut by the diagonal from a
  /// to the cut of b's edge, rather than from b to that of a's. Depends on the face alone, so that
  /// both elements of it agree; from the vertex of the long edge, so that a prism of a regular
  /// element has no three diagonals in a circle.
  [[nodiscard]] bool is_diagonal_from(std::uint32_t a, std::uint32_t b, std::uint32_t outer) {
    const bool is_long_a = cut_between(a, outer).is_long;
    const bool is_long_b = cut_between(b, outer).is_long;
    if (is_long_a != is_long_b) return is_long_a;
    return a < b;
  }
  /// A prism of the triangles a and b, a[i] joined to b[i]; `from_a[i]`: the quad of i and i + 1 is
  /// cut from a[i] to b[i + 1], otherwise from b[i] to a[i + 1].
  void add_prism(const std::array<std::uint32_t, 3>& a, const std::array<std::uint32_t, 3>& b,
                 const std::array<bool, 3>& from_a) {
    if (from_a[0] == from_a[1] && from_a[1] == from_a[2]) {
      // the three diagonals run in a circle: a node in the middle is needed
      const auto middle = static_cast<std::uint32_t>(mesh_.nodes_m.size());
      Vector3 sum = Vector3::Zero();
      for (std::size_t i = 0; i < 3; ++i) sum += mesh_.nodes_m[a[i]] + mesh_.nodes_m[b[i]];
      mesh_.nodes_m.emplace_back(sum / 6.0);
      add({middle, a[0], a[1], a[2]});
      add({middle, b[0], b[1], b[2]});
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t n = (i + 1) % 3;
        if (from_a[i]) {
          add({middle, a[i], a[n], b[n]});
          add({middle, a[i], b[n], b[i]});
        } else {
          add({middle, b[i], a[n], a[i]});
          add({middle, b[i], b[n], a[n]});
        }
      }
      return;
    }
    // one corner has two diagonals: three tetrahedra that all contain it, or two of them and the
    // rest
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t n = (i + 1) % 3;
      const std::size_t p = (i + 2) % 3;
      if (from_a[i] && !from_a[p]) {  // a[i] to b[n] and to b[p]
        add({a[i], b[0], b[1], b[2]});
        if (from_a[n]) {  // a[n] to b[p]
          add({a[i], a[n], b[n], b[p]});
          add({a[i], a[n], a[p], b[p]});
        } else {  // b[n] to a[p]
          add({a[i], b[n], b[p], a[p]});
          add({a[i], a[n], a[p], b[n]});
        }
        return;
      }
    }
  }

  void fill(const Corners& corners) {
    std::array<std::uint32_t, 4> in{};
    std::array<std::uint32_t, 4> out{};
    std::array<std::uint32_t, 4> on{};
    std::size_t ins = 0;
    std::size_t outs = 0;
    std::size_t ons = 0;
    for (const std::uint32_t v : corners) {
      if (values_[v] > 0.0) {
        in[ins++] = v;
      } else if (values_[v] < 0.0) {
        out[outs++] = v;
      } else {
        on[ons++] = v;
      }
    }
    if (ins == 0) return;
    if (outs == 0) {
      add({node_of(corners[0]), node_of(corners[1]), node_of(corners[2]), node_of(corners[3])});
      return;
    }
    const auto cut = [&](std::uint32_t a, std::uint32_t x) { return node_of(cut_between(a, x)); };
    if (ins == 1) {
      Corners made{node_of(in[0])};
      std::size_t count = 1;
      for (std::size_t i = 0; i < ons; ++i) made[count++] = node_of(on[i]);
      for (std::size_t i = 0; i < outs; ++i) made[count++] = cut(in[0], out[i]);
      add(made);
    } else if (ins == 3) {
      const auto [a, b, c, none] = in;
      add_prism({node_of(a), node_of(b), node_of(c)},
                {cut(a, out[0]), cut(b, out[0]), cut(c, out[0])},
                {is_diagonal_from(a, b, out[0]), is_diagonal_from(b, c, out[0]),
                 is_diagonal_from(c, a, out[0])});
    } else if (ons == 1) {  // a pyramid over the cut face
      const std::uint32_t a = in[0];
      const std::uint32_t b = in[1];
      const std::uint32_t apex = node_of(on[0]);
      if (is_diagonal_from(a, b, out[0])) {
        add({apex, node_of(a), node_of(b), cut(b, out[0])});
        add({apex, node_of(a), cut(b, out[0]), cut(a, out[0])});
      } else {
        add({apex, node_of(a), node_of(b), cut(a, out[0])});
        add({apex, node_of(b), cut(b, out[0]), cut(a, out[0])});
      }
    } else {  // a wedge; the quad on the surface is free
      const std::uint32_t a = in[0];
      const std::uint32_t b = in[1];
      const bool first = is_diagonal_from(a, b, out[0]);
      const bool last = !is_diagonal_from(a, b, out[1]);  // from the cut of a to b
      const std::array<std::uint32_t, 3> from{node_of(a), cut(a, out[0]), cut(a, out[1])};
      const std::array<std::uint32_t, 3> to{node_of(b), cut(b, out[0]), cut(b, out[1])};
      // the shorter diagonal where both are possible
      bool middle = !first;
      if (first != last) {
        middle = (mesh_.nodes_m[from[1]] - mesh_.nodes_m[to[2]]).norm() <=
                 (mesh_.nodes_m[to[1]] - mesh_.nodes_m[from[2]]).norm();
      }
      add_prism(from, to, {first, middle, last});
    }
  }

  physics::TetrahedralMesh finished() {
    physics::drop_unused_nodes(mesh_);  // as of parts that are dropped
    return std::move(mesh_);
  }

  Lattice lattice_;
  const std::function<double(const Vector3&)>& inside_;
  std::vector<double> values_;
  std::vector<Cut> cuts_;
  std::vector<std::vector<std::uint32_t>> cuts_of_;  // of each vertex
  std::unordered_map<std::uint64_t, std::uint32_t> cut_of_;
  std::vector<std::pair<std::uint32_t, Vector3>> moved_;
  std::vector<std::uint32_t> node_of_;
  physics::TetrahedralMesh mesh_;
};

}  // namespace

physics::TetrahedralMesh stuffed(const Stuffing& stuffing) {
  return Cutter(lattice_of(stuffing), stuffing.inside).take();
}

}  // namespace palpate::scan
