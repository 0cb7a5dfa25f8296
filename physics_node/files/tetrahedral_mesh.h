// tetrahedral_mesh.h — volume meshes: from Gmsh and VTK files, and their surface.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/vector.h"
#include "physics_node/surfaces/triangle_surface.h"

namespace palpate::physics {

struct TetrahedralMesh {
  std::vector<Vector3> nodes_m;  ///< each used by some tetrahedron
  /// Positive volume: seen from corner 3 the corners 0, 1, 2 are counter-clockwise.
  std::vector<std::array<std::uint32_t, 4>> tetrahedra;
};

/// Gmsh `.msh` of version 1, 2.2 or 4.1, ASCII. Points, lines and faces are passed over, of
/// tetrahedra of second order the corners are taken; other volume elements are refused.
/// Lengths in the unit of the file. A mesh whose every element is inverted is turned over.
/// @throws SetupError  as "file:line: what: rule": malformed, numbers not finite, nodes that are
/// not
///     there or given twice, elements without volume, some inverted
[[nodiscard]] TetrahedralMesh parse_msh(std::string_view bytes, const std::string& file_name);

/// Legacy VTK (`# vtk DataFile`), ASCII or binary, UNSTRUCTURED_GRID; otherwise as parse_msh.
[[nodiscard]] TetrahedralMesh parse_vtk(std::string_view bytes, const std::string& file_name);

/// The mesh as Gmsh 2.2 ASCII.
[[nodiscard]] std::string msh_text(const TetrahedralMesh& mesh);

/// The faces that belong to one element only, facing outwards.
[[nodiscard]] TriangleMesh surface_of(const TetrahedralMesh& mesh);

}  // namespace palpate::physics
