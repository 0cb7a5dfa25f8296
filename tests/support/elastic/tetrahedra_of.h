// SPDX-License-Identifier: Apache-2.0
// tetrahedra_of.h — a mesh of elastic bodies as a file has it.
#pragma once

#include "physics_node/elastic/mesh.h"
#include "physics_node/surfaces/tetrahedral_mesh.h"

namespace palpate::test {

/// The corners of its elements. @param moved_by_m  of all nodes
inline physics::TetrahedralMesh tetrahedra_of(const elastic::Mesh& mesh,
                                              const Vector3& moved_by_m = Vector3::Zero()) {
  physics::TetrahedralMesh made;
  for (const Vector3& node_m : mesh.nodes_m) made.nodes_m.emplace_back(node_m + moved_by_m);
  for (std::size_t e = 0; e < mesh.element_count(); ++e) {
    const auto corners = mesh.element(e);
    made.tetrahedra.push_back({corners[0], corners[1], corners[2], corners[3]});
  }
  return made;
}

}  // namespace palpate::test
