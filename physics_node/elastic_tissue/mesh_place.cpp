// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/mesh_place.h"

#include <algorithm>
#include <cmath>
#include <variant>

#include "common/core/check.h"

namespace palpate::physics {

void check_tag(const RegionGeometry& place, const TetrahedralMesh& mesh, const std::string& name) {
  const auto* tag = std::get_if<MeshTag>(&place);
  if (tag == nullptr) return;
  const auto& names = mesh.region_names;
  if (std::find(names.begin(), names.end(), tag->name) != names.end()) return;
  std::string known;
  for (const std::string& there : names) known += (known.empty() ? "\"" : ", \"") + there + "\"";
  throw SetupError(name + "tag: \"" + tag->name + "\": the mesh has " +
                   (known.empty() ? "no regions" : "only the regions " + known));
}

MeshPlace::MeshPlace(const RegionGeometry& place, const TetrahedralMesh& read,
                     const elastic::Mesh& mesh)
    : place_(place), mesh_(mesh), is_tagged_(mesh.element_count(), false) {
  const auto* tag = std::get_if<MeshTag>(&place);
  if (tag == nullptr || read.regions.empty()) return;
  within_m_ = tag->within_m;
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    is_tagged_[e] = read.region_names[read.regions[e]] == tag->name;
    if (!is_tagged_[e] || within_m_ == 0.0) continue;
    for (const std::uint32_t node : mesh.element(e)) {
      std::vector<Vector3>& nodes_m = nodes_in_[cell_of(mesh.nodes_m[node])];
      const Vector3 node_m = mesh.nodes_m[node];
      if (std::find(nodes_m.begin(), nodes_m.end(), node_m) == nodes_m.end()) {
        nodes_m.push_back(node_m);
      }
    }
  }
}

std::vector<std::uint32_t> MeshPlace::nodes() const {
  std::vector<bool> is_in(mesh_.nodes_m.size(), false);
  for (std::size_t node = 0; node < is_in.size(); ++node)
    is_in[node] = is_within(mesh_.nodes_m[node]);
  for (std::size_t e = 0; e < is_tagged_.size(); ++e) {
    if (!is_tagged_[e]) continue;
    for (const std::uint32_t node : mesh_.element(e)) is_in[node] = true;
  }
  std::vector<std::uint32_t> nodes;
  for (std::uint32_t node = 0; node < is_in.size(); ++node) {
    if (is_in[node]) nodes.push_back(node);
  }
  return nodes;
}

bool MeshPlace::has_element(std::size_t element) const {
  Vector3 centroid_m = Vector3::Zero();
  for (const std::uint32_t corner : mesh_.element(element).first(4)) {
    centroid_m += 0.25 * mesh_.nodes_m[corner];
  }
  return is_tagged_[element] || is_within(centroid_m);
}

bool MeshPlace::has_face(const elastic::Face& face) const {
  Vector3 centroid_m = Vector3::Zero();
  for (std::size_t i = 0; i < 3; ++i) centroid_m += mesh_.nodes_m[face.nodes[i]] / 3.0;
  return is_tagged_[face.element] || is_within(centroid_m);
}

bool MeshPlace::is_within(const Vector3& point_m) const {
  if (contains(place_, point_m)) return true;
  if (nodes_in_.empty()) return false;
  const Cell center = cell_of(point_m);
  for (int i = 0; i < 27; ++i) {
    const auto nodes =
        nodes_in_.find({center[0] + i % 3 - 1, center[1] + i / 3 % 3 - 1, center[2] + i / 9 - 1});
    if (nodes == nodes_in_.end()) continue;
    for (const Vector3& node_m : nodes->second) {
      if ((node_m - point_m).squaredNorm() <= within_m_ * within_m_) return true;
    }
  }
  return false;
}

MeshPlace::Cell MeshPlace::cell_of(const Vector3& point_m) const {
  Cell cell{};
  for (int i = 0; i < 3; ++i) {
    cell[static_cast<std::size_t>(i)] = std::llround(std::floor(point_m[i] / within_m_));
  }
  return cell;
}

}  // namespace palpate::physics
