// SPDX-License-Identifier: Apache-2.0
// mesh_place.h — which nodes, elements and faces of a mesh lie in a place that a session names.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "common/core/vector.h"
#include "common/session/scene_config.h"
#include "physics_node/elastic/mesh.h"
#include "physics_node/surfaces/tetrahedral_mesh.h"

namespace palpate::physics {

/// Throws SetupError if the place is a region that the mesh does not have.
/// @param name  begins the message
void check_tag(const RegionGeometry& place, const TetrahedralMesh& mesh, const std::string& name);

/// A place in a mesh. Positions are in W.
class MeshPlace {
 public:
  /// @param read  the file's mesh
  /// @param mesh  in W, linear or quadratic, the elements of `read` in their order; kept by
  ///     reference
  MeshPlace(const RegionGeometry& place, const TetrahedralMesh& read, const elastic::Mesh& mesh);

  /// Nodes within the place, and all nodes of a tagged element; ascending.
  [[nodiscard]] std::vector<std::uint32_t> nodes() const;
  /// The centroid lies there, or the element is tagged.
  [[nodiscard]] bool has_element(std::size_t element) const;
  /// The same for a face of an element.
  [[nodiscard]] bool has_face(const elastic::Face& face) const;

 private:
  using Cell = std::array<std::int64_t, 3>;  // of within_m
  [[nodiscard]] Cell cell_of(const Vector3& point_m) const;
  [[nodiscard]] bool is_within(const Vector3& point_m) const;

  const RegionGeometry& place_;
  const elastic::Mesh& mesh_;
  std::vector<bool> is_tagged_;  // elements
  double within_m_ = 0.0;
  std::map<Cell, std::vector<Vector3>> nodes_in_;  // of tagged elements
};

}  // namespace palpate::physics
