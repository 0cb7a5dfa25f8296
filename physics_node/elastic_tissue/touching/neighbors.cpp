// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic_tissue/touching/neighbors.h"

#include <algorithm>
#include <cstdio>
#include <memory>
#include <utility>
#include <variant>

#include "common/core/check.h"
#include "physics_node/files/surface_files.h"

namespace palpate::physics {
namespace {

constexpr double kMostOverlap_m = 3e-3;  // of a mesh and what it touches, in the session

}  // namespace

Neighbors neighbors_of(const SceneConfig& scene, const TissueConfig& tissue) {
  Neighbors neighbors;
  for (const auto& attached : std::get<ElasticMaterial>(tissue.material).attached) {
    if (attached.tissue) neighbors.tied.push_back(tied_surface_of(scene, *attached.tissue));
  }
  for (const auto& touches : std::get<ElasticMaterial>(tissue.material).touches) {
    const TissueConfig& other = scene.tissues.at(touches.tissue);
    if (std::holds_alternative<ElasticMaterial>(other.material)) {
      neighbors.elastic.push_back({.tissue = static_cast<std::uint32_t>(touches.tissue),
                                   .friction_coefficient = touches.friction_coefficient});
      continue;
    }
    auto shape = std::make_shared<const Shape>(to_shape(other.geometry));
    if (shape->is_sheet()) {
      throw SetupError(std::get<FileGeometry>(other.geometry).file + ": as \"" + other.name +
                       "\", which the elastic body \"" + tissue.name +
                       "\" touches: its surface must be closed, or it has no inside that keeps "
                       "the body out; close it or leave out elastic.touches");
    }
    neighbors.rigid.push_back({.name = other.name,
                               .surface = std::move(shape),
                               .friction_coefficient = touches.friction_coefficient,
                               .motion = other.motion});
  }
  return neighbors;
}

void check_outside(const elastic::Mesh& mesh, const std::vector<elastic::RigidNeighbor>& rigid,
                   const std::string& name) {
  if (rigid.empty()) return;
  const std::vector<elastic::Face> faces = elastic::surface_of(mesh);
  for (const elastic::RigidNeighbor& one : rigid) {
    double deepest_m = 0.0;
    for (const elastic::Face& face : faces) {
      for (std::size_t i = 0; i < 3; ++i) {
        const Vector3& corner_m = mesh.nodes_m[face.nodes[i]];
        deepest_m = std::max(deepest_m, -one.surface->view(corner_m).distance_m);
      }
    }
    if (deepest_m <= kMostOverlap_m) continue;
    char text[120];  // NOLINT: for snprintf
    std::snprintf(text, sizeof text, "\": by %.2g mm, must be at most %.2g mm; move one of the two",
                  1e3 * deepest_m, 1e3 * kMostOverlap_m);
    throw SetupError(name + "elastic.touches: its surface begins inside of \"" + one.name + text);
  }
}

}  // namespace palpate::physics
