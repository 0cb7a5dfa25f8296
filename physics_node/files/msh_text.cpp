// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cstdio>
#include <string>

#include "physics_node/files/tetrahedral_files.h"

namespace palpate::physics {

std::string msh_text(const TetrahedralMesh& mesh) {
  std::string text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";
  if (!mesh.region_names.empty()) {
    text += "$PhysicalNames\n" + std::to_string(mesh.region_names.size()) + "\n";
    for (std::size_t i = 0; i < mesh.region_names.size(); ++i) {
      text += "3 " + std::to_string(i + 1) + " \"" + mesh.region_names[i] + "\"\n";
    }
    text += "$EndPhysicalNames\n";
  }
  text += "$Nodes\n" + std::to_string(mesh.nodes_m.size()) + "\n";
  std::array<char, 128> line{};
  for (std::size_t i = 0; i < mesh.nodes_m.size(); ++i) {
    const Vector3& node = mesh.nodes_m[i];
    std::snprintf(line.data(), line.size(), "%zu %.7g %.7g %.7g\n", i + 1, node.x(), node.y(),
                  node.z());
    text += line.data();
  }
  text += "$EndNodes\n$Elements\n" + std::to_string(mesh.tetrahedra.size()) + "\n";
  for (std::size_t i = 0; i < mesh.tetrahedra.size(); ++i) {
    const std::string region = std::to_string(mesh.regions.empty() ? 1 : mesh.regions[i] + 1);
    text += std::to_string(i + 1);
    text.append(" 4 2 ").append(region).append(" ").append(region);
    for (const std::uint32_t corner : mesh.tetrahedra[i]) text += " " + std::to_string(corner + 1);
    text += "\n";
  }
  return text + "$EndElements\n";
}

}  // namespace palpate::physics
