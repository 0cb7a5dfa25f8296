// SPDX-License-Identifier: Apache-2.0
#include "physics_node/files/mesh_builder.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::physics {
namespace {

constexpr std::int64_t kMostListed = 1'000'000'000;
constexpr std::size_t kMostRegions = 65'535;
// Six volumes over the cube of the longest edge; 0.7 for a regular tetrahedron.
constexpr double kFlattestElement = 1e-9;

}  // namespace

std::int64_t checked_count(const FileText& text, const char* what, std::int64_t count) {
  if (count < 0 || count > kMostListed) {
    text.fail(std::string(what) + " = " + std::to_string(count) + ": must be 0 … " +
              std::to_string(kMostListed));
  }
  if (count > static_cast<std::int64_t>(text.left())) {
    text.fail(std::string(what) + ": the file is too short for " + std::to_string(count));
  }
  return count;
}

void MeshBuilder::add_node(std::int64_t tag, const Vector3& place) {
  if (!index_of_.emplace(tag, static_cast<std::uint32_t>(mesh_.nodes_m.size())).second) {
    text_.fail("node " + std::to_string(tag) + ": is given twice");
  }
  mesh_.nodes_m.push_back(place);
}

void MeshBuilder::add_tetrahedron(std::int64_t tag, const std::array<std::int64_t, 4>& nodes,
                                  std::int64_t region, int line) {
  std::array<std::uint32_t, 4> corners{};
  for (std::size_t i = 0; i < 4; ++i) {
    const auto node = index_of_.find(nodes[i]);
    if (node == index_of_.end()) {
      text_.fail_at_line(line, "element " + std::to_string(tag) + ": node " +
                                   std::to_string(nodes[i]) + ": does not exist");
    }
    corners[i] = node->second;
  }
  mesh_.tetrahedra.push_back(corners);
  sources_.push_back({tag, line});
  const auto [known, is_new] =
      region_of_.try_emplace(region, static_cast<std::uint16_t>(region_of_.size()));
  if (is_new && region_of_.size() > kMostRegions) {
    text_.fail_at_line(line, "more than " + std::to_string(kMostRegions) + " regions");
  }
  mesh_.regions.push_back(known->second);
}

TetrahedralMesh MeshBuilder::take() {
  if (mesh_.tetrahedra.empty()) text_.fail("has no tetrahedra; save the volume, not its surface");
  const auto name = [&](std::size_t i) { return "element " + std::to_string(sources_[i].tag); };

  std::size_t inverted = 0;
  std::size_t first_inverted = 0;
  for (std::size_t i = 0; i < mesh_.tetrahedra.size(); ++i) {
    const auto& corners = mesh_.tetrahedra[i];
    double longest2 = 0.0;
    for (std::size_t a = 0; a < 4; ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        longest2 = std::max(longest2,
                            (mesh_.nodes_m[corners[a]] - mesh_.nodes_m[corners[b]]).squaredNorm());
      }
    }
    const double volume = six_volumes_m3(mesh_.nodes_m, corners);
    if (!(std::abs(volume) > kFlattestElement * longest2 * std::sqrt(longest2))) {
      text_.fail_at_line(sources_[i].line, name(i) + ": has no volume; repair the mesh");
    }
    if (volume < 0.0 && inverted++ == 0) first_inverted = i;
  }
  if (inverted == mesh_.tetrahedra.size()) {
    for (auto& corners : mesh_.tetrahedra) std::swap(corners[0], corners[1]);
  } else if (inverted > 0) {
    text_.fail_at_line(sources_[first_inverted].line,
                       name(first_inverted) + ": is inverted, as are " + std::to_string(inverted) +
                           " of " + std::to_string(mesh_.tetrahedra.size()) +
                           "; order the nodes of all elements alike");
  }
  drop_unused_nodes(mesh_);
  if (region_of_.size() == 1 && region_of_.contains(0)) {
    mesh_.regions.clear();
    return std::move(mesh_);
  }
  mesh_.region_names.resize(region_of_.size());
  for (const auto& [number, region] : region_of_) {
    const auto given = names_.find(number);
    mesh_.region_names[region] = given == names_.end() ? std::to_string(number) : given->second;
  }
  return std::move(mesh_);
}

}  // namespace palpate::physics
