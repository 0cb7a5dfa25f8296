// SPDX-License-Identifier: Apache-2.0
// touching_scene.h — boxes of soft tissue that lie on something.
#pragma once

#include <array>
#include <fstream>
#include <string>

#include "common/session/scene_config.h"
#include "physics_node/elastic/mesh.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/support/elastic/tetrahedra_of.h"
#include "tests/support/temp_folder.h"

namespace palpate::physics {

/// A box as a file, `cells` along each axis.
inline std::string box_file(const test::TempFolder& folder, const std::string& name,
                            const Vector3& lowest_m, const Vector3& highest_m,
                            const std::array<int, 3>& cells) {
  std::array<std::vector<double>, 3> planes;
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    planes[axis] = elastic::equal_planes(lowest_m[k], highest_m[k], cells[axis]);
  }
  const elastic::Mesh box = elastic::box_mesh(planes[0], planes[1], planes[2]);
  const std::string file = (folder.path() / (name + ".msh")).string();
  std::ofstream(file) << msh_text(test::tetrahedra_of(box));
  return file;
}

inline TissueConfig soft_box(const std::string& name, const std::string& file,
                             const ElasticMaterial& material) {
  return {.name = name,
          .geometry = FileGeometry{.kind = FileGeometry::Kind::kTetrahedralMesh, .file = file},
          .material = material};
}

inline TissueConfig bone(const Geometry& geometry) {
  return {.name = "bone",
          .geometry = geometry,
          .material = KelvinVoigtMaterial{.stiffness_newton_per_m = 5000.0}};
}

}  // namespace palpate::physics
