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

std::vector<Corners> corners_of(const Mesh& mesh) {
  std::vector<Corners> elements(mesh.element_count());
  for (std::size_t e = 0; e < elements.size(); ++e) {
    std::copy_n(mesh.element(e).begin(), kCorners, elements[e].begin());
  }
  return elements;
}

/// How those of some nodes that are held hold what these belong to: as hold_of().
int hold_by(const Mesh& mesh, const std::vector<std::uint32_t>& nodes,
            const std::vector<bool>& is_held_node) {
  std::vector<std::uint32_t> held;
  std::copy_if(nodes.begin(), nodes.end(), std::back_inserter(held),
               [&](std::uint32_t node) { return is_held_node[node]; });
  return hold_of(mesh, held);
}

/// The nodes of each part that nothing holds; what is held holds its neighbours.
std::map<std::uint32_t, std::vector<std::uint32_t>> loose_parts(const Mesh& mesh, Parts& parts,
                                                                std::vector<bool>& is_held_node) {
  std::map<std::uint32_t, std::vector<std::uint32_t>> nodes_of;
  for (std::uint32_t e = 0; e < mesh.element_count(); ++e) {
    const auto nodes = mesh.element(e);
    std::vector<std::uint32_t>& all = nodes_of[parts.of(e)];
    all.insert(all.end(), nodes.begin(), nodes.end());
  }
  for (bool is_more = true; is_more;) {
    is_more = false;
    for (auto part = nodes_of.begin(); part != nodes_of.end();) {
      if (hold_by(mesh, part->second, is_held_node) < 3) {
        ++part;
        continue;
      }
      for (const std::uint32_t node : part->second) is_held_node[node] = true;
      part = nodes_of.erase(part);
      is_more = true;
    }
  }
  return nodes_of;
}

std::vector<bool> marked(const Mesh& mesh, const std::vector<std::uint32_t>& nodes) {
  std::vector<bool> is_in(mesh.nodes_m.size(), false);
  for (const std::uint32_t node : nodes) {
    if (node < is_in.size()) is_in[node] = true;
  }
  return is_in;
}

}  // namespace

std::string complaint_about_support(const Mesh& mesh,
                                    const std::vector<std::uint32_t>& held_nodes) {
  const std::vector<Corners> elements = corners_of(mesh);
  Parts parts(elements.size());
  if (std::string complaint = complaint_about_elements(elements, parts); !complaint.empty()) {
    return complaint;
  }
  std::vector<bool> is_held_node = marked(mesh, held_nodes);
  const auto loose = loose_parts(mesh, parts, is_held_node);
  if (loose.empty()) return "";
  const auto& [part, nodes] = *loose.begin();
  constexpr std::array<const char*, 3> kHold = {"is not held anywhere", "is held at one point only",
                                                "is held along a line only and turns about it"};
  return "a part of " +
         std::to_string(nodes.size() / static_cast<std::size_t>(mesh.nodes_per_element)) + " of " +
         std::to_string(elements.size()) + " tetrahedra (the first is number " +
         std::to_string(part + 1) + ") " +
         kHold[static_cast<std::size_t>(hold_by(mesh, nodes, is_held_node))] +
         "; let elastic.fixed or elastic.attached reach three of its nodes that are not on a "
         "line, join it to the rest by faces, or remove it";
}

std::vector<std::uint32_t> loose_elements(const Mesh& mesh,
                                          const std::vector<std::uint32_t>& held_nodes) {
  const std::vector<Corners> elements = corners_of(mesh);
  Parts parts(elements.size());
  static_cast<void>(complaint_about_elements(elements, parts));
  std::vector<bool> is_held_node = marked(mesh, held_nodes);
  const auto loose = loose_parts(mesh, parts, is_held_node);
  std::vector<std::uint32_t> found;
  for (std::uint32_t e = 0; e < elements.size(); ++e) {
    if (loose.count(parts.of(e)) > 0) found.push_back(e);
  }
  return found;
}

std::vector<std::uint32_t> hinged_elements(const Mesh& mesh) {
  using Edge = std::pair<std::uint32_t, std::uint32_t>;
  std::map<Edge, int> faces_at;
  for (const Face& face : surface_of(mesh)) {
    for (std::size_t i = 0; i < 3; ++i)
      ++faces_at[std::minmax(face.nodes[i], face.nodes[(i + 1) % 3])];
  }
  std::map<Edge, std::vector<std::uint32_t>> hinges;  // and the elements there
  for (const auto& [edge, faces] : faces_at) {
    if (faces > 2) hinges[edge];
  }
  for (std::uint32_t e = 0; e < mesh.element_count() && !hinges.empty(); ++e) {
    const auto nodes = mesh.element(e);
    for (const auto& [a, b] : kEdges) {
      const auto hinge = hinges.find(
          std::minmax(nodes[static_cast<std::size_t>(a)], nodes[static_cast<std::size_t>(b)]));
      if (hinge != hinges.end()) hinge->second.push_back(e);
    }
  }
  std::vector<std::uint32_t> found;
  for (const auto& [edge, elements] : hinges) {
    // elements at one edge share a face if they share a third corner
    Parts parts(elements.size());
    const auto shares_face = [&](std::uint32_t a, std::uint32_t b) {
      const auto corners = mesh.element(a).first(kCorners);
      const auto others = mesh.element(b).first(kCorners);
      return std::count_if(corners.begin(), corners.end(), [&](std::uint32_t node) {
               return std::find(others.begin(), others.end(), node) != others.end();
             }) == 3;
    };
    std::map<std::uint32_t, double> volume_of;
    for (std::uint32_t i = 0; i < elements.size(); ++i) {
      for (std::uint32_t j = 0; j < i; ++j) {
        if (shares_face(elements[i], elements[j])) parts.merge(i, j);
      }
    }
    for (std::uint32_t i = 0; i < elements.size(); ++i) {
      const auto nodes = mesh.element(elements[i]);
      const Vector3d& first = mesh.nodes_m[nodes[0]];
      volume_of[parts.of(i)] +=
          (mesh.nodes_m[nodes[1]] - first)
              .dot((mesh.nodes_m[nodes[2]] - first).cross(mesh.nodes_m[nodes[3]] - first));
    }
    const auto largest =
        std::max_element(volume_of.begin(), volume_of.end(),
                         [](const auto& a, const auto& b) { return a.second < b.second; });
    for (std::uint32_t i = 0; i < elements.size(); ++i) {
      if (parts.of(i) != largest->first) found.push_back(elements[i]);
    }
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

}  // namespace palpate::elastic
