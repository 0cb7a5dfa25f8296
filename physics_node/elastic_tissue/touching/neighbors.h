// SPDX-License-Identifier: Apache-2.0
// neighbors.h — what an elastic tissue of a session touches.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/session/scene_config.h"
#include "physics_node/elastic/contact/rigid_contact.h"
#include "physics_node/elastic_tissue/attached/held_mesh.h"

namespace palpate::physics {

/// An elastic tissue that another one touches.
struct ElasticNeighbor {
  std::uint32_t tissue = 0;  ///< index in the scene
  double friction_coefficient = 0.0;
};

/// Of an elastic body.
struct Neighbors {
  std::vector<elastic::RigidNeighbor> rigid = {};  ///< that it cannot move
  std::vector<ElasticNeighbor> elastic = {};
  std::vector<TiedSurface> tied = {};  ///< of each of elastic.attached that names a tissue
};

/// In W. @throws SetupError  a file cannot be used, or its surface is open
[[nodiscard]] Neighbors neighbors_of(const SceneConfig& scene, const TissueConfig& tissue);

/// @param name  begins the message
/// @throws SetupError  the surface of the mesh begins more than 3 mm inside of what it cannot go
///     through
void check_outside(const elastic::Mesh& mesh, const std::vector<elastic::RigidNeighbor>& rigid,
                   const std::string& name);

}  // namespace palpate::physics
